"""The simulated photographer: the light of its lamps and monitors, and what its folders hold."""

from __future__ import annotations

import math

import bmesh
import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.photographer import lights, photograph
from arto.arto_addon.ui import cli
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import FilesError
from arto.core.photographs import description_file
from arto.core.photographs.description import Kind, Monitors

ALBEDO = 0.5


@pytest.fixture
def card():
    """A scene with a matt grey card on the ground, seen from above by a camera that turns it."""
    scene = bpy.data.scenes.new("card")
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 8, 6
    mesh = bmesh.new()
    bmesh.ops.create_grid(mesh, size=1.0)
    data = bpy.data.meshes.new("card")
    mesh.to_mesh(data)
    mesh.free()
    material = bpy.data.materials.new("card")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (ALBEDO, ALBEDO, ALBEDO, 1)
    inputs["Roughness"].default_value, inputs["Specular IOR Level"].default_value = 1.0, 0.0
    data.materials.append(material)
    lens = bpy.data.cameras.new("card")
    lens.type, lens.ortho_scale = "ORTHO", 0.2
    things = [bpy.data.objects.new("card", block) for block in (data, lens)]
    for thing in things:
        scene.collection.objects.link(thing)
    scene.camera = things[1]
    scene.camera.location = (0, 0, 5)
    shown = bpy.context.window.scene
    yield scene
    bpy.context.window.scene = shown  # Blender ends where the scene that it shows goes
    bpy.data.batch_remove([scene, *things, data, lens, material])


def test_a_lamp_gives_the_light_that_its_direction_says(card):
    up = np.array([0.0, 0.0, 1.0])
    aside = np.array([math.sqrt(0.75), 0.0, 0.5])
    below = np.array([0.0, 0.0, -1.0])
    found = work.run(
        lights.by_lamps(card, card.view_layers[0].name, np.stack([up, aside, below]), 16)
    )
    wanted = [ALBEDO / math.pi, ALBEDO / math.pi / 2, 0]
    assert found.light.mean(axis=(1, 2, 3)) == pytest.approx(wanted, rel=0.01, abs=1e-4)
    assert found.own.max() == 0


def test_monitors_that_fall_off_light_the_middle_as_those_that_do_not(card):
    monitors = Monitors(("top",), 1, "white", 64, 64)
    layer = card.view_layers[0].name
    even, falling = (
        work.run(lights.by_monitors(card, layer, monitors, 30.0, 256, falls)) for falls in (0, 2)
    )
    white = even.light[0, 0].mean()
    # what the top of a cube gives a surface in its middle, by the form factor of a square
    x = 1 / math.sqrt(2)
    assert white == pytest.approx(ALBEDO * 4 / math.pi * x * math.atan(x), rel=0.03)
    for m in (0, 2):
        moment = even.light[0, m].mean()
        assert falling.light[0, m].mean() == pytest.approx(moment, rel=0.03)
    # near monitors that fall off light what is off the middle less
    near = [
        work.run(lights.by_monitors(card, layer, monitors, 1.0, 64, falls)).light[0, 0].mean()
        for falls in (0, 4)
    ]
    assert near[1] == pytest.approx(near[0], rel=0.1)


def test_a_folder_holds_all_photographs_and_the_truth_and_another_is_left_alone(card, tmp_path):
    out = tmp_path / "photos"
    arguments = ["--patches", "1", "--sides", "top", "back", "--samples", "4", "--exposures", "2"]
    code = cli.main(["photograph", str(out), "--scene", card.name, "--jpeg", *arguments])
    assert code == 0
    said = description_file.read(out / "photographs.json")
    assert all((out / photo.file).is_file() for photo in said.photographs)
    # of two patches six patterns, and two of these again; of each two exposures
    assert len(said.of(Kind.PATTERN)) == 2 * (2 * 6 + 4)
    there = CaptureSet(out / photograph.TRUTH)
    assert there.read(0).basis.shape == (2, 6, 6, 8, 3)
    other = tmp_path / "other"
    other.mkdir()
    (other / "mine.txt").write_text("mine")
    with pytest.raises(FilesError, match="something else"):
        work.run(photograph.photograph(card, card.view_layers[0].name, other, photograph.Setup()))
