"""The check of the light says what keeps a world's light from the patches', and cries no wolf."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_material
from arto.arto_addon.capture import planes
from arto.arto_addon.capture.light_check import _words, check_light
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import status
from arto.arto_addon.stage.bounds import scene_bounds
from arto.arto_addon.stage.settings import prepare
from arto.arto_addon.stage.stage import stage
from arto.core import exr
from arto.core.capture.agreement import Agreement
from scene_tools import BOX, add_mesh, captured, cycles, material, small_scene, snapshot

from bench import scenes, worlds


def said(scene, **settings):
    """What the check says of a scene: the warning, or None."""
    for name, value in settings.items():
        setattr(scene.arto, name, value)
    with stage(scene, scene.view_layers[0].name) as on:
        hemicube = planes.wanted(scene, *scene_bounds(on))
        prepare(on, layers=3)
        return work.run(check_light(on, hemicube))[1]


@pytest.mark.newest
@pytest.mark.parametrize(("preset", "seed"), [("full", 0), ("paper", 1)])
@pytest.mark.parametrize("name", scenes.SCENES)
def test_it_never_cries_wolf(name, preset, seed):
    scene = scenes.SCENES[name](width=320, height=240)
    assert said(scene, preset=preset, seed=seed) is None


def room(tmp_path):
    """A room with the camera inside and a window of one wall."""
    scene = small_scene(tmp_path)
    for name in ("Matt", "Glossy"):
        bpy.data.objects.remove(scene.objects[name])
    corners = [(5 * x, 10 * y, 5 * z) for x, y, z in BOX[0]]
    wall = material("Wall", Roughness=1.0)
    faces = [f for f in BOX[1] if f != (1, 5, 7, 3)]  # no ceiling
    add_mesh(scene, "Walls", corners, faces, wall)
    scene.objects["Floor"].location.z = -4
    return scene, [(5 * x, 10 * y, 5.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def architects_glass():
    """Clear to shadow rays, glass to all others: the trick of every archviz scene."""
    glass = new_material("Architect's Glass")
    tree = glass.node_tree
    tree.nodes.clear()
    kinds = ("LightPath", "BsdfGlass", "BsdfTransparent", "MixShader", "OutputMaterial")
    nodes = {n: tree.nodes.new(f"ShaderNode{n}") for n in kinds}
    tree.links.new(nodes["LightPath"].outputs["Is Shadow Ray"], nodes["MixShader"].inputs[0])
    tree.links.new(nodes["BsdfGlass"].outputs[0], nodes["MixShader"].inputs[1])
    tree.links.new(nodes["BsdfTransparent"].outputs[0], nodes["MixShader"].inputs[2])
    tree.links.new(nodes["MixShader"].outputs[0], nodes["OutputMaterial"].inputs["Surface"])
    return glass


def test_glass_that_is_clear_to_shadow_rays(tmp_path):
    scene, window = room(tmp_path)
    assert said(scene) is None
    add_mesh(scene, "Pane", window, [(0, 1, 2, 3)], architects_glass())
    scene.cycles.caustics_refractive = scene.cycles.caustics_reflective = False
    warning = said(scene, patches=4)
    assert warning and abs(warning.ratio - 1) < 0.05
    assert "'Architect's Glass' lets shadow rays through" in warning.text
    assert "a render for each pattern" in warning.text


def test_a_pane_that_throws_no_shadow(tmp_path):
    scene, window = room(tmp_path)
    pane = add_mesh(scene, "Pane", window, [(0, 1, 2, 3)], material("Board", Roughness=1.0))
    pane.visible_shadow = False
    warning = said(scene)
    assert warning and "'Pane' throws no shadow" in warning.text


@pytest.mark.parametrize("flag", ["visible_shadow", "visible_diffuse"])
def test_a_soft_shadow_that_is_not_a_worlds(tmp_path, flag):
    """Boxes on open ground that half of a world's light passes: what it is off by is small, and
    all around."""
    scene = small_scene(tmp_path)
    assert said(scene) is None
    for name in ("Matt", "Glossy"):
        setattr(scene.objects[name], flag, False)
        scene.objects[name].scale = (1.4, 1.4, 1.4)
    warning = said(scene, patches=2)
    words = "'Matt' throws no shadow" if flag == "visible_shadow" else "'Matt' is hidden from"
    assert warning and words in warning.text


@pytest.mark.newest
def test_a_room_behind_such_glass_is_relit_as_cycles_renders_it(tmp_path):
    """Without sampled patches it had a fiftieth of its light."""
    scene, window = room(tmp_path)
    add_mesh(scene, "Pane", window, [(0, 1, 2, 3)], architects_glass())
    scene.cycles.caustics_refractive = scene.cycles.caustics_reflective = False
    scene.arto.patches, scene.arto.samples, scene.arto.patterns = 4, 256, "linear"
    there = captured(scene)
    assert there.head.route == "sampled" and len(there.files[0]) == 3
    # the patterns share their paths: no mean lies off its patch
    basis = there.read(0).basis
    assert (basis[:, 1:].max(axis=1) <= basis[:, 0] * 1.0001 + 1e-7).all()
    work.run(fit.fit(scene))
    for hdri, lamps in (("sunset", False), ("interior", True)):
        worlds.set_world_hdri(scene, hdri)
        scene.arto.lamps = lamps
        path, _ = work.run(relight.relight(scene))
        picture = next(iter(exr.read(path).values()))
        one, two = (cycles(scene, 512, seed, tmp_path) for seed in (1, 2))
        truth = (one + two)[..., :3] / 2
        noise = np.abs(one - two)[..., :3].mean() / truth.mean()
        assert abs(picture[..., :3].mean() / truth.mean() - 1) < 0.03
        # what is left is where the light is, not how much: 0.08 and 0.15 over the noise
        assert np.abs(picture[..., :3] - truth).mean() / truth.mean() < noise + 0.18


def test_a_closed_dome_is_said(tmp_path):
    scene, window = room(tmp_path)
    add_mesh(scene, "Ceiling", window, [(0, 1, 2, 3)], material("Ceiling", Roughness=1.0))
    warning = said(scene)
    assert warning and warning.dark
    assert "no light from outside reaches the picture" in warning.text
    # a lamp inside does not let light in
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy = 1000
    scene.collection.objects.link(lamp)
    assert said(scene).dark


def test_a_warning_is_kept_with_the_capture_and_shown(tmp_path):
    scene, window = room(tmp_path)
    add_mesh(scene, "Pane", window, [(0, 1, 2, 3)], architects_glass())
    scene.cycles.caustics_refractive = False
    before = snapshot()
    captured(scene)
    assert snapshot() == before
    text, serves = status.caution_line(scene) or ("", True)
    assert "lets shadow rays through" in text and not serves
    assert status.caution_line(small_scene(tmp_path / "other")) is None


def test_the_cause_that_is_named_is_in_the_scene(tmp_path):
    scene = small_scene(tmp_path)
    brighter = Agreement(1.1, 1.24, 0.08, False)
    with stage(scene, scene.view_layers[0].name) as on:
        prepare(on, layers=3)
        assert "more than 8 transparent surfaces" in _words(on, brighter, deep=True)
        assert "a material or a setting" in _words(on, brighter)
        if hasattr(bpy.types, "ShaderNodeRaycast"):
            tree = scene.objects["Floor"].data.materials[0].node_tree
            node = tree.nodes.new("ShaderNodeRaycast")
            assert "a material or a setting" in _words(on, brighter)  # it leads nowhere
            shader = tree.nodes["Principled BSDF"]
            tree.links.new(node.outputs["Is Hit"], shader.inputs["Base Color"])
            assert "'Floor' looks around (node Raycast)" in _words(on, brighter)
