"""What is captured of a shot is found again by the shot, and by no other."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import ahead
from arto.arto_addon.relight.verify import verify_file
from arto.arto_addon.shot import paths, scene_id, status
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import BusyError, CaptureSetError, ShotError
from arto.core.signed import parsed
from scene_tools import captured, small_scene


def save(folder: Path, name: str = "shot.blend") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    bpy.context.scene.arto.folder = "//arto/"
    bpy.context.scene.arto.samples = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / name))


def opened(path: Path) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def test_folder_is_named_after_the_shot(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path)
    assert captured(scene).folder == tmp_path / "arto/shot/Scene/Camera_0001/capture"
    scene.frame_set(12)
    assert captured(scene).folder == tmp_path / "arto/shot/Scene/Camera_0012/capture"
    # the first is as it was
    scene.frame_set(1)
    assert status.capture_line(scene)[1]


def test_renamed_scene_camera_and_file_and_a_moved_folder_find_what_is_theirs(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path / "a")
    folder = captured(scene).folder
    scene.camera.name = "Cam"
    assert paths.capture_folder(scene) == folder
    scene.name, scene.camera.name = "Renamed", "Camera"
    assert paths.capture_folder(scene) == folder
    bpy.ops.wm.save_mainfile()
    (tmp_path / "a" / "shot.blend").rename(tmp_path / "a" / "other.blend")
    scene = opened(tmp_path / "a" / "other.blend")
    assert paths.capture_folder(scene) == folder and status.capture_line(scene)[1]
    (tmp_path / "a").rename(tmp_path / "b")
    scene = opened(tmp_path / "b" / "other.blend")
    assert paths.capture_folder(scene) == tmp_path / "b" / folder.relative_to(tmp_path / "a")
    assert status.capture_line(scene)[1]


def test_a_copied_file_asks_before_it_uses_the_others(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path)
    first = captured(scene)
    work.run(fit.fit(scene))
    before = {p: p.read_bytes() for p in sorted(first.folder.iterdir())}
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot_v2.blend"))
    scene = bpy.context.scene
    assert status.capture_line(scene) == ("captured for the file 'shot.blend'", False)
    with pytest.raises(ShotError, match=r"captured for the file 'shot\.blend'"):
        work.run(fit.fit(scene))
    assert bpy.ops.arto.adopt() == {"FINISHED"}
    assert status.capture_line(scene)[1] and status.field_line(scene)[1]
    own = paths.capture_folder(scene)
    assert own == tmp_path / "arto/shot_v2/Scene/Camera_0001/capture"
    # what the copy captures leaves the other's alone
    scene.arto.samples += 1
    captured(scene)
    assert {p: p.read_bytes() for p in sorted(first.folder.iterdir())} == before


def test_a_copied_scene_is_another(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path)
    first = captured(scene)
    copy = scene.copy()
    assert scene_id.of(scene) and scene_id.of(copy) is None
    assert status.capture_line(copy) == ("captured for the scene 'Scene'", False)
    second = captured(copy)
    assert second.folder != first.folder
    assert scene_id.of(copy) not in (None, scene_id.of(scene))
    assert paths.capture_folder(scene) == first.folder
    # and their plates are, with the output that was copied and with none
    assert relit_file(scene) != relit_file(copy)
    scene.arto.output = copy.arto.output = ""
    assert relit_file(scene) != relit_file(copy)
    assert plate.name_of(scene) != plate.name_of(copy)


def test_two_files_of_one_folder_whose_scenes_have_one_name(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path, "one.blend")
    first = captured(scene).folder
    scene = small_scene(tmp_path)
    save(tmp_path, "two.blend")
    assert status.capture_line(scene) is None
    with pytest.raises(CaptureSetError, match="run Capture first"):
        work.run(fit.fit(scene))
    assert captured(scene).folder != first


def test_another_of_the_same_name_is_left_alone(tmp_path):
    """Two files that were never saved, one absolute folder: one name, and two shots."""
    scene = small_scene(tmp_path)
    first = captured(scene)
    scene = small_scene(tmp_path)
    assert status.capture_line(scene) is None
    assert captured(scene).folder != first.folder
    assert CaptureSet(first.folder).head.shot == first.head.shot


def test_another_view_layer_is_another_shot(tmp_path):
    scene = small_scene(tmp_path)
    first = captured(scene)
    scene.view_layers.new("Second")
    second = work.run(capture.capture(scene, "Second"))
    assert second != first.folder
    assert status.capture_line(scene, "ViewLayer")[1] and status.capture_line(scene, "Second")[1]


def test_an_id_outlives_an_undo(tmp_path):
    """An undo step from before the ID was given takes it away; the handler gives it back."""
    scene = small_scene(tmp_path)
    given = scene.arto.scene_id
    scene.arto.scene_id = ""
    scene_id._after_undo()
    assert scene.arto.scene_id == given


def test_looks_have_plates_of_their_own(tmp_path):
    scene = small_scene(tmp_path)
    save(tmp_path)
    scene.arto.output = ""
    assert relit_file(scene) == tmp_path / "shot_relit.exr"
    assert plate.name_of(scene) == "ARTO Relit"
    names = set()
    for look in ("Sunset", "Noon", "relit", "a/b", "a:b", ""):
        scene.arto.look = look
        names.add((relit_file(scene).name, plate.name_of(scene)))
    assert len({n for n, _ in names}) == len({n for _, n in names}) == 6
    scene.arto.look = "Sunset"
    assert relit_file(scene) == tmp_path / "shot_Scene_Sunset.exr"
    assert plate.name_of(scene) == "ARTO Scene Sunset"
    scene.arto.output = str(tmp_path / "plates" / "sh010.v003")
    assert relit_file(scene) == tmp_path / "plates" / "sh010.v003_Sunset.exr"


def test_a_second_scene_renames_no_plate(tmp_path):
    """Neither one that is new or copied, nor one that goes; and no two have one plate."""
    scene = small_scene(tmp_path)
    save(tmp_path)
    for output in ("", str(tmp_path / "plates" / "sh010")):
        scene.arto.output = output
        before = relit_file(scene), plate.name_of(scene)
        others = [scene.copy(), bpy.data.scenes.new("Other")]
        others[1].arto.output, others[1].arto.folder = output, scene.arto.folder
        assert (relit_file(scene), plate.name_of(scene)) == before
        found = {relit_file(s) for s in bpy.data.scenes}
        assert len(found) == len({plate.name_of(s) for s in bpy.data.scenes}) == 3
        scene_id.give(others[1])
        named = relit_file(others[1])
        bpy.data.scenes.remove(others[0])
        assert relit_file(others[1]) == named
        bpy.data.scenes.remove(others[1])
        assert (relit_file(scene), plate.name_of(scene)) == before


def test_pairs_that_read_alike_are_two(tmp_path):
    """Scene 'A B' in the look C, scene 'A' in the look B C."""
    one = small_scene(tmp_path)
    save(tmp_path)
    two = one.copy()
    one.name, two.name = "A B", "A"
    one.arto.output = two.arto.output = ""
    one.arto.look, two.arto.look = "C", "B C"
    assert plate.name_of(one) != plate.name_of(two)
    assert relit_file(one) != relit_file(two)


HOLD = """
import sys, time
from pathlib import Path
from arto.core.files import Lock
with Lock(Path(sys.argv[1]), "capturing"):
    print("held", flush=True)
    time.sleep(60)
"""


def test_two_blenders_on_one_shot(tmp_path):
    """The second is refused, and takes nothing of the first's away."""
    scene = small_scene(tmp_path)
    folder = captured(scene).folder.parent
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(BusyError, match=f"process {other.pid}"):
            captured(scene)
        with pytest.raises(BusyError, match=f"process {other.pid}"):
            work.run(fit.fit(scene))
    finally:
        other.kill()
        other.wait()
    captured(scene)


def test_a_crash_between_two_renames_loses_no_field(tmp_path):
    scene = small_scene(tmp_path)
    captured(scene)
    folder = work.run(fit.fit(scene))
    folder.rename(folder.with_name("field.old"))
    assert paths.field_folder(scene) == folder and folder.is_dir()
    assert status.field_line(scene)[1]


def test_what_the_version_before_left_is_read(tmp_path):
    """It kept a capture in a folder of the scene's name, and its description knew no shot."""
    scene = small_scene(tmp_path)
    save(tmp_path)
    there = captured(scene)
    old = tmp_path / "arto" / "Scene" / "capture"
    old.parent.mkdir()
    shutil.move(there.folder, old)
    shutil.rmtree(tmp_path / "arto" / "shot")
    head = parsed((old / "capture.json").read_text())
    shot = head["shot"]
    head["shot"] = {n: shot[n] for n in ("scene", "frame", "width", "height", "lens")}
    head["shot"]["camera"] = shot["camera_matrix"]
    del head["fingerprint"]
    (old / "capture.json").write_text(json.dumps(head))
    paths.forget()
    assert status.capture_line(scene) == ("6 patches, 1 samples", True)
    assert work.run(fit.fit(scene)).is_relative_to(tmp_path / "arto" / "shot")


def test_last_properties_of_f12_stay(tmp_path):
    """A capture renders with its own settings; the next F12 must not write to a file by them."""
    scene = small_scene(tmp_path)
    captured(scene)
    last = bpy.context.window_manager.operator_properties_last("render.render")
    assert not last.write_still and not last.scene


def test_braces_and_signs_in_names(tmp_path):
    scene = small_scene(tmp_path)
    scene.name, scene.camera.name = "a/{b}: #%", "..\\CON"
    save(tmp_path)
    folder = captured(scene).folder
    assert folder.parent.parent.parent == tmp_path / "arto" / "shot"
    assert os.path.commonpath([folder, tmp_path]) == str(tmp_path)
    assert status.capture_line(scene)[1]


@pytest.mark.parametrize("name", ["layers", "Catcher", "key_light", "0007", "verify"])
def test_no_look_is_written_over_what_stands_beside_a_plate(scene, tmp_path, name):
    """The layers of a plate are beside it as `_layers`: a look of that name was written over
    them."""
    for output in (str(tmp_path / "plate.exr"), ""):
        scene.arto.output = output
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
        scene = bpy.context.scene
        other = name.rpartition("_")[0]
        plates = [relit_file(scene, look) for look in ("", other, name, f"{name}~x")]
        kinds = (plate.layers_file, plate.share_file, plate.light_file, verify_file)
        beside = {kind(path).name.lower() for kind in kinds for path in plates}
        beside |= {ahead._named(path, None, 7).name for path in plates}
        assert not beside & {path.name.lower() for path in plates}
        assert len(set(plates)) == 3 + bool(other)


def test_hashes_in_the_output_are_the_frames_number(scene, tmp_path):
    """As in Blender's own output: padded, last in the name, also under a look."""
    scene.frame_set(47)
    for output, look, expected in (
        ("beauty.####.exr", "", "beauty.0047.exr"),
        ("beauty.####.exr", "key 2", "beauty_key 2.0047.exr"),
        ("beauty_##", "", "beauty_47.exr"),
        ("v###x#", "", "v###x47.exr"),
        ("######.png", "", "000047.exr"),
        ("plain.exr", "", "plain.exr"),
    ):
        scene.arto.output, scene.arto.look = str(tmp_path / output), look
        assert relit_file(scene) == tmp_path / expected
    # a folder is one
    scene.arto.output, scene.arto.look = f"{tmp_path}/plates/", ""
    assert relit_file(scene).parent == tmp_path / "plates"
