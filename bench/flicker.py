"""Flicker: a shot of a moving camera and a moving thing, relit frame by frame, beside Cycles' own.

Both are denoised, of the same samples. What neighbouring frames differ by is motion and noise; the
second difference has little of the motion left.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.relight.many import relight_many
from arto.arto_addon.shot import scene_id
from arto.core import exr
from numpy.typing import NDArray

from . import reference, worlds
from .machine import write_rows
from .pictures import display, exposure_for

COLUMNS = 6


def moving_shot(width: int, frames: int) -> bpy.types.Scene:
    """The product shot: the camera goes an eighth around it, the head turns and rises."""
    scene = reference.new_scene("product", width, width * 3 // 4)
    camera, thing = scene.camera, scene.objects["monkey"]
    pivot = bpy.data.objects.new("pivot", None)
    scene.collection.objects.link(pivot)
    camera.parent = pivot
    height, turn = thing.location.z, thing.rotation_euler.z
    for frame, share in ((1, 0.0), (frames, 1.0)):
        pivot.rotation_euler.z = (share - 0.5) * math.pi / 4
        thing.location.z = height + 0.4 * share
        thing.rotation_euler.z = turn + share * math.pi / 3
        pivot.keyframe_insert("rotation_euler", frame=frame)
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_start, scene.frame_end = 1, frames
    # as artists do who know of crawling noise, or its standing still: both must follow it
    scene.cycles.use_animated_seed = True
    scene.frame_set(1)
    return scene


def flicker(
    out: Path, sheet: Path, names: list[str], width: int, frames: int, samples: int
) -> list[dict[str, Any]]:
    """A row for each world, and a contact sheet: a strip of relit frames above Cycles' own."""
    scene = moving_shot(width, frames)
    scene_id.give(scene)
    settings = scene.arto
    settings.samples, settings.keep = samples, "never"
    rows, strips = [], []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
        layer, every = scene.view_layers[0].name, range(1, frames + 1)
        worlds.set_world_hdri(scene, names[0])
        work.run(capture_frames(scene, layer, every))
        scene.render.film_transparent = True
        for name in names:
            worlds.set_world_hdri(scene, name)
            paths = work.run(relight_many(scene, layer, frames=every))
            relit = [next(iter(exr.read(p).values()))[..., :3] for p in paths]
            rendered = []
            for frame in every:
                scene.frame_set(frame)
                rendered.append(reference.render(scene, samples, 0, denoise=True).rgb)
            ours, theirs = np.stack(relit), np.stack(rendered)
            rows.append({"world": name, "frames": frames, "width": width, "samples": samples})
            for order in (1, 2):
                mine, its = (np.abs(np.diff(p, order, axis=0)).mean() for p in (ours, theirs))
                what = "difference" if order == 1 else "second difference"
                rows[-1] |= {what: float(mine), f"{what} of Cycles": float(its)}
                rows[-1][f"ratio of {what}s"] = float(mine / its)
            rows[-1]["off Cycles"] = float(np.abs(ours - theirs).mean() / theirs.mean())
            write_rows(out, rows)
            strips += [_strip(p, exposure_for(theirs)) for p in (ours, theirs)]
    sheet.parent.mkdir(parents=True, exist_ok=True)
    _write_png(sheet, np.concatenate(strips, axis=0))
    return rows


def _strip(pictures: NDArray, exposure: float) -> NDArray:
    """Frames in rows of `COLUMNS`, with a dark line below."""
    shown = display(pictures, exposure)
    lines = [
        np.concatenate(list(shown[i : i + COLUMNS]), axis=1)
        for i in range(0, len(shown) - len(shown) % COLUMNS, COLUMNS)
    ]
    return np.concatenate([*lines, np.zeros((4, *lines[0].shape[1:]))], axis=0)


def _write_png(path: Path, picture: NDArray) -> None:
    from matplotlib import image

    image.imsave(path, picture)


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    lines = ["| world | difference | Cycles' | ratio | second | Cycles' | ratio | off Cycles |"]
    lines.append("|---" * 8 + "|")
    for r in rows:
        cells = [r["world"]]
        for what in ("difference", "second difference"):
            values = r[what], r[f"{what} of Cycles"], r[f"ratio of {what}s"]
            cells += [f"{v:.4f}" for v in values[:2]] + [f"{values[2]:.2f}"]
        cells.append(f"{r['off Cycles']:.3f}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
