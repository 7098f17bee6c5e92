"""The light kit as nodes of a world."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.kit import kit as kits
from arto.arto_addon.world import controls, dials
from arto.arto_addon.world.bake import bake
from arto.arto_addon.world.detail import FINEST, detail
from arto.core.errors import KitError
from arto.core.kit.light import Blend, Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit
from arto.core.kit.shine import map_of

LIGHTS = [
    Light("a", Kind.RECTANGLE, softness=0.3, gradient=0.4, roll=20),
    Light("b", Kind.ROUND, Blend.OVER, width=30, height=20, softness=0.5, slope=0.6),
    Light("c", Kind.RING, Blend.MULTIPLY, width=60, height=50, strength=0.3, gradient=0.4),
    Light("d", Kind.STRIP, width=60, height=8, gradient=-0.5, kelvin=3200, tint=0.2, roll=70),
    Light("e", Kind.SUN, width=0.53, strength=5, stops=1),
    Light("f", Kind.FLAG, Blend.MULTIPLY, width=80, height=60, strength=0, amount=0.7),
]


@pytest.fixture
def world() -> bpy.types.World:
    bpy.context.scene.render.engine = "CYCLES"
    world = new_world("Kit")
    bpy.context.scene.world = world
    return world


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.kind.value)
def test_the_nodes_shine_as_the_arithmetic_says(world: bpy.types.World, light: Light) -> None:
    light = replace(light, azimuth=173.0, elevation=30.0)
    kit = Kit((light,), Base(BaseKind.GRADIENT, strength=0.5), turn=30, strength=2)
    kits.write(world, kit)
    assert kits.read(world) == kit
    baked, told = bake(bpy.context.scene, 256), map_of(kit, 128)
    assert np.allclose(baked.irradiance(), told.irradiance(), rtol=4e-3)
    wrong = np.abs(baked.image - told.image)
    assert wrong.mean() < 5e-3 * told.image.mean() + 1e-3


def test_a_disc_bakes_to_its_closed_form(world: bpy.types.World) -> None:
    disc = Light("disc", Kind.ROUND, width=5, height=5, azimuth=20, elevation=70, strength=7)
    kits.write(world, Kit((disc,)))
    expected = 7 * 2 * math.pi * (1 - math.cos(math.radians(2.5)))
    assert bake(bpy.context.scene, 256).irradiance() == pytest.approx(expected, rel=5e-3)


def test_what_a_world_shows_becomes_the_base(world: bpy.types.World) -> None:
    dials.put_in_scaler(world).default_value = 3.0  # a node of its own works out the strength
    before = bake(bpy.context.scene, 32).image
    kit = kits.put_in(world)
    assert kit.base.kind is BaseKind.NODES and not kits.is_whole(world)
    assert np.allclose(bake(bpy.context.scene, 32).image, before, rtol=1e-5)
    assert "Other nodes" in dials.why_not_turned(world)
    assert detail(world) == 1
    # the slider now scales all of it
    controls.set_strength(world, 2.0)
    assert kits.read(world).strength == 2.0 and kits.read(world).base == kit.base
    # and an HDRI that is opened takes the place of the other nodes
    image = bpy.data.images.new("opened", 8, 4, float_buffer=True)
    controls.set_hdri(world, image)
    assert kits.read(world).base == Base(BaseKind.HDRI, "opened") and kits.is_whole(world)


def test_an_hdri_that_is_turned_becomes_the_base(world: bpy.types.World) -> None:
    tree = world.node_tree
    texture, turn = (tree.nodes.new(f"ShaderNode{n}") for n in ("TexEnvironment", "Mapping"))
    place = tree.nodes.new("ShaderNodeTexCoord")
    image = bpy.data.images.new("hdri", 64, 32, float_buffer=True)
    pixels = np.random.default_rng(1).random((32, 64, 4), np.float32)
    image.pixels.foreach_set(pixels.ravel())
    texture.image = image
    turn.inputs["Rotation"].default_value[2] = 1.0
    background = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
    background.inputs["Strength"].default_value = 2.0
    tree.links.new(place.outputs["Generated"], turn.inputs[0])
    tree.links.new(turn.outputs[0], texture.inputs[0])
    tree.links.new(texture.outputs[0], background.inputs[0])
    before = bake(bpy.context.scene, 64).image
    kit = kits.put_in(world)
    assert kit.base == Base(BaseKind.HDRI, "hdri", turn=57.2958, strength=2.0)
    assert np.allclose(bake(bpy.context.scene, 64).image, before, rtol=0.02, atol=0.02)
    # the sliders turn and scale base and lights together
    kits.write(world, kit.with_light(LIGHTS[0]))
    dials.turn_to(world, 0.5)
    strength, turned, _ = dials.read(world)
    assert (strength, turned) == (1.0, pytest.approx(0.5))
    assert kits.read(world).turn == pytest.approx(math.degrees(0.5), abs=1e-3)
    # what is changed keeps the rest, and the nodes stay
    node = kits.node_of(world, "a")
    node.inputs["Strength"].keyframe_insert("default_value", frame=1)
    kit = kits.read(world)
    louder = replace(kit.light("a"), kind=Kind.ROUND, blend=Blend.OVER, stops=3.0)
    kits.write(world, kit.with_light(louder))
    assert kits.node_of(world, "a") == node and kits.read(world) == kit.with_light(louder)
    action = world.node_tree.animation_data
    assert action and action.action


def test_solo_off_and_removal_are_seen_by_cycles(world: bpy.types.World) -> None:
    a, b = Light("a", azimuth=0, strength=1), Light("b", azimuth=180, strength=1, solo=True)
    for lights in ((a, b), (a, replace(b, on=False)), (replace(a, on=False), b), (a,), ()):
        kit = Kit(lights)
        kits.write(world, kit)
        assert kits.read(world) == kit
        told = map_of(kit, 32).image
        assert np.allclose(bake(bpy.context.scene, 64).image, told, atol=0.3)
        assert bool(told.any()) == bool(kit.lit)


def test_the_backdrop_is_the_camera_s_alone(world: bpy.types.World) -> None:
    kit = Kit((), Base(BaseKind.GRADIENT), Base(BaseKind.GRADIENT, strength=9.0))
    kits.write(world, kit)
    assert kits.read(world) == kit
    told = map_of(kit, 16).image
    assert np.allclose(bake(bpy.context.scene, 32).image, told, rtol=0.02, atol=0.02)
    kits.write(world, replace(kit, backdrop=None))
    assert not [n for n in world.node_tree.nodes if n.name.startswith("ARTO Backdrop")]


def test_what_cannot_be_a_kit_is_refused(world: bpy.types.World) -> None:
    with pytest.raises(KitError, match="no light kit"):
        kits.read(world)
    with pytest.raises(KitError, match="neither in this file"):
        kits.write(world, Kit((Light("p", Kind.PICTURE, image="/nowhere.png"),)))
    assert not kits.has(world)
    kits.write(world, Kit((LIGHTS[0], LIGHTS[1])))
    tree = world.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], kits.node_of(world, "a").inputs["Strength"])
    with pytest.raises(KitError, match="'Strength' of 'a' is worked out by nodes"):
        kits.read(world)
    assert detail(world) == FINEST
    tree.nodes.remove(noise)
    hue = tree.nodes.new("ShaderNodeHueSaturation")
    tree.links.new(kits.node_of(world, "a").outputs[0], hue.inputs["Color"])
    tree.links.new(hue.outputs[0], kits.node_of(world, "b").inputs["Under"])
    with pytest.raises(KitError, match="other nodes stand among the lights"):
        kits.read(world)


def test_mixed_shaders_are_refused(world: bpy.types.World) -> None:
    tree = world.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs[0])
    with pytest.raises(KitError, match="mixes shaders"):
        kits.put_in(world)


def test_nodes_around_a_kit_are_as_fine_as_they_are(world: bpy.types.World) -> None:
    """A node that only changes colours has no detail of its own; a texture behind a kit has."""
    kits.write(world, Kit((Light("a", Kind.ROUND, width=2.0, height=2.0),)))
    tree, out = world.node_tree, kits.out_of(world)
    assert out is not None and detail(world) == 360
    hue = tree.nodes.new("ShaderNodeHueSaturation")
    tree.links.new(out.inputs["Color"].links[0].from_socket, hue.inputs["Color"])
    tree.links.new(hue.outputs[0], out.inputs["Color"])
    assert not kits.is_whole(world) and detail(world) == 360
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], kits.nodes_of(world)[0].inputs["Under"])
    assert detail(world) == FINEST


def test_a_keyed_and_a_driven_light_is_that_of_its_frame(world: bpy.types.World) -> None:
    scene = bpy.context.scene
    kits.write(world, Kit((Light("a", Kind.ROUND, width=60.0, height=60.0),)))
    socket = kits.node_of(world, "a").inputs["Strength"]
    for frame, value in ((1, 1.0), (11, 3.0)):
        socket.default_value = value
        socket.keyframe_insert("default_value", frame=frame)
    kits.node_of(world, "a").inputs["Stops"].driver_add("default_value").driver.expression = "1"
    solid_angle = 2 * math.pi * (1 - math.cos(math.radians(30.0)))
    for frame, value in ((1, 1.0), (6, 2.0), (11, 3.0)):
        scene.frame_set(frame)
        assert kits.read(world).light("a").strength == pytest.approx(value)
        found = bake(scene, 64).irradiance()[0]
        assert found == pytest.approx(2 * value * solid_angle, rel=0.01)
