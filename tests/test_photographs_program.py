"""Photographs in the real program's window: the button, the job, and the panels of their scene."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from arto.core import exr
from arto.core.photographs import png_file
from program_tools import Program
from window_tools import windows

HEIGHT, WIDTH, LAMPS = 48, 64, 8
SIDEBAR = """
areas = bpy.context.window_manager.windows[0].screen.areas
next(a for a in areas if a.type == "VIEW_3D").spaces.active.show_region_ui = True
"""


def folder_of_a_sphere(there: Path) -> Path:
    """Eight pictures of a Lambert sphere, and lights.txt."""
    there.mkdir()
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    nx, ny = (x - 31.5) / 20, -(y - 23.5) / 20
    inside = nx * nx + ny * ny < 1
    normal = np.stack([nx, ny, np.sqrt(np.maximum(1 - nx * nx - ny * ny, 0))], axis=-1)
    z = 1 - 0.6 * (np.arange(LAMPS) + 0.5) / LAMPS
    turn, flat = np.arange(LAMPS) * 2.399963, np.sqrt(1 - z * z)
    lamps = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    for k, d in enumerate(lamps):
        light = np.clip(np.maximum(normal @ d, 0) * inside, 0, 1) ** (1 / 2.2)
        pixels = np.rint(255 * np.repeat(light[..., None], 3, -1)).astype(np.uint8)
        png_file.write(there / f"img_{k}.png", pixels)
    rows = "\n".join(" ".join(f"{v:.6f}" for v in d) for d in lamps)
    (there / "lights.txt").write_text(f"{LAMPS}\n{rows}\n")
    return there


def test_a_folder_becomes_a_shot_in_the_window(
    program: Program, made: Path, tmp_path: Path
) -> None:
    folder = folder_of_a_sphere(tmp_path / "stone")
    blend = Path(shutil.copy(made / "scene.blend", tmp_path))
    with windows(program, tmp_path) as opened:
        w = opened(blend)
        w.do(SIDEBAR)
        w.wait("tab('VIEW_3D')")
        w.button("bpy.ops.arto.open_photographs()")
        w.do(f"bpy.ops.arto.open_photographs('EXEC_DEFAULT', directory={str(folder)!r})")
        level, text = w.idle()
        assert level != "ERROR", text
        # the window shows the scene of the photographs, and their plate in the scene's world
        assert w.get("bpy.context.window_manager.windows[0].scene.name") == "stone"
        assert w.get("list(bpy.data.images['ARTO stone'].size)") == [WIDTH, HEIGHT]
        field = next((tmp_path / "arto").rglob("field/field.json"))
        worst = exr.read(field.parents[1] / "held_out.exr")[""]
        assert worst.max() > 0 and worst.shape[1] == 3 * worst.shape[0] * WIDTH // HEIGHT
        # nothing of it can be rendered: grey, and Live is not
        for button, is_grey in (("capture", True), ("verify", True), ("read_photographs", False)):
            assert w.get(f"bpy.ops.arto.{button}.poll()") != is_grey, button
        w.button("bpy.ops.arto.read_photographs()")
        assert w.alive
