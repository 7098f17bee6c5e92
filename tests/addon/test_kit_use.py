"""The light kit as an artist uses it: the list, presets, an HDRI's suns, files, lamps, Live."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.blender.output import float_exr
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.kit import kit as kits
from arto.arto_addon.live import placing
from arto.arto_addon.live.quick import Quick
from arto.arto_addon.relight import kit_out
from arto.arto_addon.ui import cli
from arto.arto_addon.ui.kit_operators import chosen, facing
from arto.arto_addon.ui.report import CODES
from arto.arto_addon.world import dials
from arto.arto_addon.world.bake import bake
from arto.arto_addon.world.kept import shows
from arto.arto_addon.world.studio import render
from arto.core import exr
from arto.core.errors import FieldError, KitError
from arto.core.kit import kit_file
from arto.core.kit.light import Blend, Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit
from arto.core.kit.presets import PRESETS, preset
from arto.core.light.environment import Environment
from arto.core.place.place import What
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scene_tools import small_scene

KEY = Light("Key", azimuth=-60.0, elevation=40.0, width=40.0, height=30.0, strength=5.0)


@pytest.fixture
def scene(tmp_path):
    scene = small_scene(tmp_path)
    kits.write(scene.world, Kit((KEY,)))
    return scene


def names(scene: bpy.types.Scene) -> list[str]:
    return [light.name for light in kits.read(scene.world).lights]


def test_the_buttons_of_the_list(scene) -> None:
    ops = bpy.ops.arto
    ops.kit_add(kind="RING")
    ops.kit_duplicate()
    assert names(scene) == ["Key", "Ring", "Ring 2"]
    node = chosen(scene.world)
    assert node and node.label == "Ring 2"
    ops.kit_move(by=-1)
    assert names(scene) == ["Key", "Ring 2", "Ring"]
    ops.kit_switch(what="LOCK")
    with pytest.raises(RuntimeError, match="locked"):
        ops.kit_remove()
    ops.kit_switch(what="SOLO", light="Key")
    assert [light.name for light in kits.read(scene.world).lit] == ["Key"]
    ops.kit_blend(blend="OVER", light="Ring")
    ops.kit_kind(kind="STRIP", light="Ring")
    light = kits.read(scene.world).light("Ring")
    assert (light.kind, light.blend) == (Kind.STRIP, Blend.OVER)
    ops.kit_preset(preset="three")
    assert names(scene) == ["Ring 2", "Fill", "Rim", "Key"]  # what is locked stays


@pytest.mark.parametrize("name", PRESETS)
def test_presets_face_the_camera(name: str) -> None:
    """A quarter turn of the camera is a quarter turn of the lights, and there is light."""
    kit, turned = preset(name, -90.0), preset(name, 0.0)
    assert kit.lit and not {light.lock for light in kit.lights} - {False}
    for a, b in zip(kit.lights, turned.lights, strict=True):
        assert (b.azimuth - a.azimuth) % 360 == pytest.approx(90)


def test_the_key_is_on_the_camera_s_right(scene) -> None:
    assert facing(scene) == pytest.approx(-90)
    key = preset("one", facing(scene)).lights[0]
    assert key.azimuth == pytest.approx(-45)  # towards +X, which is right in this picture


def test_an_hdri_s_sun_is_moved_alone(scene) -> None:
    pixels = np.full((128, 256, 3), 0.5, np.float32)
    pixels[40, 100] = (9000.0, 8000.0, 6000.0)
    image = bpy.data.images.new("Sky", 256, 128, float_buffer=True)
    rows = np.concatenate([pixels[::-1], np.ones((128, 256, 1), np.float32)], axis=-1)
    image.pixels.foreach_set(np.ascontiguousarray(rows).ravel())
    image.pack()
    base = Base(BaseKind.HDRI, "Sky", turn=30.0)
    kits.write(scene.world, Kit((), base, turn=10.0, strength=2.0))
    before = bake(scene, 256)
    assert bpy.ops.arto.kit_from_hdri() == {"FINISHED"}
    kit = kits.read(scene.world)
    (sun,) = kit.lights
    after = bake(scene, 256)
    assert after.irradiance() == pytest.approx(before.irradiance(), rel=0.01)
    peaks = [divmod(int(e.image.sum(-1).argmax()), 256) for e in (before, after)]
    assert np.abs(np.array(peaks[0]) - peaks[1]).max() <= 1
    assert sun.colour[1] == pytest.approx(8 / 9, rel=0.01)
    kits.write(scene.world, kit.with_light(replace(sun, on=False)))
    left = bake(scene, 64).image
    assert np.allclose(left, 1.0, rtol=0.02)  # no hole, and no sun


def f12(scene: bpy.types.Scene) -> np.ndarray:
    copy = scene.copy()
    try:
        copy.cycles.samples, copy.cycles.sample_clamp_indirect = 64, 0
        copy.cycles.use_adaptive_sampling = copy.cycles.use_denoising = False
        copy.render.film_transparent = True
        float_exr(copy.render, multilayer=False)
        return render(copy)[..., :3]
    finally:
        bpy.data.scenes.remove(copy)


@pytest.mark.parametrize(
    "light",
    [
        replace(KEY, roll=30.0, colour=(1.0, 0.5, 0.2)),
        replace(KEY, kind=Kind.RING, softness=0.2, slope=0.8),
        replace(KEY, kind=Kind.SUN, width=3.0),
    ],
    ids=lambda light: light.kind.value,
)
def test_lamps_light_as_the_lights_did(scene, light: Light) -> None:
    kits.write(scene.world, Kit((light,), turn=15.0, strength=1.5))
    before = f12(scene)
    (name,) = kit_out.to_lamps(scene)
    after = f12(scene)
    assert name in scene.objects and not kits.read(scene.world).lights
    # a glossy path that meets a small light in the world is a speck
    before, after = (np.minimum(image, 3.0) for image in (before, after))
    assert after.mean(axis=(0, 1)) == pytest.approx(before.mean(axis=(0, 1)), rel=0.03)
    assert np.abs(after - before).mean() < 0.06 * before.mean()


def test_what_no_lamp_can_be_stays_in_the_world(scene) -> None:
    kits.write(scene.world, Kit((KEY, replace(KEY, name="Flag", blend=Blend.MULTIPLY))))
    with pytest.raises(KitError, match="'Flag' cannot be a lamp"):
        kit_out.to_lamps(scene)
    assert names(scene) == ["Key", "Flag"]


def test_the_kit_is_an_hdri_as_fine_as_its_smallest_light(scene, tmp_path) -> None:
    sun = Light("Sun", Kind.SUN, elevation=30, width=2.0, strength=2.0)
    assert kit_out.width_of(scene.world) == 1024
    kits.write(scene.world, Kit((replace(sun, width=0.2),)))
    assert kit_out.width_of(scene.world) == 4096  # two texels across
    kits.write(scene.world, Kit((sun,)))
    width, height = kit_out.to_hdri(scene, tmp_path / "kit.exr")
    assert (width, height) == (1024, 512)
    told = Environment(next(iter(exr.read(tmp_path / "kit.exr").values()))[..., :3])
    assert told.irradiance()[0] == pytest.approx(2.0, rel=0.01)


def test_scripts_light_by_lists(scene, tmp_path, capsys) -> None:
    path = tmp_path / "kit.json"
    assert cli.main(["light", "--json", str(path)]) == 0
    assert kit_file.load(path) == Kit((KEY,))
    said = json.loads(path.read_text())
    said["lights"][0]["stops"] = 1.5
    path.write_text(json.dumps(said))
    assert cli.main(["light", "--json", str(path)]) == 0
    assert kits.read(scene.world).light("Key").stops == 1.5
    assert cli.main(["light", "--json", "-"]) == 0
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert json.loads(last)["lights"][0]["stops"] == 1.5
    said["lights"][0]["stopps"] = 1
    path.write_text(json.dumps(said))
    assert cli.main(["light", "--json", str(path)]) == 1
    theirs = tmp_path / "notes.json"
    theirs.write_text("{}")
    assert cli.main(["light", "--json", str(theirs), "--write"]) == 1
    assert theirs.read_text() == "{}"
    # what is no file is neither read, waited for nor replaced
    folder = tmp_path / "folder.exr"
    folder.mkdir()
    pipe = tmp_path / "pipe.exr"
    os.mkfifo(pipe)
    capsys.readouterr()
    for one in (folder, pipe):
        assert cli.main(["light", "--json", str(one)]) == CODES["wrong options"]
        assert cli.main(["light", "--hdri", str(one), "--write"]) == 1
    assert "no kit" not in capsys.readouterr().err
    assert folder.is_dir() and pipe.is_fifo()


def test_a_kit_with_a_cut_off_hdri_is_told_as_it_is_read(scene, tmp_path, capsys) -> None:
    sky = tmp_path / "sky.exr"
    exr.write(sky, {"": np.ones((64, 128, 3), np.float32)})
    path = tmp_path / "kit.json"
    kit_file.save(Kit((), Base(BaseKind.HDRI, str(sky))), path)
    sky.write_bytes(sky.read_bytes()[:-200])
    assert cli.main(["light", "--json", str(path)]) == 1
    assert "sky.exr" in capsys.readouterr().err
    assert kits.read(scene.world) == Kit((KEY,))


def test_live_s_own_map_is_that_of_cycles(scene) -> None:
    fill = Light("Fill", Kind.STRIP, azimuth=150, width=70, height=12, tint=0.2, kelvin=4000)
    base = Base(BaseKind.GRADIENT, strength=0.4)
    kits.write(scene.world, Kit((KEY, fill), base, turn=25.0, strength=3.0))
    quick = Quick().map_of(scene.world)
    assert quick is not None
    baked = bake(scene, 256)
    found = Environment(quick * np.float32(3.0), np.radians(25.0))
    assert found.irradiance() == pytest.approx(baked.irradiance(), rel=0.01)
    # a turned or dimmed kit is the same map; a changed light is another
    key, strength, turn = shows(scene, scene.world)
    assert (strength, turn) == pytest.approx((3.0, np.radians(25.0)))
    dials.turn_to(scene.world, 1.0)
    assert shows(scene, scene.world)[0] == key
    kits.node_of(scene.world, "Key").inputs["Stops"].default_value = 1.0
    assert shows(scene, scene.world)[0] != key


def test_an_appended_kit_is_the_kit_and_a_linked_one_is_left_alone(scene, tmp_path) -> None:
    kit = kits.read(scene.world)
    blend = str(tmp_path / "kit.blend")
    bpy.data.libraries.write(blend, {scene.world})
    for link in (False, True):
        with bpy.data.libraries.load(blend, link=link) as (_, into):
            into.worlds = [scene.world.name]
        (world,) = into.worlds
        assert kits.read(world) == kit
        if link:
            assert "make it local" in kits.why_not(world)
            with pytest.raises(KitError, match="make it local"):
                kits.write(world, Kit())
        else:
            kits.write(world, kit.with_light(replace(KEY, stops=1.0)))
            assert kits.read(scene.world) == kit


def _said(world) -> list:
    """All that the nodes of a world say."""
    tree = world.node_tree
    values = [
        [str(getattr(s, "default_value", "")) for s in (*n.inputs, *n.outputs)] for n in tree.nodes
    ]
    nodes = [(n.name, n.bl_idname, n.label, n.mute, tuple(n.location)) for n in tree.nodes]
    links = [(k.from_node.name, k.from_socket.name, k.to_node.name) for k in tree.links]
    return [world.name, world.use_fake_user, nodes, values, sorted(links)]


def _given_up_without_a_kit(scene, x: int, y: int) -> None:
    """The nodes that a kit took for its base are as they were, and nothing is left of the kit."""
    kit_world = scene.world
    scene.world = plain = new_world("Plain")
    plain.use_fake_user = True
    nodes = plain.node_tree.nodes
    nodes["Background"].inputs["Strength"].default_value = 0.3
    sky = nodes.new("ShaderNodeTexSky")
    plain.node_tree.links.new(sky.outputs[0], nodes["Background"].inputs["Color"])
    said, blocks = _said(plain), {*bpy.data.node_groups, *bpy.data.worlds}
    gesture = placing.Gesture(scene, What.REFLECT)
    gesture.move(x, y)
    assert kits.has(scene.world)
    gesture.back()
    gesture.close()
    assert _said(scene.world) == said
    assert len({*bpy.data.node_groups, *bpy.data.worlds}) == len(blocks)
    bpy.data.worlds.remove(scene.world)
    scene.world = kit_world


def test_a_light_is_put_moved_and_put_back(scene) -> None:
    """The tool without its mouse, on the front of the glossy box."""
    settings = scene.arto
    settings.samples, settings.patches, settings.keep = 32, 2, "never"
    scene.render.film_transparent = True
    layer = scene.view_layers[0].name
    work.run(capture.capture(scene, layer))
    work.run(fit.fit(scene, layer))
    before = kits.read(scene.world)
    gesture = placing.Gesture(scene, What.LIGHT)
    box = scene.objects["Glossy"].matrix_world.translation
    seen = world_to_camera_view(scene, scene.camera, box + Vector((0.0, -1.0, 0.0)))
    x, y = int(seen.x * 24), int((1 - seen.y) * 18)
    light = gesture.move(x, y)
    assert light.name == "Light" and gesture.light == "Light"
    # its front looks along -Y
    assert abs((light.azimuth + 90 + 180) % 360 - 180) < 25 and abs(light.elevation) < 25
    gesture.change(size=1.5, roll=10.0, stops=1.0)
    changed = kits.read(scene.world).light("Light")
    assert changed.sides[0] == pytest.approx(1.5 * light.sides[0], rel=1e-4)
    assert (changed.roll, changed.stops) == (light.roll + 10, light.stops + 1)
    gesture.back()
    gesture.close()
    assert kits.read(scene.world) == before
    _given_up_without_a_kit(scene, x, y)
    # a locked light is moved by no tool, and a place without things says so
    kits.write(scene.world, Kit((replace(KEY, lock=True),)))
    with pytest.raises(KitError, match="locked"):
        placing.Gesture(scene, What.REFLECT, "Key")
    gesture = placing.Gesture(scene, What.REFLECT)
    with pytest.raises(FieldError):
        gesture.move(0, 0)
    gesture.close()
