"""Things in footage under four lights: a stand-in for what was filmed, ARTO's comp, and a render.

What was filmed is a render of the ground alone; the render at the end is of the ground with the
things on it, which no shot has. The ground is a shadow catcher to ARTO.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender.output import float_exr
from arto.arto_addon.capture import capture
from arto.arto_addon.plate import plate
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths, scene_id
from arto.arto_addon.stage.takes import THINGS
from arto.core import exr
from arto.core.field.field import Field
from arto.core.metrics import mean_relative_error
from numpy.typing import NDArray

from . import pictures, reference
from .building import PAWN, add, lathe
from .plates import scene_of
from .worlds import World

HDRIS = ("courtyard", "forest", "sunset", "city")
TITLES = ("filmed", "ARTO's comp", "rendered")


def _shot(size: tuple[int, int]) -> bpy.types.Scene:
    """A metal ball and a pawn on planks."""
    scene = scene_of("metal", "textured", size)
    bpy.data.objects.remove(scene.objects["ball1"])
    add(scene, "pawn", lathe(PAWN), bpy.data.materials["diffuse"], levels=2, place=(1.2, 0.4, 0.0))
    return scene


def _rendered(scene: bpy.types.Scene, samples: int, seed: int, things: bool) -> NDArray[np.float32]:
    """The ground as it is, with the world behind, denoised."""
    floor, others = scene.objects["floor"], [scene.objects[n] for n in ("ball0", "pawn")]
    floor.is_shadow_catcher = False
    for thing in others:
        thing.hide_render = not things
    scene.render.film_transparent = False
    with tempfile.TemporaryDirectory() as folder:
        cycles, render = scene.cycles, scene.render
        cycles.samples, cycles.seed, cycles.use_denoising = samples, seed, True
        float_exr(render, multilayer=False)
        render.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        found = next(iter(exr.read(Path(folder) / "render.exr").values()))[..., :3]
    floor.is_shadow_catcher = True
    for thing in others:
        thing.hide_render = False
    scene.render.film_transparent = True
    return found


def plate_demo(sheet: Path, size: tuple[int, int], samples: int, many: int) -> list[dict[str, Any]]:
    """A row for each world: errors on all that the comp changes, and the noise of the truth."""
    reference.registered()
    scene = _shot(size)
    scene_id.give(scene)
    rows, columns = [], []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        settings = scene.arto
        settings.samples, settings.keep = samples, "never"
        settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
        World(HDRIS[0]).apply(scene)
        work.run(capture.capture(scene, scene.view_layers[0].name))
        apart = Field(paths.field_folder(scene).parent / THINGS / "field")
        covered = apart.layer("alpha") > 0
        for name in HDRIS:
            World(name).apply(scene)
            filmed = _rendered(scene, many, 1, things=False)
            one, two = (_rendered(scene, many, seed, things=True) for seed in (2, 3))
            path, _ = work.run(relight.relight(scene))
            share = exr.read(plate.share_file(path))[""]
            comp = exr.read(path)[""][..., :3] + share * filmed
            changed = covered | (np.abs(share - 1).max(axis=-1) > 0.01)
            rows.append(
                {
                    "world": name,
                    "comp_error": mean_relative_error(comp, one, changed),
                    "noise_floor": mean_relative_error(two, one, changed),
                    "without": mean_relative_error(filmed, one, changed),
                }
            )
            columns.append((filmed, comp, one))
    _sheet(sheet, columns)
    return rows


def _sheet(path: Path, columns: list[tuple[NDArray, ...]]) -> None:
    from matplotlib import pyplot as plt

    height, width = columns[0][0].shape[:2]
    shape = (3.2 * len(columns), 3.2 * 3 * height / width + 0.4)
    figure, axes = plt.subplots(3, len(columns), figsize=shape, layout="constrained")
    for x, (column, name) in enumerate(zip(columns, HDRIS, strict=True)):
        exposure = pictures.exposure_for(column[2])
        for y, picture in enumerate(column):
            axis = axes[y, x]
            axis.imshow(pictures.display(picture, exposure), interpolation="nearest")
            axis.set_xticks([])
            axis.set_yticks([])
            if x == 0:
                axis.set_ylabel(TITLES[y])
            if y == 0:
                axis.set_title(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    lines = ["| world | comp | floor | footage alone |", "|---|---|---|---|"]
    for r in rows:
        values = (r["comp_error"], r["noise_floor"], r["without"])
        lines.append(f"| {r['world']} | {' | '.join(f'{v:.3f}' for v in values)} |")
    return "\n".join(lines)
