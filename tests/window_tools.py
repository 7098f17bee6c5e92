"""Blender's window for tests: real keys and a real mouse on a display of its own.

A test tells the window what to look at in Python, one request after the other, and an artist's
gestures come from the keyboard. Some keys are bound to ARTO's buttons, and call them as a click
does.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from program_tools import ROOT, Program

BUTTONS = {"capture": "F5", "fit": "F6", "relight": "F7", "build_hemicube": "F8"}

# Runs in the window: takes requests from a folder, answers there.
DRIVER = """
import json, os, sys, traceback
import bpy

folder, buttons = sys.argv[-2], json.loads(sys.argv[-1])
session = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.job.session"))
status = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.shot.status"))
paths = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.shot.paths"))


def region_of(area_type, region_type):
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == area_type)
    return window, area, next(r for r in area.regions if r.type == region_type)


def space_of():
    return region_of("IMAGE_EDITOR", "WINDOW")[1].spaces.active


def box(area_type, region_type):
    # left, top, width and height of a region on the display
    window, _, region = region_of(area_type, region_type)
    return [region.x, window.height - region.y - region.height, region.width, region.height]


def under(area_type, region_type):
    # of the button that the mouse is over: how its operator is called in Python, or the path of its
    # property
    manager = bpy.context.window_manager
    manager.clipboard = ""
    window, area, region = region_of(area_type, region_type)
    with bpy.context.temp_override(window=window, area=area, region=region):
        for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
            if copy.poll():
                copy()
                break
    return manager.clipboard


def tab(*area_types):
    # whether the sidebars of these areas show ARTO's tab: one that was never drawn has none yet
    for area in bpy.context.window_manager.windows[0].screen.areas:
        for region in area.regions:
            if area.type in area_types and region.type == "UI":
                try:
                    region.active_panel_category = "ARTO"
                except TypeError:
                    return False
    return True


drawn = set()


def watch():
    # from now on, where a panel of ARTO is drawn is kept in `drawn`, by the type of the area
    for panel in bpy.types.Panel.__subclasses__():
        if ".arto_addon." in panel.__module__:
            panel.append(lambda self, context: drawn.add(context.area.type))


names = {
    "bpy": bpy, "session": session, "status": status, "paths": paths, "at": [0], "box": box,
    "under": under, "tab": tab, "drawn": drawn, "watch": watch, "region_of": region_of,
    "space_of": space_of,
}


def answer():
    path = os.path.join(folder, f"ask{names['at'][0]}.py")
    if not os.path.exists(path):
        return 0.02
    try:
        with open(path) as f:
            kind, code = f.read().split("\\n", 1)
        window = bpy.context.window_manager.windows[0]
        area = next((a for a in window.screen.areas if a.type == "VIEW_3D"), None)
        with bpy.context.temp_override(window=window, area=area):
            if kind == "eval":
                out = {"value": eval(code, names)}
            else:
                exec(code, names)
                out = {"value": None}
    except BaseException:
        out = {"error": traceback.format_exc()}
    partial = os.path.join(folder, "answer.part")
    with open(partial, "w") as f:
        json.dump(out, f, default=str)
    os.replace(partial, os.path.join(folder, f"answer{names['at'][0]}.json"))
    names["at"][0] += 1
    return 0.02


keymap = bpy.context.window_manager.keyconfigs.addon.keymaps.new(name="Window", space_type="EMPTY")
for operator, key in buttons.items():
    keymap.keymap_items.new("arto." + operator, key, "PRESS")
bpy.app.timers.register(answer, first_interval=0.5, persistent=True)
"""


class Window:
    """A Blender with its window."""

    def __init__(self, program: Program, folder: Path, blend: Path | None, display: str) -> None:
        self.folder = folder / f"window{time.monotonic_ns()}"
        self.folder.mkdir()
        self.display = display
        self.asked = 0
        self.log = self.folder / "log.txt"
        (self.folder / "driver.py").write_text(DRIVER)
        line = [*program.command, "-p", "0", "0", "1600", "900"]
        line += [str(blend)] if blend else []
        line += ["--python-expr", "import bpy; bpy.context.preferences.view.show_splash = False"]
        line += ["--python", str(self.folder / "driver.py"), "--"]
        line += [str(self.folder), json.dumps(BUTTONS)]
        environment = {**program.environment, "DISPLAY": display}
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                line, cwd=ROOT, env=environment, stdout=log, stderr=subprocess.STDOUT
            )
        self.do("pass", 120)
        self.point(700, 400)

    def _ask(self, kind: str, code: str, seconds: float) -> Any:
        path = self.folder / f"ask{self.asked}.py"
        partial = path.with_suffix(".part")
        partial.write_text(f"{kind}\n{code}")
        partial.replace(path)
        answer = self.folder / f"answer{self.asked}.json"
        self.asked += 1
        until = time.monotonic() + seconds
        while not answer.exists():
            assert self.process.poll() is None, f"Blender ended\n{self.log.read_text()[-3000:]}"
            assert time.monotonic() < until, f"no answer to {code}\n{self.log.read_text()[-3000:]}"
            time.sleep(0.02)
        out = json.loads(answer.read_text())
        assert "error" not in out, out["error"]
        return out["value"]

    def do(self, code: str, seconds: float = 60) -> None:
        """Run Python in the window."""
        self._ask("exec", code, seconds)

    def get(self, expression: str, seconds: float = 60) -> Any:
        """The value of a Python expression in the window."""
        return self._ask("eval", expression, seconds)

    def wait(self, expression: str, seconds: float = 120) -> Any:
        """Wait until an expression is true; its value."""
        until = time.monotonic() + seconds
        while not (value := self.get(expression)):
            assert time.monotonic() < until, f"{expression}\n{self.log.read_text()[-3000:]}"
            time.sleep(0.05)
        return value

    def _gesture(self, *arguments: str) -> None:
        """Let a hand do something, and wait until the window has taken it."""
        environment = {**os.environ, "DISPLAY": self.display}
        subprocess.run(["xdotool", *arguments], env=environment, check=True, capture_output=True)
        # it answers before it looks at its events: the second time they were looked at
        for _ in range(2):
            self.get("None")

    def point(self, x: int, y: int) -> None:
        """Move the mouse."""
        self._gesture("mousemove", str(x), str(y))

    def click(self, x: int, y: int) -> None:
        self.point(x, y)
        self._gesture("click", "1")

    def hold(self) -> None:
        """Press the mouse's button, and keep it pressed."""
        self._gesture("mousedown", "1")

    def let_go(self) -> None:
        self._gesture("mouseup", "1")

    def key(self, *keys: str) -> None:
        """Press keys, `ctrl+z` for one."""
        for key in keys:
            self._gesture("key", key)

    def button(self, what: str, across: float = 0.45, start: int = 5) -> tuple[int, int]:
        """Find a button of the sidebar: the mouse goes down it until the window says that the
        button under the mouse is `what`: "bpy.ops.arto.shoot()", or "arto.rotation". start: how far
        below the sidebar's top it begins."""
        left, top, width, height = self.get("box('VIEW_3D', 'UI')")
        x = int(left + across * width)
        for y in range(top + start, top + height, 8):
            self.point(x, y)
            if self.get("under('VIEW_3D', 'UI')") == what:
                return x, y
        raise AssertionError(f"no button {what} in the sidebar\n{self.printed[-3000:]}")

    def seen(self) -> np.ndarray:
        """The picture that the image editor shows, as it is on the display, (h, w, 3), 0 to 255."""
        left, top, _, height = self.get("box('IMAGE_EDITOR', 'WINDOW')")
        corner = "region_of('IMAGE_EDITOR', 'WINDOW')[2].view2d.view_to_region({}, clip=False)"
        x0, y0 = self.get(corner.format("0, 0"))
        x1, y1 = self.get(corner.format("1, 1"))
        # less its outline
        size = x1 - x0 - 4, y1 - y0 - 4
        crop = f"{size[0]}x{size[1]}+{left + x0 + 2}+{top + height - y1 + 2}"
        environment = {**os.environ, "DISPLAY": self.display}
        line = ["import", "-window", "root", "-crop", crop, "-depth", "8", "rgb:-"]
        before, until = b"", time.monotonic() + 10
        while time.monotonic() < until:
            self.get("None")
            now = subprocess.run(line, env=environment, check=True, capture_output=True).stdout
            if now == before:
                break
            before = now
            time.sleep(0.15)  # until what is drawn has come to rest
        return np.frombuffer(before, np.uint8).reshape(size[1], size[0], 3).astype(float)

    def press(self, button: str) -> None:
        """Call one of ARTO's operators as its button does."""
        self.key(BUTTONS[button])

    def idle(self, seconds: float = 240) -> list[str]:
        """Wait until no job runs -> how the last one ended: level and text."""
        self.wait("session.current is None and session.outcome is not None", seconds)
        return self.get("[session.outcome.level, session.outcome.text]")

    def children(self) -> list[int]:
        """The processes of jobs of this window."""
        found = self.get("session.current.process.pid if session.current else 0")
        return [found] if found else []

    @property
    def seconds(self) -> float:
        """The seconds of a core that the window has taken so far."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def quit(self) -> str:
        """End it from inside, as Ctrl+Q without unsaved changes does -> what it printed."""
        path = self.folder / f"ask{self.asked}.py"
        path.write_text("exec\nbpy.app.timers.register(bpy.ops.wm.quit_blender)")
        self.process.wait(120)
        return self.printed

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)

    @property
    def printed(self) -> str:
        return self.log.read_text()


def ended(pid: int, seconds: float = 15) -> None:
    """Wait until a process is gone (or only its entry is left)."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return
        except FileNotFoundError:
            return
        time.sleep(0.05)
    raise AssertionError(f"process {pid} still runs")


@contextmanager
def windows(program: Program, folder: Path) -> Iterator[Any]:
    """A display; called, it opens a window on it with a .blend."""
    for tool in ("Xvfb", "xdotool"):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is not installed: the window needs it")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1600x900x24", "-noreset"],
        pass_fds=[write],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as numbers:  # to its end: it may be written in two parts
        display = ":" + numbers.readline().strip()
    opened: list[Window] = []

    def open_window(blend: Path | None = None) -> Window:
        opened.append(Window(program, folder, blend, display))
        return opened[-1]

    try:
        yield open_window
    finally:
        for window in opened:
            if window.alive:
                window.kill()
        server.terminate()
        server.wait(10)
