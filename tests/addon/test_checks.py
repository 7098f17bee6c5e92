"""Checks ask what is rendered, not what is listed."""

from __future__ import annotations

import bpy
import pytest
from arto.arto_addon.stage.bounds import rendered
from arto.arto_addon.stage.stage import stage
from arto.arto_addon.world.check import check_no_volume
from arto.core.errors import SceneError
from scene_tools import BOX, add_mesh, instance_of, made_by_nodes


def catchers(scene):
    with stage(scene, scene.view_layers[0].name) as on:
        return rendered(on).catchers


def a_catcher(scene, collection):
    thing = add_mesh(scene, "Catcher", *BOX)
    thing.is_shadow_catcher = True
    scene.collection.objects.unlink(thing)
    collection.objects.link(thing)
    return thing


def test_catcher_in_an_instance_of_an_instance(scene):
    inner, outer = bpy.data.collections.new("Inner"), bpy.data.collections.new("Outer")
    a_catcher(scene, inner)
    instance_of(inner, outer)
    assert catchers(scene) == []  # nowhere in the scene yet
    empty = instance_of(outer, scene.collection)
    assert catchers(scene) == ["Catcher"]
    empty.hide_render = True
    assert catchers(scene) == []


def test_catcher_made_by_geometry_nodes(scene):
    kept = bpy.data.collections.new("Kept")
    thing = a_catcher(scene, kept)
    made_by_nodes(thing, scene.objects["Matt"])
    assert catchers(scene) == ["Catcher"]


@pytest.mark.parametrize("how", ["exclude", "hide_render", "object"])
def test_catcher_that_is_not_rendered_refuses_nothing(scene, how):
    kept = bpy.data.collections.new("Kept")
    scene.collection.children.link(kept)
    thing = a_catcher(scene, kept)
    assert catchers(scene) == ["Catcher"]
    if how == "exclude":
        scene.view_layers[0].layer_collection.children["Kept"].exclude = True
    elif how == "hide_render":
        kept.hide_render = True
    else:
        thing.hide_render = True
    assert catchers(scene) == []


def test_world_volume_that_is_none(scene):
    """Fog refuses; muted, of density 0, or behind a muted link it is no fog."""
    tree = scene.world.node_tree
    out = tree.get_output_node("CYCLES")
    for kind in ("ShaderNodeVolumeScatter", "ShaderNodeVolumePrincipled"):
        fog = tree.nodes.new(kind)
        link = tree.links.new(fog.outputs[0], out.inputs["Volume"])
        with pytest.raises(SceneError, match="volume"):
            check_no_volume(scene.world)
        fog.mute = True
        check_no_volume(scene.world)
        fog.mute = False
        density = fog.inputs["Density"].default_value
        fog.inputs["Density"].default_value = 0
        check_no_volume(scene.world)
        fog.inputs["Density"].default_value = density
        link.is_muted = True
        check_no_volume(scene.world)
        tree.nodes.remove(fog)
    add, fog = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeVolumeAbsorption")
    tree.links.new(fog.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], out.inputs["Volume"])
    with pytest.raises(SceneError, match="volume"):
        check_no_volume(scene.world)
    fog.inputs["Density"].default_value = 0
    check_no_volume(scene.world)
