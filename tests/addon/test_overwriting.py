"""A relight writes over nothing that ARTO has not written, and over nothing that it reads."""

from __future__ import annotations

import os
import threading
import unicodedata

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.match.asked import asked, named_in
from arto.arto_addon.plate import composite, marks
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.plate.together import Together
from arto.arto_addon.relight import kit_out, many, relight
from arto.arto_addon.relight.inputs import Input, Inputs, inputs
from arto.arto_addon.relight.outputs import check_beside
from arto.arto_addon.ui.inventory import inventory
from arto.core import exr
from arto.core.errors import BusyError, SceneError, TargetError
from arto.core.file_names import same_file
from arto.core.places import in_turn


def picture(path, value=1.0):
    """An artist's EXR file -> its bytes."""
    exr.write(path, {"": np.full((8, 16, 3), value, np.float32)})
    return path.read_bytes()


@pytest.fixture
def there(shot, tmp_path):
    """The folder that pictures go to, and its settings are put back."""
    before = shot.arto.output
    shot.arto.output = str(tmp_path / "shot.exr")
    yield tmp_path
    shot.arto.output, shot.arto.overwrite, shot.arto.layers = before, False, "OFF"


def refused(shot, match, **asked):
    for overwrite in (False, True):  # nobody wants to lose what the picture is made of
        shot.arto.overwrite = overwrite
        steps = many.relight_many(shot, shot.view_layers[0].name, **asked)
        with pytest.raises(SceneError, match=match):
            work.run(steps)


def test_no_picture_goes_over_what_another_one_reads(shot, there):
    """A map of `--worlds`, and the file of a sequence that another frame shows."""
    before = picture(there / "a.exr"), picture(there / "shot_a.exr", 2)
    refused(shot, "environment map", worlds=[there / "a.exr", there / "shot_a.exr"])
    assert (before[0], before[1]) == tuple(
        (there / name).read_bytes() for name in ("a.exr", "shot_a.exr")
    )
    files = {there / f"foot_{n:04d}.exr": picture(there / f"foot_{n:04d}.exr") for n in range(5)}
    image = bpy.data.images.load(str(there / "foot_0000.exr"))
    image.source = "SEQUENCE"
    node = next(n for n in shot.world.node_tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment")
    theirs, node.image = node.image, image
    node.image_user.frame_duration, node.image_user.frame_offset = 4, -1
    shot.arto.output = str(there / "foot_####.exr")
    try:
        refused(shot, "the world's image", frames=range(1, 4))
        # the first picture's name is no file yet, but it would become one of the sequence
        assert inputs(shot).over(there / "foot_0009.exr")
    finally:
        node.image = theirs
        bpy.data.images.remove(image)
    assert files == {path: path.read_bytes() for path in files}


def test_a_texture_and_what_else_the_scene_reads_stays(shot, there):
    before = picture(there / "tex.exr")
    nodes = shot.objects["Floor"].active_material.node_tree.nodes
    node = nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(str(there / "tex.exr"))
    tiles = bpy.data.images.new("tiles", 4, 4)
    tiles.source, tiles.filepath = "TILED", str(there / "skin.<UDIM>.exr")
    font = there / "type.ttf"
    font.write_bytes(b"no font")
    volume = bpy.data.volumes.new("Smoke")
    volume.filepath = str(there / "smoke.vdb")
    (there / "smoke.vdb").write_bytes(b"no smoke")
    try:
        shot.arto.output = str(there / "tex.exr")
        refused(shot, "a texture of the scene")
        read = inputs(shot)
        assert read.over(there / "smoke.vdb") and read.over(there / "skin.1002.exr")
        assert not read.over(there / "other.exr")
    finally:
        nodes.remove(node)
        bpy.data.batch_remove([tiles, volume, bpy.data.images["tex.exr"]])
    assert (there / "tex.exr").read_bytes() == before


def test_files_without_a_mark_stay_unless_the_artist_wants_it(shot, there):
    layer = shot.view_layers[0].name
    shot.arto.layers = "FACES"
    plate = relit_file(shot)
    for name in ("shot.exr", "shot_layers.exr"):
        before = picture(there / name)
        with pytest.raises(SceneError, match=f"{name} is there, and ARTO has not written it"):
            work.run(relight.compute(shot, layer))
        assert (there / name).read_bytes() == before
        (there / name).unlink()
    theirs = picture(there / "shot_data.exr")  # no data is asked for
    work.run(relight.compute(shot, layer))
    assert (there / "shot_data.exr").read_bytes() == theirs
    work.run(relight.compute(shot, layer))  # over ARTO's own
    shown = bpy.data.images.load(str(plate))  # in a compositor; and the file is gone
    work.run(relight.compute(shot, layer))
    plate.unlink()
    work.run(relight.compute(shot, layer))
    bpy.data.images.remove(shown)
    picture(there / "shot_layers.exr")
    shot.arto.overwrite = True
    work.run(relight.compute(shot, layer))
    assert marks.is_of(there / "shot_layers.exr", plate)


def test_the_door_of_plates_refuses_what_came_meanwhile(tmp_path):
    plate, beside = tmp_path / "a.exr", tmp_path / "a_data.exr"
    before = picture(beside)
    with pytest.raises(SceneError), Together(plate, None) as together, together.file(beside):
        pass
    assert beside.read_bytes() == before and not plate.exists()
    # another plate of ARTO's, whose name is that of a companion
    exr.write(beside, {"": np.ones((2, 2, 4), np.float32)}, {marks.PLATE: beside.name})
    assert "another plate" in marks.in_the_way(beside, plate)
    assert not marks.in_the_way(beside, beside)
    (tmp_path / "empty.exr").touch()
    assert not marks.in_the_way(tmp_path / "empty.exr", plate)


def test_names_that_disks_take_for_one_are_one(tmp_path):
    name = "Café.exr"
    one = tmp_path / unicodedata.normalize("NFC", name)
    other = tmp_path / unicodedata.normalize("NFD", name.upper())
    sequence = Input("a sequence", tmp_path / "s\u00e9_01.exr", "s\u00e9_\\d+\\.exr")
    read = Inputs([Input("a map", one), sequence])
    assert same_file(one, other) and read.over(other) and read.over(tmp_path / "Se\u0301_12.EXR")
    picture(one)
    if not other.exists():  # this disk tells them apart, and both are there
        picture(other)
        assert not same_file(one, other) and not read.over(other)
    os.link(one, tmp_path / "linked.exr")
    assert Inputs([Input("a map", one)]).over(tmp_path / "linked.exr")


def test_files_of_a_plate_take_their_places_in_turn(tmp_path):
    """Of two relights of one plate the later one has all of its files, and only these."""
    plate, layers = tmp_path / "a.exr", tmp_path / "a_layers.exr"

    def written(together, *paths):
        for path in paths:
            with together.file(path) as partial:
                exr.write(partial, {"": np.ones((2, 2, 4), np.float32)}, {marks.PLATE: plate.name})

    with in_turn(tmp_path, 0.05):
        with pytest.raises(BusyError), in_turn(tmp_path, 0.05):
            pass
        together = Together(plate, None)
        together.__enter__()
        written(together, plate, layers)
        ended = threading.Thread(target=lambda: together.__exit__(None, None, None))
        ended.start()
        ended.join(0.1)
        assert ended.is_alive() and not plate.exists() and not layers.exists()
        other = Together(plate, None)
        other.__enter__()
        written(other, plate)
    ended.join()
    assert plate.exists() and layers.exists()
    other.__exit__(None, None, None)
    assert plate.exists() and not layers.exists()


def test_a_composite_of_somebody_else_stays_and_an_older_one_is_told(shot, there, monkeypatch):
    path = composite.composite_file(shot)
    path.write_bytes(b"painted over")
    monkeypatch.setattr(composite, "_renders", lambda _: "")
    monkeypatch.setattr(composite, "compositor", lambda _: object())
    monkeypatch.setattr(composite, "_composited", lambda _: np.ones((4, 4, 4), np.float32))
    layer = shot.view_layers[0].name
    with pytest.raises(SceneError, match="not what ARTO wrote"):
        work.run(composite.save_composite(shot, layer))
    assert path.read_bytes() == b"painted over" and not composite.said_of(shot)
    path.unlink()
    work.run(relight.compute(shot, layer))
    for _ in range(2):  # the second goes over the first
        work.run(composite.save_composite(shot, layer))
    states = {t.kind: t.state for t in inventory(shot, layer, None).frames[0].things}
    assert states["composite"] == "whole"
    shot.arto.own_lamps = 0.5
    try:
        work.run(relight.compute(shot, layer))
        states = {t.kind: t.state for t in inventory(shot, layer, None).frames[0].things}
        assert (states["plate"], states["composite"]) == ("whole", "outdated")
    finally:
        shot.arto.own_lamps = 1.0


def test_a_light_is_written_over_no_other_file(shot, there):
    """As an HDRI, as a kit, and as what a match has found."""
    before = picture(there / "sky.exr")
    with pytest.raises(SceneError, match="no HDRI that ARTO wrote"):
        kit_out.to_hdri(shot, there / "sky.exr")
    node = next(n for n in shot.world.node_tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment")
    theirs, node.image = node.image, bpy.data.images.load(str(there / "sky.exr"))
    try:
        with pytest.raises(SceneError, match="the world's image"):
            kit_out.to_hdri(shot, there / "sky.exr", overwrite=True)
    finally:
        node.image = theirs
    shot.arto.match_target, shot.arto.overwrite = str(there / "sky.exr"), True
    try:
        with pytest.raises(SceneError, match="is not written over"):
            check_beside(shot, there / "sky.exr", relit_file(shot), named_in(shot))
    finally:
        shot.arto.match_target = ""
    assert (there / "sky.exr").read_bytes() == before
    (there / "cut.jpg").write_bytes(b"\xff\xd8\xff half")
    shot.arto.match_target = str(there / "cut.jpg")
    try:
        with pytest.raises(TargetError, match="cut off"):
            asked(shot, (8, 16))
    finally:
        shot.arto.match_target = ""
