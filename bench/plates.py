"""Plates: things on a ground that is not there, beside Cycles' own shadow catcher.

The truth is Cycles' catcher pass at many samples, in two seeds, whose difference is the floor.
Where things cover a pixel in part, Cycles knows what of it they cover; it is taken from the same
render for all methods.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
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
from arto.arto_addon.stage.stage import stage
from arto.arto_addon.stage.takes import THINGS
from arto.core import exr
from arto.core.field.field import Field
from arto.core.metrics import mean_relative_error
from mathutils import Euler
from numpy.typing import NDArray

from . import building, reference
from .building import GLASS, MATT, METAL, add, add_camera, fresh_scene, materials_of, sphere
from .machine import write_rows
from .worlds import World

# isort: split
import bmesh

GROUNDS = ("diffuse", "glossy", "textured", "sloped")
KINDS = ("diffuse", "metal", "glass", "hair")
HDRIS = ("courtyard", "city", "forest", "interior", "night", "studio", "sunrise", "sunset")
TURNS = (0.0, 120.0, 240.0)
# Of these every thing is looked at on every ground; of the others one pair in turn.
OFTEN = ("courtyard", "city")
ARTO, CYCLES, DENOISED = "arto", "cycles catcher", "cycles catcher denoised"
LOOKS: dict[str, building.Look] = {
    "diffuse": {**MATT, "Base Color": (0.7, 0.25, 0.1)},
    "metal": {**METAL, "Roughness": 0.25, "Base Color": (0.9, 0.85, 0.8)},
    "glass": GLASS,
    "hair": {"Roughness": 0.5, "Base Color": (0.25, 0.13, 0.06)},
    "ground": {**MATT, "Base Color": (0.5, 0.48, 0.45)},
    "shiny": {"Roughness": 0.2, "Base Color": (0.3, 0.3, 0.32)},
}


def scene_of(thing: str, on: str, size: tuple[int, int]) -> bpy.types.Scene:
    """Two balls of a material on a shadow catcher, film transparent."""
    scene = fresh_scene(*size)
    materials = materials_of(LOOKS)
    floor, slope = bmesh.new(), bmesh.new()
    bmesh.ops.create_grid(floor, x_segments=1, y_segments=1, size=6.0)
    material = materials["shiny" if on == "glossy" else "ground"]
    if on == "textured":
        _stripes(material)
    add(scene, "floor", floor, material)
    if on == "sloped":
        bmesh.ops.create_grid(slope, x_segments=1, y_segments=1, size=6.0)
        add(scene, "slope", slope, material, place=(0, 6.5, 2.5), turn=Euler((0.9, 0, 0)))
    else:
        slope.free()
    for i, place in enumerate(((-1.1, 0.0, 1.0), (1.3, 0.6, 0.8))):
        add(scene, f"ball{i}", sphere(place[2]), materials[thing], place=place)
        if thing == "hair":
            _hair(scene.objects[f"ball{i}"])
    for name in ("floor", "slope"):
        if name in scene.objects:
            scene.objects[name].is_shadow_catcher = True
    add_camera(scene, place=(0.0, -9.0, 4.0), target=(0.0, 0.0, 0.6), lens=52.0)
    scene.render.film_transparent = True
    return scene


def _stripes(material: bpy.types.Material) -> None:
    nodes, links = material.node_tree.nodes, material.node_tree.links
    wave = nodes.new("ShaderNodeTexWave")
    wave.inputs["Scale"].default_value = 1.0
    ramp = nodes.new("ShaderNodeMix")
    ramp.data_type = "RGBA"
    links.new(wave.outputs["Fac"], ramp.inputs[0])
    ramp.inputs[6].default_value = (0.1, 0.12, 0.2, 1)
    ramp.inputs[7].default_value = (0.7, 0.6, 0.5, 1)
    links.new(ramp.outputs[2], nodes["Principled BSDF"].inputs["Base Color"])


def _hair(thing: bpy.types.Object) -> None:
    system = thing.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count, system.hair_length = "HAIR", 1500, 0.35
    system.root_radius, system.radius_scale = 1.0, 0.015


@dataclass(frozen=True)
class Plate:
    """rgb (H, W, 3), premultiplied; share (H, W, 3) of what is behind; its seconds and renders."""

    rgb: NDArray[np.floating]
    share: NDArray[np.floating]
    seconds: float
    renders: int

    def over(self, footage: NDArray) -> NDArray:
        return self.rgb + self.share * footage


def by_cycles(
    scene: bpy.types.Scene, samples: int, seed: int, things: NDArray, denoise: bool = False
) -> Plate:
    """What Cycles makes of the same shot."""
    begun = time.perf_counter()
    with stage(scene, scene.view_layers[0].name) as on, tempfile.TemporaryDirectory() as folder:
        float_exr(on.scene.render)
        on.scene.view_layers[0].cycles.use_pass_shadow_catcher = True
        cycles = on.scene.cycles
        cycles.samples, cycles.seed, cycles.use_denoising = samples, seed, denoise
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
        on.scene.render.filepath = str(Path(folder) / "catcher.exr")
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
        found = exr.read(Path(folder) / "catcher.exr")
    rgb, share = (
        next(p for n, p in found.items() if n.endswith(name))[..., :3]
        for name in ("Combined", "Shadow Catcher")
    )
    return Plate(rgb, (1 - things)[..., None] * share, time.perf_counter() - begun, 1)


def by_arto(scene: bpy.types.Scene) -> Plate:
    begun = time.perf_counter()
    path, _ = work.run(relight.relight(scene))
    rgb = exr.read(path)[""][..., :3]
    share = exr.read(plate.share_file(path))[""]
    return Plate(rgb, share, time.perf_counter() - begun, 0)


def footage_of(size: tuple[int, int]) -> NDArray[np.float32]:
    """A rendered stand-in for what was filmed: a floor of planks, bright and dark."""
    width, height = size
    y, x = np.mgrid[:height, :width] / width
    planks = 0.35 + 0.25 * np.sin(40 * x / (0.4 + y)) * np.sin(9 * y)
    return (planks[..., None] * np.array([1.0, 0.8, 0.6])).astype(np.float32)


def compare(found: Plate, truth: Plate, other: Plate, things: NDArray) -> dict[str, float]:
    """Errors of a plate, and the floor: what two of the truth's halves differ by."""
    footage = footage_of((things.shape[1], things.shape[0]))
    bare, edge = things == 0, (things > 0.01) & (things < 0.99)
    comp = truth.over(footage)

    def error(one: NDArray, two: NDArray, mask: NDArray) -> float:
        return mean_relative_error(one, two, mask) if mask.any() else 0.0

    everywhere = np.ones_like(bare)
    return {
        "ratio_error": error(found.share, truth.share, bare),
        "comp_error": error(found.over(footage), comp, everywhere),
        "edge_error": error(found.over(footage), comp, edge),
        "noise_floor": error(other.over(footage), comp, everywhere),
        "ratio_floor": error(other.share, truth.share, bare),
        "worst": float(np.abs(found.share - truth.share)[bare].max()),
    }


def cases(quick: bool) -> list[tuple[str, str, World]]:
    """(thing, ground, world): all pairs under two worlds, and each other world on one in turn."""
    pairs = [(thing, on) for on in GROUNDS for thing in KINDS]
    if quick:
        pairs = [("metal", "diffuse"), ("diffuse", "glossy")]
    out = [(*pair, World(name)) for pair in pairs for name in OFTEN]
    if not quick:
        rest = [World(n, t) for n in HDRIS for t in TURNS if n not in OFTEN or t]
        out += [(*pairs[i % len(pairs)], world) for i, world in enumerate(rest)]
    return sorted(out, key=lambda case: case[:2])


def plates(
    out: Path, quick: bool, size: tuple[int, int], samples: int, many: int
) -> list[dict[str, Any]]:
    """A row for each case and method, written after each."""
    rows: list[dict[str, Any]] = []
    todo = cases(quick)
    for thing, on in dict.fromkeys(case[:2] for case in todo):
        mine = [case[2] for case in todo if case[:2] == (thing, on)]
        rows += _pair(thing, on, mine, size, samples, many)
        write_rows(out, rows)
        print(f"{thing} on {on}: {len(mine)} worlds", flush=True)
    return rows


def _pair(
    thing: str, on: str, worlds: Iterable[World], size: tuple[int, int], samples: int, many: int
) -> list[dict[str, Any]]:
    reference.registered()
    scene = scene_of(thing, on, size)
    scene_id.give(scene)
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        settings = scene.arto
        settings.samples, settings.keep = samples, "never"
        settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
        begun = time.perf_counter()
        work.run(capture.capture(scene, scene.view_layers[0].name))
        captured = time.perf_counter() - begun
        beside = paths.field_folder(scene).parent / THINGS / "field"
        things = Field(beside).layer("alpha")
        for world in worlds:
            world.apply(scene)
            one, two = (by_cycles(scene, many, seed, things) for seed in (11, 12))
            truth = Plate((one.rgb + two.rgb) / 2, (one.share + two.share) / 2, 0, 2)
            found = {
                ARTO: by_arto(scene),
                CYCLES: by_cycles(scene, samples, 3, things),
                DENOISED: by_cycles(scene, samples, 3, things, denoise=True),
            }
            for method, each in found.items():
                about = {"scene": thing, "ground": on, "world": world.label, "method": method}
                about |= {"seconds": each.seconds, "renders": each.renders}
                about |= compare(each, truth, one, things)
                if method == ARTO:
                    about["capture_seconds"] = captured
                rows.append(about)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: each case, then how ARTO stands to Cycles' denoised catcher."""
    columns = ("ratio_error", "comp_error", "edge_error", "noise_floor")
    lines = ["| thing | ground | world | method | ratio | comp | edges | floor | worst | seconds |"]
    lines.append("|---" * 10 + "|")
    for r in rows:
        cells = [r["scene"], r["ground"], r["world"], r["method"]]
        cells += [f"{r[c]:.4f}" for c in columns] + [f"{r['worst']:.2f}", f"{r['seconds']:.1f}"]
        lines.append(f"| {' | '.join(cells)} |")
    ours = [r for r in rows if r["method"] == ARTO]
    theirs = [r for r in rows if r["method"] == DENOISED]
    lines.append("")
    for what in ("ratio_error", "comp_error", "edge_error"):
        ratios = [a[what] / max(b[what], 1e-6) for a, b in zip(ours, theirs, strict=True)]
        lines.append(
            f"- {what}: {statistics.median(ratios):.2f} times that of Cycles' denoised catcher in "
            f"the median, {max(ratios):.2f} at most"
        )
    over = max(r["comp_error"] - r["noise_floor"] for r in ours)
    lines.append(f"- comp_error over the floor: {over:.4f} at most")
    return "\n".join(lines)
