"""What is otherwise in Blender 4.5 than in Blender 5, for an artist's file and for ARTO."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.compositing import compositor, new_compositor
from arto.arto_addon.blender.version import FIVE
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import footage
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.back import mix_of
from arto.arto_addon.world import kept
from arto.arto_addon.world.background import background
from arto.arto_addon.world.check import check_world
from arto.arto_addon.world.detail import detail
from scene_tools import assert_as_cycles, captured, set_colour, small_scene
from shot_tools import run_all

without_nodes = pytest.mark.skipif(FIVE, reason="from Blender 5 on there is no Use Nodes")


@without_nodes
@pytest.mark.parametrize("left", [False, True])
def test_a_world_without_nodes_is_its_colour(tmp_path, left):
    """Whether it never had nodes, or has some that it does not use."""
    scene = small_scene(tmp_path)
    colour = (0.5, 0.25, 0.125)
    if left:
        set_colour(scene, (1, 0, 0), 7.0)
        tree = scene.world.node_tree
        fog = tree.nodes.new("ShaderNodeVolumeScatter")
        tree.links.new(fog.outputs[0], tree.get_output_node("CYCLES").inputs["Volume"])
        scene.world.use_nodes = False
    else:
        scene.world = bpy.data.worlds.new("Plain")
    scene.world.color = colour
    assert check_world(scene) == scene.world and detail(scene.world) == 1
    image = kept.environment(scene, 64).image
    np.testing.assert_allclose(image, np.broadcast_to(colour, image.shape), rtol=1e-4)
    np.testing.assert_allclose(background(scene).mean((0, 1)), colour, rtol=1e-4)
    scene.render.film_transparent = True
    scene.arto.samples = 256
    assert_as_cycles(run_all(scene), scene, 256, tmp_path)


@without_nodes
def test_a_material_without_nodes_keeps_its_look(tmp_path):
    """On a thing, and as the view layer's for all of them."""
    scene = small_scene(tmp_path)
    clay = bpy.data.materials.new("Clay")
    clay.diffuse_color = (0.1, 0.6, 0.3, 1)
    scene.objects["Matt"].data.materials[0] = clay
    set_colour(scene, (0.5, 0.5, 0.5))
    scene.render.film_transparent = True
    scene.arto.samples = 256
    assert_as_cycles(run_all(scene), scene, 256, tmp_path)
    scene.view_layers[0].material_override = clay
    assert_as_cycles(run_all(scene), scene, 256, tmp_path)
    assert not clay.use_nodes and clay.node_tree is None


@without_nodes
def test_a_compositor_that_is_off_stays_so(tmp_path, capsys):
    """It gains the node, and it is said what is to be done to see it; what is in it is no footage,
    and a render is what it was."""
    scene = small_scene(tmp_path)
    tree = new_compositor(scene, "")
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.new("Filmed", 8, 8)
    scene.use_nodes = False
    assert footage.footage(scene) is None
    run_all(scene)
    assert not scene.use_nodes and compositor(scene) == tree
    assert any(n.bl_idname == "CompositorNodeGroup" for n in tree.nodes)
    assert "turn Use Nodes on" in capsys.readouterr().out
    scene.use_nodes = True
    found = footage.footage(scene)
    assert found and found.source == node.image


def test_a_new_layer_is_seen_where_the_mixer_is_in_use(tmp_path):
    """A mixer's node in the scene's own tree: what a socket that comes later begins at."""
    scene = small_scene(tmp_path, lamp=True)
    set_colour(scene, (0.5, 0.5, 0.5))
    scene.arto.layers, scene.arto.samples = "FACES", 16
    captured(scene)
    work.run(fit.fit(scene))
    work.run(relight.relight(scene))
    node = mix_of(scene).node
    before = {s.name for s in node.inputs}
    scene.arto.layers = "GROUPS"
    group = scene.arto.groups.add()
    group.name, group.radius = "key", 0.5
    work.run(relight.relight(scene))
    new = [s for s in node.inputs if s.name not in before and not s.name.endswith("Tint")]
    assert "LG_key" in {s.name for s in new}
    assert all(s.default_value == 1 for s in new)


@pytest.mark.skipif(FIVE, reason="Blender 5 names its working space itself")
def test_a_studios_working_space_is_found(tmp_path):
    """By its role, whatever it is."""
    own = Path(bpy.utils.system_resource("DATAFILES", path="colormanagement"))
    shutil.copytree(own, tmp_path / "ocio")
    config = tmp_path / "ocio" / "config.ocio"
    text = re.sub("scene_linear: .*", "scene_linear: ACEScg", config.read_text())
    config.write_text(text)
    code = "import bpy; from arto.arto_addon.blender.colour import working_space as w; print(w())"
    for path, name in ((config, "ACEScg"), (own / "config.ocio", "Linear Rec.709")):
        environment = os.environ | {"OCIO": str(path)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True
        )
        assert name in done.stdout.splitlines(), done.stderr
