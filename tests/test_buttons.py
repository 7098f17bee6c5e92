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
from arto.core import exr
from program_tools import Program
from walk_tools import ARRANGE, TAB, WATCH, Walk
from window_tools import Window, ended, windows


@pytest.fixture(scope="module")
def walk(program: Program, made: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    """A window on a shot that was captured by its button."""
    folder = tmp_path_factory.mktemp("buttons")
    blend = Path(shutil.copy(made / "scene.blend", folder))
    with windows(program, folder) as opener:
        walk = Walk(opener, blend, None)
        walk.w.do(ARRANGE)
        walk.w.wait(TAB)
        walk.w.do(BEGIN)
        work(walk.w, "shoot")
        yield walk


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


def shown(w: Window, image: str) -> np.ndarray:
    """An image of the file, as it is on the display."""
    w.do(SHOW.format(image))
    return w.seen()


def press(w: Window, button: str) -> None:
    """Call an operator as its button does."""
    w.do(f"bpy.ops.arto.{button}('INVOKE_DEFAULT')")


def work(w: Window, button: str) -> str:
    """Press a button that starts a job, and wait for the end of the job -> its report."""
    press(w, button)
    level, text = w.idle()
    assert level == "INFO", text
    return text


def agree(w: Window, button: str) -> None:
    """Press a button that asks first, and say yes."""
    w.point(700, 400)
    press(w, button)
    w.key("Return")


def test_what_the_buttons_show(walk: Walk) -> None:
    w = walk.w
    assert w.seen().shape[0] > 300  # it fills the editor
    plate = shown(w, "ARTO Relit")
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
    press(w, "show_plate")
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

    plate = shown(w, "ARTO Relit")

    # the plate beside the last render, each as Blender shows it alone
    formats = "[getattr(scene.render.image_settings, p.identifier) for p in " \
        "scene.render.image_settings.bl_rna.properties if p.type == 'ENUM']"  # fmt: skip
    before = w.get(formats)
    w.do("ended = []; bpy.app.handlers.render_complete.append(lambda *_: ended.append(1))")
    w.do("bpy.context.preferences.view.render_display_type = 'NONE'")
    w.point(700, 400)
    w.key("F12")
    w.wait("ended")
    render = shown(w, "Render Result")
    press(w, "compare")
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


def test_finish_grows_until_it_is_stopped(walk: Walk) -> None:
    """Each round is shown while the work goes on; the cross keeps it, and the button goes on."""
    w = walk.w
    w.do("scene.arto.compare, scene.arto.live_finish = 'OFF', False")
    work(w, "relight")
    plate = exr.read(walk.blend.with_name("scene_relit.exr"))[""]
    press(w, "finish")
    w.wait("space_of().image.name == 'ARTO Relit Finished'")
    first = w.get("session.current.seen")
    w.wait(f"session.current.seen != {first}")  # a second round was shown
    press(w, "cancel")
    level, text = w.idle()
    assert level == "INFO" and "plate, which has" in text, text
    finished = walk.blend.with_name("scene_relit_finished.exr")
    before = int(exr.header(finished)["arto.finish samples"])
    assert before >= 64
    # the same picture, with other noise
    assert np.abs(exr.read(finished)[""] - plate).mean() < 0.1 * plate.mean()
    w.do(f"scene.arto.finish_samples = {before + 32}")
    assert f"{before + 32} samples" in work(w, "finish")
    assert int(exr.header(finished)["arto.finish samples"]) == before + 32


TOLD = "told(scene).kind"
# What the panel says of the shot, once the scene was looked at.
STATE = """
told = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.ui.state")).told
light = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.ui.light_panel"))
shelf = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.world.shelf"))
scene.arto.live_finish, scene.arto.compare = True, "OFF"
"""


@pytest.mark.skipif("ARTO_LONG" not in os.environ, reason="ARTO_LONG: a minute of buttons more")
def test_what_the_buttons_do_with_a_shot(walk: Walk) -> None:
    w = walk.w
    w.do(STATE)
    plate = shown(w, "ARTO Relit")

    # Set Back: camera, frame and size
    w.do(
        "own = scene.camera; other = bpy.data.objects.new('Other', own.data.copy()); "
        "scene.collection.objects.link(other); scene.camera = other; scene.frame_set(7); "
        "scene.render.resolution_x = 80"
    )
    w.wait(f"{TOLD} == 'elsewhere'")
    press(w, "set_back")
    w.wait(f"{TOLD} == 'ready'")
    assert w.get("(scene.camera == own, scene.frame_current, scene.render.resolution_x)") == [
        True, 1, 64,
    ]  # fmt: skip
    w.do("bpy.data.objects.remove(other)")

    # the strip of HDRIs: a click on one of an asset library lights the scene
    library = walk.blend.parent / "library"
    library.mkdir()
    exr.write(library / "even.exr", {"": np.ones((32, 64, 3), np.float32)})
    w.do(
        "bpy.context.preferences.filepaths.asset_libraries.new(name='Ours', "
        f"directory={str(library)!r}); sky = scene.world.node_tree.nodes; "
        "[a.tag_redraw() for a in bpy.context.window_manager.windows[0].screen.areas]"
    )
    w.wait("not shelf.looking() and any('even' in i.path for i in shelf.items())")
    # of what was remembered before, the HDRI of the capture
    w.do("shelf._recent[:] = [i for i in shelf._recent if i.path.endswith('sunset.exr')]")
    assert w.get("len(shelf.items())") == 2
    w.do("[a.tag_redraw() for a in bpy.context.window_manager.windows[0].screen.areas]")
    even = f'bpy.ops.arto.use_hdri(filepath="{library / "even.exr"}", world="")'
    shown_now = "next(n.image for n in sky if n.type == 'TEX_ENVIRONMENT')"
    walk.press(even, f"{shown_now}.name == 'even.exr'", 0.37, 320)
    w.do(
        "bpy.ops.arto.use_hdri(filepath=next(i.path for i in shelf.items() "
        "if not i.path.endswith('even.exr')))"
    )
    assert w.get(f"{shown_now}.name") != "even.exr"

    # Groups: a layer of its own, and the picture as before
    for _ in range(2):
        press(w, "add_group")
    press(w, "remove_group")
    w.do("scene.arto.layers = 'GROUPS'; scene.arto.groups[0].radius = 1.0")
    work(w, "relight")
    mixer = "light.mixer_of(scene).inputs"
    assert "LG_group1" in w.get(f"[i.name for i in {mixer}]")
    assert np.abs(shown(w, "ARTO Relit") - plate).max() <= ROUNDED

    # Mix to Scene: a world that is the mix
    w.do(f"{mixer}['LG_group1'].default_value = 0.25; world = scene.world.name")
    press(w, "mix_to_scene")
    assert w.get("scene.world.name != world")
    w.do("scene.arto.layers = 'OFF'")

    # Frames: a capture and a plate of each, shown at the frame, in the mixed light as it is then
    w.do(
        "scene.frame_start = scene.frame_end = 2; bright = next(n for n in "
        "scene.world.node_tree.nodes if n.type == 'BACKGROUND').inputs['Strength']; "
        "bright.keyframe_insert('default_value', frame=1); bright.default_value = 0.25; "
        "bright.keyframe_insert('default_value', frame=2)"
    )
    work(w, "capture_frames")
    work(w, "relight_frames")
    w.do("scene.frame_set(2)")
    w.wait(f"{TOLD} == 'ready'")
    assert (plate - shown(w, "ARTO Relit Frames")).mean() > 30
    w.do("scene.frame_set(1); scene.world = bpy.data.worlds[world]")

    # Delete: what relighting reads stays
    w.do("folder = paths.place(scene).folder")
    assert w.get("(folder / 'capture').is_dir()")
    agree(w, "delete_capture")
    w.wait("not (folder / 'capture').is_dir()")
    w.wait(f"{TOLD} == 'ready'")

    # Discard: what a cross has left
    w.do("scene.frame_set(3); scene.arto.samples = 1 << 14")
    press(w, "shoot")
    w.wait("list(paths.place(scene).folder.glob('unfinished-*'))")
    press(w, "cancel")
    assert w.idle()[0] == "WARNING"
    assert w.get("told(scene).stopped")
    agree(w, "discard_unfinished")
    w.wait("not told(scene).stopped")
    assert not w.get("list(paths.place(scene).folder.glob('unfinished-*'))")
    w.do("scene.frame_set(1); scene.arto.samples = 16")

    # Use It Here: a copy of the file
    copy = walk.blend.with_name("copy.blend")
    w.do(f"bpy.ops.wm.save_as_mainfile(filepath={str(copy)!r})")
    w.wait(f"{TOLD} == 'other'")
    press(w, "adopt")
    w.wait(f"{TOLD} == 'ready'")
    assert "Traceback" not in w.printed


SUN = """
import numpy
live = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.live.live"))
sky = next(n for n in scene.world.node_tree.nodes if n.type == "TEX_ENVIRONMENT")
before = sky.image, scene.world.arto.rotation, scene.cycles.samples
sunny = numpy.full((64, 128, 4), 0.05, numpy.float32)
sunny[46:48, 30:32, :3], sunny[..., 3] = 300.0, 1.0
sky.image = bpy.data.images.new("Sunny", 128, 64, float_buffer=True)
sky.image.pixels.foreach_set(sunny.ravel())
sky.image.update()
sky.image.pack()
scene.arto.lamps, scene.arto.live_finish, scene.arto.compare = True, False, "OFF"
scene.cycles.samples = 16
bpy.context.window_manager.arto.live = True

def keep(path):
    image = bpy.data.images["ARTO Live"]
    pixels = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(pixels)
    numpy.save(path, pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3])

def render(path):
    output = scene.render.image_settings
    were = output.file_format, output.color_depth, scene.render.filepath
    output.file_format, output.color_depth, scene.render.filepath = "OPEN_EXR", "32", path
    bpy.ops.render.render(write_still=True, scene=scene.name)
    output.file_format, output.color_depth, scene.render.filepath = were
"""
SUN_AWAY = """
bpy.context.window_manager.arto.live = False
sky.image, scene.world.arto.rotation, scene.cycles.samples = before
scene.arto.lamps = False
bpy.data.images.remove(bpy.data.images["Sunny"])
"""


def test_a_sun_that_is_turned_live_moves_its_shadow(walk: Walk) -> None:
    """The picture at rest is what Cycles renders of that state, and one Blender makes them all."""
    w, folder = walk.w, walk.blend.parent
    w.do(SUN)
    shown, rendered, beside = [], [], []
    for i, turn in enumerate((0.3, 2.0)):
        w.do(f"scene.world.arto.rotation = {turn}")
        now = f"live.current._now and abs(live.current._now.turn - {turn}) < 1e-3"
        w.wait(f"{now} and live.current.settled and live.current.shows_suns", 240)
        there = "live.current.asking.suns.picture.turn == live.current._now.turn"
        w.wait(f"{there} and live.current.settled and live.current.shows_suns", 240)
        assert w.get("live.current.trouble") == ""
        beside.append(w.get("live.current.asking.resident.process.pid"))
        w.do(f"keep({str(folder / f'live{i}.npy')!r})")
        w.do(f"render({str(folder / f'cycles{i}.exr')!r})", 240)
        shown.append(np.load(folder / f"live{i}.npy"))
        rendered.append(exr.read(folder / f"cycles{i}.exr")[""][..., :3])
    w.do(SUN_AWAY)
    assert beside[0] == beside[1]

    def off(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.abs(a - b).mean() / b.mean())

    for i in (0, 1):
        # noise of a few samples in one, and the shadow elsewhere in the other
        assert off(shown[i], rendered[i]) < 0.5 * off(shown[1 - i], rendered[i])
    w.do("bpy.ops.wm.read_homefile(use_empty=True)")
    ended(beside[0])  # the file that is closed takes the renderer with it
    w.do(f"bpy.ops.wm.open_mainfile(filepath={str(walk.blend)!r})")
    w.do("scene = bpy.context.scene")


OFF_AND_ON = """
import addon_utils
name = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".arto"))
addon_utils.{0}(name)
for area in bpy.context.window_manager.windows[0].screen.areas:
    area.tag_redraw()
"""


@pytest.mark.skipif("ARTO_IDLE" not in os.environ, reason="ARTO_IDLE: for so many seconds")
def test_a_window_left_alone_beside_one_without_arto(walk: Walk, capsys) -> None:
    """A captured shot in the panels takes at most 1% of a core more than the same window without
    ARTO. What the test's own driver takes is in both."""
    w, seconds = walk.w, float(os.environ["ARTO_IDLE"])
    shares = []
    for turn in ("enable", "disable", "enable", "disable"):
        w.do(OFF_AND_ON.format(turn))
        if turn == "enable":
            w.wait(TAB)
        time.sleep(5)
        before, begun = w.seconds, time.monotonic()
        time.sleep(seconds)
        shares.append((w.seconds - before) / (time.monotonic() - begun))
    w.do(OFF_AND_ON.format("enable"))
    more = (shares[0] + shares[2] - shares[1] - shares[3]) / 2
    with capsys.disabled():
        said = ", ".join(f"{share:.2%}" for share in shares)
        print(f"\nof a core, with ARTO, without, with, without: {said}; {more:+.2%} with it")
    assert more < 0.01
