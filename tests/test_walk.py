"""An artist's hour in the window, with real keys and a real mouse: from an old file to a plate in
comp. A picture of each step goes into the folder that ARTO_WALK names (`python -m tools.walk`)."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from arto.core import exr
from program_tools import ROOT, Program, said
from walk_tools import ARRANGE, TAB, WATCH, Walk
from window_tools import windows

OLD = Path(os.environ.get("ARTO_SCENES") or ROOT.parent / "shared" / "scenes")
SIZE = (240, 135)


@pytest.fixture
def walk(program: Program, tmp_path: Path) -> Iterator[Walk]:
    source = OLD / "TorusLightsCams_250_compressed.blend"
    if not source.is_file():
        pytest.skip(f"{source} is not there: set ARTO_SCENES to the folder of old files")
    blend = Path(shutil.copy(source, tmp_path / "old.blend"))
    folder = Path(os.environ["ARTO_WALK"]) if os.environ.get("ARTO_WALK") else None
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    with windows(program, tmp_path) as opener:
        yield Walk(opener, blend, folder)


# Buttons of the sidebar.
CAPTURE, ADD_LOOK = "bpy.ops.arto.shoot()", "bpy.ops.arto.add_look()"
ROTATION, LIVE = "arto.rotation", "arto.live"
# On the torus, from the left and the bottom of the picture.
TORUS = (0.47, 0.39)
BEGIN = f"""
import pathlib
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = {SIZE[0]}, {SIZE[1]}
scene.render.resolution_percentage = 100
scene.cycles.samples = 32
sky = pathlib.Path(bpy.utils.system_resource("DATAFILES")) / "studiolights/world/sunset.exr"
bpy.ops.arto.open_hdri(filepath=str(sky))
for lamp in bpy.data.lights:
    lamp.energy *= 0.02  # those of 2010 outshine any sky
scene.arto.memory = 250
bpy.ops.wm.save_mainfile()
"""
MODULE = "next(m for n, m in __import__('sys').modules.items() if n.endswith('.arto_addon.{}'))"
TOGGLE = """
import addon_utils
name = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".arto"))
assert not addon_utils.disable(name)
assert not hasattr(bpy.types.Scene, "arto") and not hasattr(bpy.types.World, "arto")
ours = {"ARTO Live", "ARTO Inside", "ARTO Light From", "ARTO Compare"}
left = ours & {i.name for i in bpy.data.images}
assert not left, left
assert addon_utils.enable(name) is not None
"""
NAMES = "sorted(i.name for i in bpy.data.images)"


def test_an_hour_of_an_artist(walk: Walk, tmp_path: Path, program: Program) -> None:
    w = walk.w
    w.do(ARRANGE)
    w.wait(TAB)
    w.do(BEGIN)
    w.do(WATCH)
    state = MODULE.format("ui.state")
    assert w.get(f"{state}.told(bpy.context.scene).lines[0]") == "No capture yet"
    walk.shot("an_old_file")

    # capture in one click; the cross; what is done stays, and one click goes on
    walk.press(CAPTURE, "session.current is not None")
    w.wait("list(paths.place(bpy.context.scene).folder.glob('unfinished-*/tile_0001.exr*'))")
    walk.shot("capturing")
    w.do("bpy.ops.arto.cancel()")
    assert w.idle()[0] == "WARNING"
    told = f"{state}.told(bpy.context.scene)"
    assert w.get(f"{told}.kind") == "unfinished", w.get(f"{told}.lines")
    done = w.get(f"{told}.lines[0]")
    assert "tiles done" in done
    walk.shot("stopped")
    walk.press(CAPTURE, "session.current is not None")
    level, text = w.idle()
    assert level == "INFO", text
    # the plate is there without another click, and up to date
    assert w.get(f"{told}.kind") == "ready"
    shown = (
        "[a.spaces.active.image.name for a in bpy.context.window_manager.windows[0].screen.areas "
        "if a.type == 'IMAGE_EDITOR' and a.spaces.active.image]"
    )
    assert w.get(shown) == ["ARTO Relit"]
    result = MODULE.format("ui.result_panel")
    assert w.get(f"{result}.plate_line(bpy.context.scene)")[1]
    walk.shot("relit")

    # live: the plate while it is of this light; a hand on the slider, then it rests, then it is
    # finished
    walk.press(LIVE, "live.current is not None")
    w.wait("live.current.settled")
    assert w.get("live.current.finished") and w.get(shown) == ["ARTO Relit"]
    before = w.get("bpy.context.scene.world.arto.rotation")
    made = w.get("live.current.viewer.made")
    x, y = w.button(ROTATION, 0.3)
    w.point(x, y)
    w.hold()
    for step in range(36):
        w.point(x + 2 * step, y)
    walk.shot("turning_live")
    w.let_go()
    assert w.get("bpy.context.scene.world.arto.rotation") != before
    assert w.get("live.current.viewer.made") >= made + 2
    # it may have been finished already while the hand held still
    w.wait(f"live.current.finished and {result}.plate_line(bpy.context.scene)[1]")
    w.wait(f"{shown} == ['ARTO Relit']")
    walk.shot("finished")
    walk.press(LIVE, "live.current is None")
    assert "ARTO Live" not in w.get(NAMES)

    # two looks, one of them red
    walk.press(ADD_LOOK, "len(bpy.context.scene.arto.looks) == 1")
    w.do("bpy.ops.arto.add_look(name='Red')")
    w.do("bpy.context.scene.world.arto.tint = (1, 0.25, 0.15)")
    w.do("bpy.ops.arto.relight_looks('INVOKE_DEFAULT')")
    assert w.idle()[0] == "INFO"
    first, red = (
        next(iter(exr.read(tmp_path / f"old_Scene_{name}.exr").values()))[..., :3].mean((0, 1))
        for name in ("Look", "Red")
    )
    assert red[2] / red[0] < 0.5 * first[2] / first[0]
    walk.shot("looks")
    # their sheet is shown as it is on disk; their plates are not made again
    plates = [tmp_path / f"old_Scene_{name}.exr" for name in ("Look", "Red")]
    before = [plate.stat().st_mtime_ns for plate in plates]
    w.do("bpy.ops.arto.sheet('INVOKE_DEFAULT')")
    assert w.idle()[0] == "INFO"
    w.wait(f"{shown} == ['old_relit_sheet.png']")
    assert [plate.stat().st_mtime_ns for plate in plates] == before
    w.do("bpy.context.scene.arto.active_look = 0")

    # layers, mixed in the compositor
    w.do("bpy.context.scene.arto.layers = 'FACES'")
    w.do("bpy.ops.arto.relight('INVOKE_DEFAULT')")
    assert w.idle()[0] == "INFO"
    w.do(
        "area = next(a for a in bpy.context.window_manager.windows[0].screen.areas "
        "if a.type == 'VIEW_3D'); area.ui_type = 'CompositorNodeTree'"
    )
    w.wait("area.spaces.active.edit_tree is not None")  # it was drawn
    w.do(
        "mix = next(n for n in bpy.context.scene.compositing_node_group.nodes if "
        "getattr(n, 'node_tree', None) and n.node_tree.name.endswith(' Mix')); "
        "mix.inputs['LG_left'].default_value = 3.0; "
        "region = next(r for r in area.regions if r.type == 'WINDOW'); "
        "o = bpy.context.temp_override(window=bpy.context.window_manager.windows[0], "
        "area=area, region=region); o.__enter__(); bpy.ops.node.view_all(); o.__exit__()"
    )
    walk.shot("mixing")
    light = MODULE.format("ui.light_panel")
    gain = f"{light}.mixer_of(bpy.context.scene).inputs['LG_left'].default_value"
    assert w.get(gain) == 3.0
    w.do("area.ui_type = 'VIEW_3D'")
    w.wait(TAB)

    # a pixel, and a place of the HDRI
    w.do("bpy.ops.arto.show_plate()")
    w.do("bpy.ops.arto.look_inside('INVOKE_DEFAULT')")
    w.click(*walk.picture(*TORUS))
    w.wait("'Lit' in bpy.context.window_manager.arto.seen")
    assert w.get(shown) == ["ARTO Inside"]
    walk.shot("looking_inside")
    w.do("bpy.ops.arto.light_from('INVOKE_DEFAULT')")
    w.click(*walk.picture(1.5 / 4, 2.5 / 3))
    w.wait("'comes from there' in bpy.context.window_manager.arto.seen")
    walk.shot("light_from_the_top")

    # the truth, a few samples of it; and where the plate goes
    w.do("bpy.ops.arto.verify('INVOKE_DEFAULT')")
    assert w.idle()[0] == "INFO"
    assert w.get(shown) == ["ARTO Verify"]
    walk.shot("verified")
    w.do("bpy.context.scene.arto.use_in_compositor = 'RENDER'")
    w.do("bpy.ops.arto.save_composite('INVOKE_DEFAULT')")
    level, text = w.idle()
    assert level == "INFO", text
    assert (tmp_path / "old_Scene_Look_composite.png").is_file()

    # no call of ours has held up the window
    assert not w.get("slow")

    # off and on again, save, close, open: all is there
    w.do(TOGGLE)
    w.do("bpy.ops.wm.save_mainfile()")
    printed = w.quit()
    assert "Traceback" not in printed, printed
    again = walk.again()
    assert again.get(f"{told}.kind") == "ready"
    assert again.get("[l.name for l in bpy.context.scene.arto.looks]") == ["Look", "Red"]
    assert again.get("bpy.context.scene.arto.use_in_compositor") == "RENDER"
    assert "ARTO Live" not in again.get(NAMES)
    printed = again.quit()
    assert "Traceback" not in printed, printed

    # and the file opens without ARTO
    done = program.run("-b", "--factory-startup", tmp_path / "old.blend")
    assert done.returncode == 0 and "Traceback" not in done.stdout + done.stderr, said(done)
    assert not np.isnan(red).any()


DEMO = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
import bpy
from bench import scenes, worlds

scene = scenes.product_shot(width=160, height=120)
worlds.set_world_hdri(scene, "courtyard")
scene.cycles.samples, scene.cycles.use_adaptive_sampling = 128, False
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
"""


def test_the_first_picture(walk: Walk, tmp_path: Path, program: Program, capsys) -> None:
    """From a fresh install on the demo's shot: one click on Capture, and the plate is shown."""
    w, demo = walk.w, tmp_path / "demo.blend"
    program.script(DEMO, demo)
    w.do(f"bpy.ops.wm.open_mainfile(filepath={str(demo)!r}, load_ui=False)")
    w.do(ARRANGE)
    w.wait(TAB)
    begun = time.monotonic()
    walk.press(CAPTURE, "session.current is not None")
    level, text = w.idle()
    seconds = time.monotonic() - begun
    assert level == "INFO", text
    assert w.get("'ARTO Relit' in [space_of().image.name]")
    with capsys.disabled():
        print(f"\nfirst relit picture (160x120, 128 samples): {walk.clicks} click, {seconds:.1f} s")


EVERYWHERE = """
import sys
window = bpy.context.window_manager.windows[0]
kinds = {"VIEW_3D": None, "IMAGE_EDITOR": "IMAGE_EDITOR", "NODE_EDITOR": "CompositorNodeTree"}
areas = sorted((a for a in window.screen.areas if a.type in kinds), key=lambda a: a.x)
areas[1].ui_type = "CompositorNodeTree"
for area in areas:
    area.spaces.active.show_region_ui = True
"""
LANGUAGE = """
view = bpy.context.preferences.view
view.language = {0!r}
view.use_translate_interface = True
for area in bpy.context.window_manager.windows[0].screen.areas:
    area.tag_redraw()
"""


def test_panels_in_every_place_and_language(walk: Walk, tmp_path: Path, program: Program) -> None:
    """Drawn without an error beside a picture, in the compositor and the render properties; and in
    German and Japanese, of which pictures are taken."""
    w = walk.w
    w.do(ARRANGE)
    w.wait(TAB)
    w.do(BEGIN)
    w.do("bpy.context.scene.arto.quality = 'DRAFT'; bpy.context.scene.arto.memory = 0")
    w.do("bpy.ops.arto.shoot('INVOKE_DEFAULT')")
    level, text = w.idle()
    assert level == "INFO", text
    w.do("bpy.context.window_manager.arto.overlay = True")
    drawn = MODULE.format("ui.overlay")
    w.wait(f"{drawn}.map_of(bpy.context.scene) is not None")
    walk.number = 19
    walk.shot("patches_around_the_scene")
    w.do("bpy.context.window_manager.arto.overlay = False")
    assert not w.get(f"{drawn}._maps")
    for language in ("de_DE", "ja_JP"):
        w.do(LANGUAGE.format(language))
        found = w.get("bpy.app.translations.locale")
        if found != language:
            pytest.skip(f"this Blender speaks {found or 'English'} alone")
        assert w.get("bpy.app.translations.pgettext_iface('No capture yet')") != "No capture yet"
        walk.shot(language)
    w.do(LANGUAGE.format("en_US"))
    w.do(EVERYWHERE)
    w.wait("tab('IMAGE_EDITOR', 'NODE_EDITOR')")
    w.do("watch()")
    w.do("[a.tag_redraw() for a in bpy.context.window_manager.windows[0].screen.areas]")
    w.wait("drawn >= {'IMAGE_EDITOR', 'NODE_EDITOR', 'PROPERTIES'}")
    walk.shot("beside_picture_and_nodes")
    assert "Traceback" not in w.printed, w.printed
