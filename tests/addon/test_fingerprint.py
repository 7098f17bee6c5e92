"""The fingerprint tells what has changed of what is seen, and nothing else."""

from __future__ import annotations

import os
import time

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import status, walk
from arto.arto_addon.shot.fingerprint import changes, fingerprint, in_pieces
from arto.core import exr
from scene_tools import add_mesh, captured, set_colour, small_scene


def rich_scene(tmp_path):
    """A small scene with what real ones have: texture, modifier, group of nodes, instance."""
    scene = small_scene(tmp_path, lamp=True)
    matt = bpy.data.materials["Matt"]
    image = bpy.data.images.new("Texture", 8, 8)
    image.pixels.foreach_set(np.tile([0.2, 0.4, 0.6, 1.0], 64).astype(np.float32))
    image.filepath_raw, image.file_format = str(tmp_path / "texture.png"), "PNG"
    image.save()
    texture = matt.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    group = bpy.data.node_groups.new("Wear", "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    value = group.nodes.new("ShaderNodeValue")
    group.links.new(value.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    inside = matt.node_tree.nodes.new("ShaderNodeGroup")
    inside.node_tree = group
    principled = matt.node_tree.nodes["Principled BSDF"]
    matt.node_tree.links.new(texture.outputs[0], principled.inputs["Base Color"])
    matt.node_tree.links.new(inside.outputs[0], principled.inputs["Roughness"])
    scene.objects["Glossy"].modifiers.new("Bevel", "BEVEL").width = 0.1
    part = bpy.data.collections.new("Part")
    thing = add_mesh(scene, "Inner", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    scene.collection.objects.unlink(thing)
    part.objects.link(thing)
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", part
    scene.collection.objects.link(empty)
    empty.location = (0, 2, 0)
    bpy.context.view_layer.update()
    return scene


def found(scene):
    bpy.context.view_layer.update()
    return fingerprint(scene, scene.view_layers[0].name, full=True)


def bump(mesh):
    mesh.vertices[0].co.z += 0.01
    mesh.update()


def repaint(tmp_path):
    image = bpy.data.images["Texture"]
    image.pixels.foreach_set(np.tile([0.9, 0.4, 0.6, 1.0], 64).astype(np.float32))
    image.update()


def principled(name):
    return bpy.data.materials[name].node_tree.nodes["Principled BSDF"]


SEEN = {
    "colour": (lambda s: set_input("Glossy", "Roughness", 0.4), "Material 'Glossy'"),
    "group": (lambda s: set_value(0.7), "'Wear'"),
    "colour space": (
        lambda s: setattr(bpy.data.images["Texture"].colorspace_settings, "name", "Linear Rec.709"),
        "Image 'Texture'",
    ),
    "link": (
        lambda s: unlink("Matt"),
        "Material 'Matt'",
    ),
    "mesh": (lambda s: bump(s.objects["Matt"].data), "Mesh 'Matt'"),
    "place": (lambda s: setattr(s.objects["Matt"], "location", (-1, 0, 1)), "Object 'Matt'"),
    "modifier": (
        lambda s: setattr(s.objects["Glossy"].modifiers[0], "width", 0.2),
        "Object 'Glossy'",
    ),
    "modifier off": (
        lambda s: setattr(s.objects["Glossy"].modifiers[0], "show_render", False),
        "Object 'Glossy'",
    ),
    "lamp": (lambda s: setattr(s.objects["Sun"].data, "energy", 3.0), "Light 'Sun'"),
    "lamp off": (lambda s: setattr(s.objects["Sun"], "hide_render", True), "Object 'Sun'"),
    "inside an instance": (lambda s: bump(bpy.data.meshes["Inner"]), "Mesh 'Inner'"),
    "painted": (lambda s: repaint(s), "Image 'Texture'"),
    "bounces": (lambda s: setattr(s.cycles, "max_bounces", 3), "Render settings"),
    "new": (lambda s: add_mesh(s, "New", [(0, 0, 0)], []), "'New' is new"),
    "gone": (lambda s: bpy.data.objects.remove(s.objects["Floor"]), "is gone"),
    "visibility": (
        lambda s: setattr(s.objects["Matt"], "visible_glossy", False),
        "Object 'Matt'",
    ),
    "f-stop": (lambda s: setattr(s.camera.data.dof, "use_dof", True), "Camera 'Camera'"),
}
UNSEEN = {
    "world": lambda s: set_colour(s, (1, 0, 0)),
    "selection": lambda s: s.objects["Matt"].select_set(True),
    "hidden in the viewport": lambda s: s.objects["Matt"].hide_set(True),
    "node moved": lambda s: setattr(principled("Matt"), "location", (900, 1)),
    "samples": lambda s: setattr(s.cycles, "samples", 3),
    "output": lambda s: setattr(s.render, "filepath", "/elsewhere/"),
    "modifier in the viewport": lambda s: setattr(
        s.objects["Glossy"].modifiers[0], "show_viewport", False
    ),
    "object that is not rendered": lambda s: setattr(
        add_mesh(s, "Helper", [(0, 0, 0)], []), "hide_render", True
    ),
    "nothing": lambda s: None,
}


def set_input(material, name, value):
    principled(material).inputs[name].default_value = value


def set_value(value):
    bpy.data.node_groups["Wear"].nodes["Value"].outputs[0].default_value = value


def unlink(material):
    tree = bpy.data.materials[material].node_tree
    tree.links.remove(tree.links[-1])


@pytest.mark.parametrize("what", SEEN)
def test_what_is_seen_is_named(tmp_path, what):
    scene = rich_scene(tmp_path)
    change, named = SEEN[what]
    before = found(scene)
    change(scene)
    words = changes(before, found(scene))
    assert any(named in w for w in words), words


@pytest.mark.parametrize("what", UNSEEN)
def test_what_is_not_seen_is_no_change(tmp_path, what):
    scene = rich_scene(tmp_path)
    before = found(scene)
    UNSEEN[what](scene)
    assert changes(before, found(scene)) == []


def test_a_saved_and_opened_file_is_the_same(tmp_path):
    scene = rich_scene(tmp_path)
    before = found(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert changes(before, found(bpy.context.scene)) == []


def test_a_file_with_another_time_is_the_same_and_one_with_other_bytes_is_not(tmp_path):
    scene = rich_scene(tmp_path)
    before = found(scene)
    path = tmp_path / "texture.png"
    bytes_ = path.read_bytes()
    path.write_bytes(bytes_)
    os.utime(path, ns=(1, 1))
    assert changes(before, fingerprint(scene, "ViewLayer", before)) == []
    path.write_bytes(bytes_[:-1] + b"\0")
    assert changes(before, fingerprint(scene, "ViewLayer", before)) == [
        "Image 'Texture' changed since"
    ]


def test_a_change_and_back(tmp_path):
    """The line turns from a tick to what has changed, and back when it is undone."""
    scene = small_scene(tmp_path)
    captured(scene)
    green = status.capture_line(scene)
    assert green[1]
    set_input("Matt", "Roughness", 0.5)
    assert status.capture_line(scene) == ("Material 'Matt' changed since", False)
    set_input("Matt", "Roughness", 1.0)
    assert status.capture_line(scene) == green


def test_relighting_a_changed_scene_says_so(tmp_path):
    """It is allowed: the artist knows whether it shows. The file says it too."""
    scene = small_scene(tmp_path)
    captured(scene)
    work.run(fit.fit(scene))
    scene.objects["Matt"].location.x += 0.5
    said = []
    path, _ = work.run(relight.relight(scene), lambda step: said.append(step.text))
    assert any("Object 'Matt' changed since" in text for text in said)
    assert "Object 'Matt' changed since" in exr.header(path)["arto.changed since capture"]


def test_a_capture_goes_on_only_with_what_it_began_with(tmp_path, monkeypatch):
    """Stopped, the scene changed: a new one begins. Changed back, the old one goes on."""
    from arto.arto_addon.capture import capture, planned

    scene = small_scene(tmp_path)
    monkeypatch.setattr(
        planned, "tiles_of", lambda r, n, m: [type(r)(0, y, r.width, 9) for y in (0, 9)]
    )

    def tiles_rendered():
        renders = []
        work.run(
            capture.capture(scene, "ViewLayer"),
            lambda step: renders.append(step) if "basis images" in step.text else None,
        )
        return len(renders)

    def stop_after_one():
        steps = capture.capture(scene, "ViewLayer")
        for step in steps:
            if step.text.startswith("render 2 of "):
                break
            if isinstance(step, work.Render):
                work.blocking_render(step)
        steps.close()

    stop_after_one()
    set_input("Matt", "Roughness", 0.5)
    assert tiles_rendered() == 2
    set_input("Matt", "Roughness", 1.0)
    assert tiles_rendered() == 1


def test_a_large_mesh_is_read_in_pieces(tmp_path, monkeypatch):
    """The window goes on between them, and what they make is the same."""
    scene = small_scene(tmp_path)
    side = 1200
    mesh = bpy.data.meshes.new("Large")
    mesh.vertices.add(side * side)
    mesh.vertices.foreach_set("co", np.random.default_rng(0).random(3 * side * side, np.float32))
    scene.collection.objects.link(bpy.data.objects.new("Large", mesh))
    layer = scene.view_layers[0].name
    monkeypatch.setattr(walk, "_PIECE", 1 << 22)
    spent, pieces = [], in_pieces(scene, layer, full=True)
    while True:
        begun = time.thread_time()
        try:
            next(pieces)
        except StopIteration as end:
            made = end.value
            break
        spent.append(time.thread_time() - begun)
    assert made == fingerprint(scene, layer, full=True)
    assert len(spent) > 12 * side * side >> 22
    assert max(spent) < 0.05
    # what is removed between two pieces ends them, and nothing of it is read
    pieces = in_pieces(scene, layer, full=True)
    next(pieces)
    bpy.data.meshes.remove(mesh)
    with pytest.raises(ReferenceError):
        list(pieces)
