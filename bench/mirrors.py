"""What an artist looks at first: mirrors, glass, coat and panes at the size of a shot.

Each scene is captured and relit with the add-on's own operators, as an artist gets it, beside a
denoised and a plain render of as many samples. Truth is the mean of two denoised references; how
far these two are apart is the floor of every error here.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.core import exr, metrics
from arto.core.field.field import Field
from numpy.typing import NDArray

from . import mirror_scenes, reference, scenes
from .accuracy import flip, rerendered
from .machine import write_rows
from .mirror_metrics import by_material, patch_borders
from .mirror_sheet import Crop, crops
from .models import captured
from .worlds import World

mirror_scenes.register()

ARTO, RENDER, RENDER_DENOISED, FLOOR = "arto", "render", "render, denoised", "two references"
# What of each scene is looked at, and in which worlds.
CASES: dict[str, tuple[str, ...]] = {
    "four_spheres": ("courtyard", "interior", "checker", "softboxes"),
    "product": ("courtyard", "interior", "softboxes"),
    "mirrors": ("courtyard", "interior", "checker"),
    "pane": ("courtyard", "checker"),
}
QUICK: dict[str, tuple[str, ...]] = {
    "four_spheres": ("courtyard", "interior"),
    "product": ("courtyard",),
    "mirrors": ("interior",),
    "pane": ("courtyard",),
}


class Shot:
    """One scene, captured with some settings of the add-on and fitted."""

    def __init__(
        self, name: str, size: tuple[int, int], samples: int, settings: dict[str, Any]
    ) -> None:
        self.name, self.size, self.samples, self.settings = name, size, samples, settings
        there = captured(name, size, samples, **settings)
        self.folder = there.folder.parents[3].resolve()
        shot = there.head.shot
        self.scene_id = (shot.scene_id if shot else None) or ""
        self.seconds = there.head.seconds or 0.0
        scene = self.scene()
        # a field that is there may be of other code
        shutil.rmtree(paths.field_folder(scene), ignore_errors=True)
        work.run(fit.fit(scene))
        self.field = Field(paths.field_folder(scene))

    def scene(self) -> bpy.types.Scene:
        """The scene anew, with the folder of its capture."""
        scene = reference.new_scene(self.name, *self.size)
        for name, value in self.settings.items():
            setattr(scene.arto, name, value)
        scene.arto.samples, scene.arto.folder = self.samples, str(self.folder)
        scene.arto.scene_id = self.scene_id
        return scene

    def picture(self, world: World) -> NDArray[np.float32]:
        """What the add-on's relight operator writes."""
        scene = self.scene()
        world.apply(scene)
        scene.render.film_transparent = True
        with tempfile.TemporaryDirectory() as folder:
            scene.arto.output = str(Path(folder) / "relit.exr")
            path, _ = work.run(relight.relight(scene))
            return exr.read(path)[""][..., :3]

    def strongest(self) -> NDArray[np.intp]:
        """(H, W): the patch that gives each pixel the most."""
        out = np.zeros(self.field.shape, np.intp)
        for tile in self.field.tiles:
            best = np.zeros(tile.region.pixels, np.float32)
            where = np.zeros(tile.region.pixels, np.intp)
            for k in range(tile.patches):
                for entries in tile.entries(k):
                    size = entries.coefficient.sum(axis=-1)
                    more = size > best[entries.pixels]
                    best[entries.pixels[more]] = size[more]
                    where[entries.pixels[more]] = k
            out[tile.region.slices] = where.reshape(tile.region.height, tile.region.width)
        return out


def truth_of(
    name: str, world: World, size: tuple[int, int], many: int
) -> tuple[reference.Picture, reference.Picture]:
    """Two denoised references of their own seeds, kept by content."""

    def made() -> bpy.types.Scene:
        return reference.new_scene(name, *size)

    one, two = (reference.reference(name, world, size, many, s, made, denoise=True) for s in (1, 2))
    return one, two


def rows_of(
    shot: Shot, world: World, many: int, label: str
) -> tuple[list[dict[str, Any]], dict[str, NDArray], NDArray]:
    """The rows of a scene under a world, its pictures by method, and its material index."""
    one, two = truth_of(shot.name, world, shot.size, many)
    truth, seen = (one.rgb + two.rgb) / 2, one.alpha > 0.999
    masks = {"all": seen}
    masks |= {m: seen & (one.index == i) for m, i in scenes.MATERIALS[shot.name].items()}
    borders = patch_borders(shot.strongest(), one.index)
    raw, clean = rerendered(shot.name, world, shot.size, shot.samples)
    pictures = {label: shot.picture(world), RENDER_DENOISED: clean, RENDER: raw}
    rows = []
    for method, picture in {**pictures, FLOOR: one.rgb}.items():
        against = two.rgb if method == FLOOR else truth
        found = by_material(picture, against, masks, borders)
        behind = np.where(seen[..., None], np.maximum(picture, 0), against).astype(np.float32)
        whole = {
            "flip": flip(behind, against.astype(np.float32)),
            "relmse": float(metrics.relative_squares(picture, one.rgb, two.rgb, seen).mean()),
        }
        for material, errors in found.items():
            about = {"scene": shot.name, "world": world.label, "material": material}
            about |= {"samples": shot.samples, "size": list(shot.size), "method": method}
            rows.append({**about, **errors, **(whole if material == "all" else {})})
    return rows, {"Cycles": truth, **pictures}, one.index


def mirrors(
    out: Path,
    cases: dict[str, tuple[str, ...]],
    size: tuple[int, int],
    samples: Iterable[int],
    many: int,
    settings: dict[str, Any],
    sheet: Path | None = None,
    label: str = ARTO,
) -> list[dict[str, Any]]:
    """All rows; written to `out` after each world. settings: of the add-on; label: what ARTO is
    called in the rows."""
    rows: list[dict[str, Any]] = []
    sheets: list[Crop] = []
    for name, worlds in cases.items():
        for n in samples:
            # first: they need no capture, which takes the most memory
            for world in worlds:
                truth_of(name, World(world), size, many)
            shot = Shot(name, size, n, settings)
            about = {
                "bytes_per_pixel": shot.field.bytes_per_pixel(),
                "capture_seconds": shot.seconds,
                "fit_seconds": shot.field.about.fit_seconds,
                "codes": shares_of(shot.field),
            }
            for world in worlds:
                found, pictures, index = rows_of(shot, World(world), many, label)
                for row in found:
                    if row["method"] == label and row["material"] == "all":
                        row |= about
                rows += found
                sheets.append(Crop(f"{name}, {world}, {n} samples", pictures, index, name))
                write_rows(out, rows)
                print(table(found), flush=True)
                print(f"{name} {world} {n}: {about}", flush=True)
    if sheet:
        crops(sheet, sheets, (label, RENDER_DENOISED))
    return rows


def shares_of(field: Field) -> dict[str, float]:
    """Of all entries the share of each model."""
    used: dict[str, int] = {}
    for tile in field.tiles:
        for name, count in tile.used.items():
            used[name] = used.get(name, 0) + count
    total = sum(used.values()) or 1
    return {name: round(count / total, 5) for name, count in used.items()}


def table(rows: list[dict[str, Any]]) -> str:
    """Errors by material in Markdown, each also over that of the denoised render."""
    lines = [
        "| scene, world | material | method | error | over denoised | worst block | hue | dark "
        "| borders |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    rival = {
        (r["scene"], r["world"], r["material"], r["samples"]): r["error"]
        for r in rows
        if r["method"] == RENDER_DENOISED
    }
    for r in rows:
        if r["method"] == RENDER:
            continue
        base = rival[r["scene"], r["world"], r["material"], r["samples"]]
        cells = [f"{r['error']:.4f}", f"{r['error'] / base:.2f}" if base else ""]
        for name in ("worst", "chroma", "dark", "borders"):
            cells.append("" if r[name] is None else f"{r[name]:.4f}")
        lines.append(
            f"| {r['scene']}, {r['world']} | {r['material']} | {r['method']} | "
            + " | ".join(cells)
            + " |"
        )
    return "\n".join(lines)
