"""Every support model on the same captures, against Cycles: error, bytes and time."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import arto
import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.capture import capture
from arto.arto_addon.world.bake import bake
from arto.core import metrics
from arto.core.capture.capture_set import CaptureSet
from arto.core.field.field import Field
from arto.core.fit import matte
from arto.core.fit.choice import CHOICES
from arto.core.fit.fit import fit
from arto.core.light.light import PatchLight
from arto.core.relight import relight
from arto.core.supports import NOTHING, REST
from numpy.typing import NDArray

from . import reference, scenes
from .machine import write_rows
from .worlds import World

OUT = Path("out/models")
PACKAGE = Path(arto.__file__).parent
# The rooms of the code that decides what a capture set holds.
ROOMS = (
    *("arto_addon/capture", "arto_addon/stage", "arto_addon/settings"),
    *("core/capture", "core/patterns"),
)
DECIDES = [
    PACKAGE / "core" / "hemicube.py",
    *(p for room in ROOMS for p in sorted((PACKAGE / room).glob("*.py"))),
]
STAGE = "whole 16x16"
MATTE = "matte"
AUTO_RGB = "auto per channel"


def captured(
    scene_name: str, size: tuple[int, int], samples: int, seed: int = 0, **settings: Any
) -> CaptureSet:
    """The capture set of a scene under these settings, kept by content."""
    code = [path.read_text() for path in DECIDES]
    key = reference.content_key(
        scene=scene_name, size=size, samples=samples, seed=seed, settings=settings, code=code
    )
    folder = OUT / f"{scene_name}_{key}"
    scene = reference.new_scene(scene_name, *size)
    for name, value in {"samples": samples, "seed": seed, "folder": "", **settings}.items():
        setattr(scene.arto, name, value)
    scene.arto.folder = str(folder.resolve())
    # by its content: whatever scene it was captured from is this one
    there = next(folder.glob("*/*/*/capture/capture.json"), None)
    if there is None:
        return CaptureSet(work.run(capture.capture(scene, scene.view_layers[0].name)))
    return CaptureSet(there.parent)


def fitted(source: CaptureSet, choice: str, separate: bool = False) -> Field:
    """The capture set fitted anew with a choice of model."""
    name = f"field_{choice}_rgb" if separate else f"field_{choice}"
    folder = source.folder.with_name(name)
    shutil.rmtree(folder, ignore_errors=True)
    for _ in fit(source, folder, choice, separate):
        pass
    return Field(folder)


class Methods:
    """The methods of one scene: each a name and a way to relight, with its costs."""

    def __init__(self, scene_name: str, size: tuple[int, int], samples: int, seed: int) -> None:
        self.rich = captured(
            scene_name, size, samples, seed, patterns="moments_uv", grain=True, adaptive=False
        )
        fine = captured(
            scene_name, size, samples, seed, patterns="white", patches=16, adaptive=False
        )
        self.costs: dict[str, dict[str, float]] = {}
        self.ways: dict[str, Callable[[PatchLight, PatchLight], NDArray]] = {}
        self.fields: dict[str, Field] = {}
        for choice in CHOICES:
            self._add_field(choice, fitted(self.rich, choice))
        self._add_field(AUTO_RGB, fitted(self.rich, "auto", separate=True))
        self._add_field(STAGE, fitted(fine, "whole"), fine=True)
        begun = time.perf_counter()
        data = self.rich.read(0)
        read = time.perf_counter() - begun
        basis = data.basis.reshape(*data.basis.shape[:2], -1, 3)
        caps = matte.fit(basis, self.rich.patterns, self.rich.hemicube)
        self.ways[MATTE] = lambda light, _: matte.relight(caps, light).reshape(*size[::-1], 3)
        self.costs[MATTE] = {
            "bytes_per_pixel": matte.BYTES_PER_PIXEL,
            "fit_seconds": time.perf_counter() - begun - read,
            "read_seconds": read,
        }
        self.hemicubes = (self.rich.hemicube, fine.hemicube)

    def _add_field(self, name: str, field: Field, fine: bool = False) -> None:
        self.fields[name] = field
        self.ways[name] = lambda light, other: relight(field, other if fine else light)[..., :3]
        read = field.about.read_seconds or 0.0
        self.costs[name] = {
            "bytes_per_pixel": field.bytes_per_pixel(),
            "fit_seconds": (field.about.fit_seconds or 0.0) - read,
            "read_seconds": read,
        }


def truth(
    scene_name: str, world: World, size: tuple[int, int], samples: int
) -> tuple[bpy.types.Scene, reference.Picture, reference.Picture]:
    """The scene under the world, and its reference by two seeds."""
    scene = reference.new_scene(scene_name, *size)
    world.apply(scene)
    one, two = (
        reference.reference(scene_name, world, size, samples, seed, lambda: scene)
        for seed in (1, 2)
    )
    return scene, one, two


def models(
    out: Path,
    scene_names: Iterable[str],
    hdris: Iterable[str],
    size: tuple[int, int],
    samples: int,
    many: int,
) -> list[dict[str, Any]]:
    """Rows of every method on every scene and HDRI; written after each scene."""
    rows: list[dict[str, Any]] = []
    hdris = list(hdris)
    for scene_name in scene_names:
        methods = Methods(scene_name, size, samples, 0)
        index = None
        for hdri in hdris:
            scene, one, two = truth(scene_name, World(hdri), size, many)
            environment = bake(scene, scene.arto.environment_width)
            lights = [PatchLight(environment, h) for h in methods.hemicubes]
            mean = (one.rgb + two.rgb) / 2
            seen, index = one.alpha > 0.999, one.index
            floor = metrics.mean_relative_error(one.rgb, two.rgb, seen)
            for name, way in methods.ways.items():
                picture = way(*lights)
                rows.append(
                    {
                        "scene": scene_name,
                        "hdri": hdri,
                        "method": name,
                        "samples": samples,
                        "mean_relative_error": metrics.mean_relative_error(picture, mean, seen),
                        "noise_floor": floor,
                        **methods.costs[name],
                        "by_material": {
                            m: metrics.mean_relative_error(picture, mean, seen & (index == i))
                            for m, i in scenes.MATERIALS[scene_name].items()
                        },
                    }
                )
            print(f"{scene_name} {hdri} done", flush=True)
        if index is not None:
            shares = entry_shares(methods.fields["auto"], index, scenes.MATERIALS[scene_name])
            for row in rows:
                if row["scene"] == scene_name and row["method"] == "auto":
                    row["shares"] = shares
        write_rows(out, rows)
    return rows


def entry_shares(
    field: Field, index: NDArray, materials: dict[str, int]
) -> dict[str, dict[str, float]]:
    """Share of the entries with light that each model took, by material."""
    out = {}
    codes = np.asarray(field.tiles[0].codes)
    for name, number in materials.items():
        chosen = codes[:, (index == number).ravel()]
        lit = max(int((~np.isin(chosen, (NOTHING, REST))).sum()), 1)
        out[name] = {
            model: float((chosen == code).sum() / lit)
            for code, model in ((1, "whole"), (2, "linear"), (3, "box"))
        }
    return out


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: methods against HDRIs, a table a scene, and the shares of the models."""
    lines = []
    for scene in dict.fromkeys(r["scene"] for r in rows):
        mine = [r for r in rows if r["scene"] == scene]
        hdris = list(dict.fromkeys(r["hdri"] for r in mine))
        lines += [f"**{scene}**, {mine[0]['samples']} samples", ""]
        lines.append("| method | " + " | ".join(hdris) + " | bytes a pixel | fit s | read s |")
        lines.append("|---" * (len(hdris) + 4) + "|")
        floor = [next(r for r in mine if r["hdri"] == h)["noise_floor"] for h in hdris]
        lines.append("| noise floor | " + " | ".join(f"{f:.3f}" for f in floor) + " | | | |")
        for method in dict.fromkeys(r["method"] for r in mine):
            found = [r for r in mine if r["method"] == method]
            cells = [f"{r['mean_relative_error']:.3f}" for r in found]
            r = found[0]
            cells += [f"{r['bytes_per_pixel']:.0f}", f"{r['fit_seconds']:.2f}"]
            lines.append(f"| {method} | " + " | ".join(cells) + f" | {r['read_seconds']:.2f} |")
        shares = next((r["shares"] for r in mine if "shares" in r), {})
        lines += ["", "| material | whole | linear | box |", "|---|---|---|---|"]
        for material, s in shares.items():
            lines.append(f"| {material} | " + " | ".join(f"{x:.0%}" for x in s.values()) + " |")
        lines.append("")
    return "\n".join(lines)
