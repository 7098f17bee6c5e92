"""The fingerprint sees each file that a render reads, at its frame, and what a shader asks for."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from arto.arto_addon.shot import external, walk
from arto.arto_addon.shot.fingerprint import changes, fingerprint
from arto.core import exr
from scene_tools import small_scene

IES = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 100\n0 90\n0\n{} 50\n"


def found(scene: bpy.types.Scene, then: dict[str, str] | None = None) -> dict[str, str]:
    bpy.context.view_layer.update()
    walk._contents.clear()
    return fingerprint(scene, scene.view_layers[0].name, then, full=True)


def picture(path: Path, value: float) -> None:
    exr.write(path, {"": np.full((4, 4, 3), value, np.float32)})


def node(kind: str, **values: Any) -> bpy.types.Node:
    made = bpy.data.materials["Matt"].node_tree.nodes.new(kind)
    for name, value in values.items():
        setattr(made, name, value)
    return made


def textured(path: Path, source: str) -> bpy.types.Node:
    image = bpy.data.images.new("Texture", 4, 4)
    image.source, image.filepath = source, str(path)
    return node("ShaderNodeTexImage", image=image)


def of_tiles(scene, folder):
    for tile in (1001, 1002):
        picture(folder / f"skin.{tile}.exr", 1.0)
    made = textured(folder / "skin.<UDIM>.exr", "TILED")
    if len(made.image.tiles) < 2:
        made.image.tiles.new(1002)
    return folder / "skin.1002.exr"


def of_sequence(scene, folder):
    for number in (1, 2, 3):
        picture(folder / f"wave_{number:04d}.exr", 1.0)
    made = textured(folder / "wave_0001.exr", "SEQUENCE")
    made.image_user.frame_duration, made.image_user.frame_offset = 3, 1
    return folder / "wave_0002.exr"  # at frame 1


def of_lamp(scene, folder):
    (folder / "spot.ies").write_text(IES.format(100))
    node("ShaderNodeTexIES", mode="EXTERNAL", filepath=str(folder / "spot.ies"))
    return folder / "spot.ies"


def of_script(scene, folder):
    (folder / "look.osl").write_text("shader look() {}")
    node("ShaderNodeScript", mode="EXTERNAL", filepath=str(folder / "look.osl"))
    return folder / "look.osl"


def of_font(scene, folder):
    there = Path(bpy.utils.system_resource("DATAFILES", path="fonts"))
    kind = min(there.iterdir(), key=lambda path: path.stat().st_size)
    shutil.copy(kind, folder / "type.ttf")
    curve = bpy.data.curves.new("Words", "FONT")
    scene.collection.objects.link(bpy.data.objects.new("Words", curve))
    curve.font = bpy.data.fonts.load(str(folder / "type.ttf"))
    return folder / "type.ttf"


def of_mesh_cache(scene, folder):
    (folder / "moves.pc2").write_bytes(b"POINTCACHE2\0" + bytes(40))
    modifier = scene.objects["Matt"].modifiers.new("Cache", "MESH_CACHE")
    modifier.filepath = str(folder / "moves.pc2")
    return folder / "moves.pc2"


def of_volume(scene, folder):
    for number in (4, 5):
        (folder / f"smoke_{number:02d}.vdb").write_bytes(bytes([number]))
    volume = bpy.data.volumes.new("Smoke")
    volume.filepath, volume.is_sequence = str(folder / "smoke_04.vdb"), True
    volume.frame_duration, volume.frame_start, volume.frame_offset = 9, 1, 4
    scene.collection.objects.link(bpy.data.objects.new("Smoke", volume))
    return folder / "smoke_05.vdb"  # at frame 1


def of_ocean(scene, folder):
    (folder / "foam").mkdir()
    (folder / "foam" / "disp_0001.exr").write_bytes(b"one")
    modifier = scene.objects["Matt"].modifiers.new("Ocean", "OCEAN")
    modifier.filepath = str(folder / "foam")
    return folder / "foam" / "disp_0001.exr"


FILES = {f.__name__: f for f in (
    of_tiles, of_sequence, of_lamp, of_script, of_font, of_mesh_cache, of_volume, of_ocean,
)}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_a_file_with_other_contents_is_seen(tmp_path, name):
    scene = small_scene(tmp_path)
    read = FILES[name](scene, tmp_path)
    before = found(scene)
    assert changes(before, found(scene, before)) == []
    others = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file() and p != read}
    read.write_bytes(read.read_bytes() + b" ")
    assert changes(before, found(scene, before)), name
    # what is read at another frame is no change of this one
    read.write_bytes(read.read_bytes()[:-1])
    for path in others if name in ("of_sequence", "of_volume") else ():
        path.write_bytes(path.read_bytes() + b" ")
    assert changes(before, found(scene, before)) == []


def test_what_a_shader_asks_the_view_layer_for_is_seen(tmp_path):
    scene = small_scene(tmp_path)
    scene["tint"], scene["other"] = 0.5, 1.0
    node("ShaderNodeAttribute", attribute_type="VIEW_LAYER", attribute_name="tint")
    node("ShaderNodeAttribute", attribute_type="VIEW_LAYER", attribute_name="frame_start")
    before = found(scene)
    scene["other"] = 2.0
    assert changes(before, found(scene, before)) == []
    scene["tint"] = 0.6
    assert changes(before, found(scene, before)) == [
        "Attribute 'tint' of the view layer changed since"
    ]
    scene["tint"], scene.frame_start = 0.5, 7
    assert any("frame_start" in said for said in changes(before, found(scene, before)))


def test_a_profile_within_the_file_is_seen(tmp_path):
    scene = small_scene(tmp_path)
    text = bpy.data.texts.new("spot.ies")
    text.write(IES.format(100))
    node("ShaderNodeTexIES", ies=text)
    before = found(scene)
    text.clear()
    text.write(IES.format(90))
    assert changes(before, found(scene, before))


def test_a_volume_counts_frames_as_blender_does(tmp_path):
    volume = bpy.data.volumes.new("Smoke")
    volume.frame_duration, volume.frame_start, volume.frame_offset = 3, 1, 0
    told = {
        "CLIP": [None, 1, 2, 3, None, None],
        "EXTEND": [1, 1, 2, 3, 3, 3],
        "REPEAT": [3, 1, 2, 3, 1, 2],
        "PING_PONG": [2, 1, 2, 3, 2, 1],
    }
    for mode, numbers in told.items():
        volume.sequence_mode = mode
        assert [external._of_volume(volume, frame) for frame in range(6)] == numbers, mode
