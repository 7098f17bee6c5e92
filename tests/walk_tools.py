"""A window that is arranged as an artist has it, and the pictures that are taken of it."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from window_tools import Window

ARRANGE = """
import sys
live = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.live.live"))
window = bpy.context.window_manager.windows[0]
screen = window.screen
view = next(a for a in screen.areas if a.type == "VIEW_3D")
region = next(r for r in view.regions if r.type == "WINDOW")
with bpy.context.temp_override(window=window, area=view, region=region):
    bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
left, right = sorted((a for a in screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
left.ui_type = "IMAGE_EDITOR"
right.spaces.active.region_3d.view_perspective = "CAMERA"
right.spaces.active.show_region_ui = True
for area in screen.areas:
    if area.type == "PROPERTIES":
        area.spaces.active.context = "RENDER"
"""
TAB = "tab('VIEW_3D')"
# Counts the calls of ARTO's timers, handlers and panels, and keeps those that held up the window
# for more than 50 ms: of the window's own thread, whatever else the machine does. What Blender
# itself takes for saving a copy of the file is not counted.
WATCH = """
import functools, sys, time
slow, counts, saving = [], {}, [0.0]


def watched(name, call):
    @functools.wraps(call)
    def inner(*a, **k):
        begun, saved = time.thread_time(), saving[0]
        try:
            return call(*a, **k)
        finally:
            spent = time.thread_time() - begun - (saving[0] - saved)
            counts[name] = counts.get(name, 0) + 1
            if spent > 0.05:
                slow.append((name, round(spent, 3)))
    return inner


def module(end):
    return next(m for n, m in sys.modules.items() if n.endswith(".arto_addon." + end))


def watch_for_waits():
    for end, names in {
        "live.live": ("_tick",), "job.session": ("_follow",), "ui.overlay": ("_follow",),
        "shot.watch": ("_look", "_await_pixels"),
    }.items():
        for name in names:
            setattr(module(end), name, watched(f"{end}.{name}", getattr(module(end), name)))
    for kind in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, kind)
        for i, call in enumerate(handlers if isinstance(handlers, list) else ()):
            if ".arto_addon." in (getattr(call, "__module__", "") or ""):
                handlers[i] = watched(f"{kind} {call.__module__}", call)
    for panel in module("ui.places").Draws.__subclasses__():
        panel.draw_column = staticmethod(watched(panel.__name__, panel.draw_column))
    snapshot = module("job.snapshot")
    take = snapshot.take

    def timed(*a, **k):
        begun = time.thread_time()
        try:
            return take(*a, **k)
        finally:
            saving[0] += time.thread_time() - begun

    snapshot.take = timed


watch_for_waits()
"""


class Walk:
    """A window, and the pictures that are taken on the way."""

    def __init__(self, opener: Callable[..., Window], blend: Path, folder: Path | None) -> None:
        self._opener, self.blend = opener, blend
        self.w, self.folder, self.number, self.clicks = opener(blend), folder, 0, 0

    def again(self) -> Window:
        """Another window on the same file."""
        self.w = self._opener(self.blend)
        return self.w

    def shot(self, name: str) -> None:
        """A picture of the screen as it is now."""
        self.number += 1
        if self.folder is None:
            return
        time.sleep(1.0)  # software draws slowly
        path = self.folder / f"{self.number:02d}_{name}.png"
        line = [
            "import",
            "-window",
            "root",
            "-resize",
            "1200x",
            "-dither",
            "None",
            "-colors",
            "64",
            f"png8:{path}",
        ]
        subprocess.run(line, env={**os.environ, "DISPLAY": self.w.display}, check=True)

    def press(self, button: str, until: str, across: float = 0.45, start: int = 5) -> None:
        """Click a button of the sidebar until it has done what it does: where software draws the
        window, one that is being drawn anew may miss a click."""
        for _ in range(4):
            self.w.click(*self.w.button(button, across, start))
            self.clicks += 1
            end = time.monotonic() + 10
            while time.monotonic() < end:
                if self.w.get(until):
                    return
                time.sleep(0.05)
        raise AssertionError(f"{button} does not lead to {until}: {self.w.printed}")

    def picture(self, u: float, v: float) -> tuple[int, int]:
        """A place on the picture that the image editor shows, from its left and bottom."""
        # where the picture is, the editor knows once it was drawn
        self.w.do("bpy.ops.wm.redraw_timer(type='DRAW_WIN_SWAP', iterations=1)")
        left, top, _, height = self.w.get("box('IMAGE_EDITOR', 'WINDOW')")
        at = self.w.get(
            f"[r.view2d.view_to_region({u}, {v}, clip=False) for a in "
            "bpy.context.window_manager.windows[0].screen.areas if a.type == 'IMAGE_EDITOR' "
            "for r in a.regions if r.type == 'WINDOW'][0]"
        )
        return left + at[0], top + height - at[1]
