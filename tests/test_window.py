"""In Blender's window, with real keys: no gesture of an artist's crashes, mixes or overwrites."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from arto.core import exr
from program_tools import Program
from window_tools import Window, ended, windows

Open = Callable[..., Window]


@pytest.fixture
def blend(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(made / "scene.blend", tmp_path))


@pytest.fixture
def open_window(program: Program, tmp_path: Path) -> Iterator[Open]:
    with windows(program, tmp_path) as opener:
        yield opener


CONTENTS = """{
    **{k: sorted(x.name for x in getattr(bpy.data, k)) for k in (
        "scenes", "objects", "meshes", "materials", "worlds", "collections", "cameras")},
    "display": bpy.context.preferences.view.render_display_type,
    "dirty preferences": bpy.context.preferences.is_dirty,
    "filepath": bpy.context.scene.render.filepath,
    "handlers": [len(getattr(bpy.app.handlers, h)) for h in (
        "render_complete", "render_cancel", "render_stats", "save_post")],
    "groups": len(bpy.context.view_layer.lightgroups),
    "still": bpy.context.window_manager.operator_properties_last("render.render").write_still,
}"""
SLOW = "bpy.context.scene.arto.samples = 1 << 14"
# Cycles says how far it is after the first thousands of samples only, its text comes at once
RENDERS = "session.current is not None and 'basis images' in session.current.state.text"


def captured_fitted(w: Window) -> None:
    w.press("capture")
    assert w.idle()[0] == "INFO"
    w.press("fit")
    assert w.idle()[0] == "INFO"


def test_undo_after_the_first_relight_and_the_plate_is_seen(open_window: Open, blend: Path) -> None:
    """Lines 1 and 5; undo takes the plate away, redo brings it back; F12 writes nothing."""
    w = open_window(blend)
    captured_fitted(w)
    w.press("relight")
    assert w.idle()[0] == "INFO"
    assert w.get("bpy.data.images['ARTO Relit'].use_view_as_render")
    shown = (
        "['ARTO Relit' in [a.spaces.active.image.name for x in bpy.context.window_manager.windows "
        "for a in x.screen.areas if a.type == 'IMAGE_EDITOR' and a.spaces.active.image]]"
    )
    assert w.get(shown) == [True]
    # the render window's place may be a window of its own: back to the first
    w.do(
        "[bpy.ops.wm.window_close() for x in bpy.context.window_manager.windows[1:] "
        "for o in [bpy.context.temp_override(window=x)] if o.__enter__() is None]"
    )
    w.point(700, 400)
    w.do("bpy.ops.ed.undo()")
    assert w.get("'ARTO Relit' not in bpy.data.images")
    w.do("bpy.ops.ed.redo()")
    assert w.get("list(bpy.data.images['ARTO Relit'].size)") == [64, 48]
    for _ in range(4):
        w.key("ctrl+z")
    w.key("ctrl+shift+z")
    w.point(701, 401)
    assert w.get("bpy.context.scene.name") == "Scene"
    w.do(f"bpy.context.scene.render.filepath = {str(blend.parent / 'f12.png')!r}")
    w.do("bpy.context.scene.cycles.samples = 1")
    w.do("ended = []; bpy.app.handlers.render_complete.append(lambda *_: ended.append(1))")
    w.key("F12")
    w.wait("ended")
    assert w.alive and not (blend.parent / "f12.png").exists()


def test_every_button_waits(open_window: Open, blend: Path) -> None:
    """Line 2: pressed again, or another one, while a capture runs: one job, nothing else."""
    w = open_window(blend)
    before = w.get(CONTENTS)
    w.do(SLOW)
    w.press("capture")
    w.wait("session.current is not None")
    pid = w.children()
    for button in ("capture", "fit", "relight", "build_hemicube", "capture"):
        w.press(button)
    assert w.children() == pid
    for operator in ("capture", "fit", "relight", "build_hemicube"):
        assert not w.get(f"bpy.ops.arto.{operator}.poll()")
    assert "ARTO is capturing 'Scene'" in w.get("session.busy()")
    w.wait(RENDERS)
    w.key("Escape")  # in any editor ESC is pressed for other reasons: it ends nothing of hours
    assert not w.get("session.current.told")
    w.do("bpy.ops.arto.cancel()")
    assert w.idle()[0] == "WARNING"
    assert w.get(CONTENTS) == before
    assert not list((blend.parent / "arto").rglob("job-*"))
    assert not list((blend.parent / "arto").rglob("*.part"))


GESTURES = {
    "undo": ["bpy.ops.ed.undo_push(message='a')", "bpy.ops.ed.undo()", "bpy.ops.ed.undo()"],
    "new file": ["bpy.ops.wm.read_homefile(use_empty=True)"],
    "another file": ["bpy.ops.wm.open_mainfile(filepath={other!r})"],
    "save": ["bpy.ops.wm.save_mainfile()"],
    "delete and repaint": [
        "bpy.data.objects.remove(bpy.data.objects['monkey'])",
        "bpy.data.objects['ball'].location.x += 1",
        "bpy.data.materials['plinth' if 'plinth' in bpy.data.materials else 'backdrop']"
        ".node_tree.nodes['Principled BSDF'].inputs['Base Color'].default_value = (1, 0, 0, 1)",
    ],
}


def basis(folder: Path) -> dict[str, np.ndarray]:
    """All that a capture set's files hold."""
    (head,) = folder.rglob("capture/capture.json")
    found = {}
    for path in sorted(head.parent.glob("*.exr")):
        found |= {f"{path.name} {name}": pixels for name, pixels in exr.read(path).items()}
    return found


# Four tiles, each of a second for every hundred samples or so.
IN_TILES = """
import bpy, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[-2])
scene = bpy.context.scene
scene.arto.samples = int(sys.argv[-1])
scene.render.resolution_x, scene.render.resolution_y = 100, 76
scene.arto.memory, scene.arto.patches, scene.arto.adaptive = 16, 4, False
scene.arto.keep = "always"
bpy.ops.wm.save_mainfile()
"""


def in_tiles(program: Program, blend: Path, samples: int) -> None:
    program.script(IN_TILES, blend, str(samples))


def test_what_an_artist_does_meanwhile_does_not_reach_the_capture(
    open_window: Open, blend: Path, program: Program
) -> None:
    """Lines 3, 6, 7 and 8: tiles captured while the scene is edited, saved and left are those of
    the snapshot, bit for bit."""
    in_tiles(program, blend, 128)
    peace = blend.parent / "peace"
    peace.mkdir()
    other = Path(shutil.copy(blend, peace / "scene.blend"))
    done = program.run("-b", other, "--command", "arto", "capture")
    assert done.returncode == 0, done.stderr
    expected = basis(peace)
    assert len({name.split()[0] for name in expected}) >= 4  # tiles
    w = open_window(blend)
    w.press("capture")
    w.wait("session.current is not None")
    # saved meanwhile, the file has no more in it than before
    for name in ("delete and repaint", "undo", "save", "another file", "new file"):
        for code in GESTURES[name]:
            w.do(code.format(other=str(other)))
        assert w.alive
    assert w.children(), "it was over before the gestures were"
    assert w.idle()[0] == "INFO"
    found = basis(blend.parent / "arto")
    assert found.keys() == expected.keys()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)
    w.do(f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})")
    assert w.get("len([o for o in bpy.data.objects if 'ARTO' in o.name])") == 0


def test_quitting_ends_the_job_and_keeps_the_tiles(
    open_window: Open, blend: Path, program: Program
) -> None:
    """Line 4: preferences as they were, no traceback, no half file; then it goes on."""
    in_tiles(program, blend, 256)
    w = open_window(blend)
    w.press("capture")
    w.wait("session.current is not None")
    # not those of the draft, which is made anew
    found = (blend.parent / "arto").rglob
    tile = lambda: [p for p in found("tile_*.exr") if "draft" not in p.parts]  # noqa: E731
    until = time.monotonic() + 240
    while not tile() and time.monotonic() < until:
        time.sleep(0.05)
    (pid,) = w.children()
    kept = {p.name: p.stat().st_mtime_ns for p in tile()}
    assert kept
    printed = w.quit()
    assert "Traceback" not in printed
    ended(pid)
    assert not list((blend.parent / "arto").rglob("job-*"))
    w = open_window(blend)
    assert w.get("bpy.context.preferences.view.render_display_type") == "WINDOW"
    w.wait("'unfinished' in (status.capture_line(bpy.context.scene) or [''])[0]")
    w.press("capture")
    assert w.idle()[0] == "INFO"
    now = {p.name: p.stat().st_mtime_ns for p in tile()}
    assert kept.items() <= now.items() and len(now) > len(kept)


def test_a_tick_turns_amber_and_back(open_window: Open, blend: Path) -> None:
    """Line 8: material, object, lamp; undone with real keys it is green again."""
    w = open_window(blend)
    captured_fitted(w)
    line = "status.capture_line(bpy.context.scene)"
    green = w.wait(f"{line} and {line}[1] and {line}")
    changes = {
        "bpy.data.objects['ball'].location.x += 1": "Object 'ball' changed since",
        "bpy.data.materials['backdrop'].node_tree.nodes['Principled BSDF']"
        ".inputs['Roughness'].default_value = 0.9": "Material 'backdrop' changed since",
        "m = bpy.data.meshes['monkey']; m.vertices[0].co.z += 1; m.update()": "Mesh 'monkey'",
    }
    for code, said in changes.items():
        w.do("bpy.ops.ed.undo_push(message='before')")
        w.do(f"{code}; bpy.ops.ed.undo_push(message='change')")
        w.wait(f"{line}[0].startswith({said!r})")
        w.key("ctrl+z")
        w.wait(f"{line}[1]")
        assert w.get(line) == green


def test_edits_go_into_the_snapshot(open_window: Open, blend: Path) -> None:
    """What is in memory is captured: unsaved edits and painted pixels; nothing is saved for it."""
    w = open_window(blend)
    saved = blend.read_bytes()
    w.do(
        "import numpy as np\n"
        "image = bpy.data.images.new('Painted', 4, 4)\n"
        "tree = bpy.data.materials['backdrop'].node_tree\n"
        "texture = tree.nodes.new('ShaderNodeTexImage')\n"
        "texture.image = image\n"
        "tree.links.new(texture.outputs[0], tree.nodes['Principled BSDF'].inputs['Base Color'])\n"
        "image.pixels.foreach_set(np.tile([1, 0, 0, 1], 16).astype(np.float32))\n"
        "image.update()"
    )
    w.do("bpy.context.scene.arto.keep = 'always'")
    w.press("capture")
    assert w.idle()[0] == "INFO"
    parts = basis(blend.parent / "arto")
    albedo = next(v for n, v in parts.items() if n.endswith("Albedo"))
    red = (albedo[..., 0] > 0.9) & (albedo[..., 1] < 0.1)
    assert red.mean() > 0.3  # the backdrop
    assert blend.read_bytes() == saved
    w.wait("(status.capture_line(bpy.context.scene) or [0, 0])[1]")


def test_two_windows_on_one_shot(open_window: Open, blend: Path) -> None:
    """Line 13: the second is refused with a sentence, the first goes on."""
    one, two = open_window(blend), open_window(blend)
    one.do(SLOW)
    # without a window manager the keys are the last one's
    one.do("bpy.ops.arto.capture('INVOKE_DEFAULT')")
    one.wait(RENDERS)
    pid = one.children()
    two.press("capture")
    two.do("try: bpy.ops.arto.capture()\nexcept RuntimeError as e: said = str(e)")
    assert "is in use" in two.get("said")
    assert one.children() == pid
    one.do("session.cancel()")
    assert one.idle()[0] == "WARNING"


def test_killed_at_any_moment(open_window: Open, blend: Path, program: Program) -> None:
    """Job or window, with kill -9: the next press goes on, no tile is rendered twice."""
    in_tiles(program, blend, 400)
    rng = np.random.default_rng(5)
    seen: dict[str, int] = {}

    def look() -> None:
        for path in (blend.parent / "arto").rglob("tile_*.exr"):
            at = path.stat().st_mtime_ns
            assert seen.setdefault(path.name, at) == at, f"{path.name} was rendered twice"

    w = open_window(blend)
    for turn in range(int(os.environ.get("ARTO_KILLS", "4"))):
        w.press("capture")
        w.wait("session.current is not None or session.outcome is not None")
        time.sleep(float(rng.uniform(0.2, 3)))
        look()
        pids = w.children()
        if turn % 2:
            w.kill()
            for pid in pids:
                ended(pid)
            w = open_window(blend)
        else:
            for pid in pids:
                subprocess.run(["kill", "-9", str(pid)], check=False)
            w.idle()
        look()
    w.press("capture")
    assert w.idle()[0] == "INFO"
    look()
    assert not list((blend.parent / "arto").rglob("*.part"))
    (head,) = (blend.parent / "arto").rglob("capture/capture.json")
    assert all(t["done"] for t in json.loads(head.read_text())["tiles"])


def test_starting_costs_the_window_little(open_window: Open, blend: Path) -> None:
    """Under a second of work for a small scene (what else the machine does is not counted)."""
    w = open_window(blend)
    w.do(
        "import time; t = time.thread_time(); bpy.ops.arto.capture('INVOKE_DEFAULT'); "
        "took = time.thread_time() - t"
    )
    assert w.get("took") < 1
    assert w.idle()[0] == "INFO"


def test_a_layer_that_is_not_for_rendering_is_captured(open_window: Open, blend: Path) -> None:
    """Line 14."""
    w = open_window(blend)
    w.do("bpy.context.view_layer.use = False")
    w.press("capture")
    level, text = w.idle()
    assert level == "INFO", text
