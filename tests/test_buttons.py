"""Every button of every panel, pressed in the real window; and what is on the display then."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from program_tools import Program
from walk_tools import ARRANGE, TAB, WATCH, Walk
from window_tools import ended, windows


@pytest.fixture
def walk(program: Program, made: Path, tmp_path: Path) -> Iterator[Walk]:
    blend = Path(shutil.copy(made / "scene.blend", tmp_path))
    with windows(program, tmp_path) as opener:
        yield Walk(opener, blend, None)


BEGIN = """
scene = bpy.context.scene
scene.arto.samples, scene.arto.adaptive, scene.arto.lamps = 16, False, False
scene.cycles.samples = 4
scene.view_settings.view_transform, scene.view_settings.exposure = "AgX", 0.7
bpy.ops.wm.save_mainfile()
"""
PAN = """
window, area, region = region_of('IMAGE_EDITOR', 'WINDOW')
with bpy.context.temp_override(window=window, area=area, region=region):
    bpy.ops.image.view_zoom_ratio(ratio=2.0)
    bpy.ops.image.view_pan(offset=(9.0, 5.0))
"""
# Puts an image into the image editor, as large as fits.
SHOW = """
space = space_of()
space.image = bpy.data.images[{0!r}]
window, area, region = region_of('IMAGE_EDITOR', 'WINDOW')
with bpy.context.temp_override(window=window, area=area, region=region):
    bpy.ops.image.view_all(fit_view=True)
"""
# What two pictures on the display may differ by, of 255: what drawing rounds.
ROUNDED = 2.5


def test_what_the_buttons_show(walk: Walk) -> None:
    w = walk.w
    w.do(ARRANGE)
    w.wait(TAB)
    w.do(BEGIN)

    def shown(image: str) -> np.ndarray:
        w.do(SHOW.format(image))
        return w.seen()

    def press(button: str) -> None:
        """Call an operator as its button does."""
        w.do(f"bpy.ops.arto.{button}('INVOKE_DEFAULT')")

    def work(button: str) -> str:
        """Press a button that starts a job, and wait for the end of the job -> its report."""
        press(button)
        level, text = w.idle()
        assert level == "INFO", text
        return text

    work("shoot")
    assert w.seen().shape[0] > 300  # it fills the editor
    plate = shown("ARTO Relit")
    assert plate.std() > 10  # it is a picture

    # over a finished plate Live shows the plate, which says so
    press_live = "bpy.context.window_manager.arto.live = {}"
    w.do(press_live.format(True))
    w.wait("live.current.settled")
    assert w.get("live.current.finished and 'plate' in live.current.line")
    assert "ARTO Live" not in w.get("sorted(i.name for i in bpy.data.images)")
    assert np.array_equal(w.seen(), plate)

    # where nothing is finished, the live picture of a light without suns is the plate: on the
    # display too, as large, and as far to the side
    w.do(PAN)
    near = w.seen()
    w.do("scene.arto.live_finish = False")
    w.wait("live.current.settled and space_of().image.name == 'ARTO Live'")
    assert np.abs(w.seen() - near).max() <= ROUNDED

    # a guest finishes what rests: nothing moves, and whatever is pressed comes first
    x, y = w.button("arto.rotation", 0.3, 300)
    slider = "under('VIEW_3D', 'UI') == 'arto.rotation'"
    rows = [y + up for up in (-8, 8)]
    edges = [w.point(x, row) or w.get(slider) for row in rows]
    w.do("scene.world.arto.rotation = 0.5; scene.arto.live_finish = True")
    w.wait("session.current is not None")
    pid = w.get("session.current.process.pid")
    os.kill(pid, signal.SIGSTOP)  # so small a picture may be finished before all is looked at
    assert w.get("session.current.guest and session.busy() == ''")
    assert [w.point(x, row) or w.get(slider) for row in rows] == edges
    press("show_plate")
    assert w.get("session.current is None")
    os.kill(pid, signal.SIGCONT)
    ended(pid)
    w.wait("session.current is not None")  # it comes again
    w.do("scene.world.arto.rotation = 0.6")  # and goes where the light is another
    w.wait("session.current is None")
    w.wait("live.current.finished")
    assert w.get("session.outcome.verb") == "shoot"  # of a guest nothing is told
    assert w.get("space_of().image.name") == "ARTO Relit"
    assert [w.point(x, row) or w.get(slider) for row in rows] == edges
    w.do(press_live.format(False))

    plate = shown("ARTO Relit")

    # the plate beside the last render, each as Blender shows it alone
    formats = "[getattr(scene.render.image_settings, p.identifier) for p in " \
        "scene.render.image_settings.bl_rna.properties if p.type == 'ENUM']"  # fmt: skip
    before = w.get(formats)
    w.do("ended = []; bpy.app.handlers.render_complete.append(lambda *_: ended.append(1))")
    w.do("bpy.context.preferences.view.render_display_type = 'NONE'")
    w.point(700, 400)
    w.key("F12")
    w.wait("ended")
    render = shown("Render Result")
    press("compare")
    assert w.get("space_of().image.name") == "ARTO Compare"
    assert w.get(formats) == before
    side = w.seen()
    half = side.shape[1] // 2 - 2
    for name, alone in (("OFF", plate), ("RENDER", render)):
        w.do(f"scene.arto.compare = {name!r}")
        assert np.abs(w.seen() - alone).max() <= ROUNDED, name
    assert np.abs(plate - render).max() > 20  # the two can be told apart
    quarter = plate.shape[1] // 4
    assert np.abs(side[:, :half] - plate[:, quarter : quarter + half]).mean() < 12

    # left alone, nothing of ours is called or drawn
    w.do(WATCH)
    w.do("[a.tag_redraw() for a in bpy.context.window_manager.windows[0].screen.areas]")
    w.wait("counts.get('ShotPanel')")
    time.sleep(2)
    w.do("counts.clear()")
    before, begun = w.seconds, time.monotonic()
    time.sleep(10)
    assert w.get("counts") == {}
    # of a core; Blender itself takes up to 2%, and the test's own questions some
    assert (w.seconds - before) / (time.monotonic() - begun) < 0.1
