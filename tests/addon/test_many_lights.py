"""Worlds that are kept, turned and given as files: each picture is that of its own light."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.compositing import OUTPUT, compositor
from arto.arto_addon.capture.sequence import capture_frames
from arto.arto_addon.fit import fit
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import many, relight
from arto.arto_addon.shot import paths
from arto.arto_addon.world import bake as bake_module
from arto.arto_addon.world import kept
from arto.core import exr
from arto.core.errors import CaptureSetError, SceneError
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from scene_tools import captured, hdri, small_scene, smooth


@pytest.fixture
def scene(tmp_path):
    return small_scene(tmp_path)


def mapping_of(scene):
    return next(n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeMapping")


def counting(monkeypatch):
    made = []
    real = kept.bake

    def bake(*arguments):
        made.append(1)
        return real(*arguments)

    monkeypatch.setattr(kept, "bake", bake)
    return made


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.5, 4.0])
@pytest.mark.parametrize("strength", [1.0, 0.3])
def test_a_kept_world_lights_as_the_world_does(scene, monkeypatch, turn, strength):
    """What is turned and dimmed by numbers is what Cycles makes of it, patch by patch."""
    made = counting(monkeypatch)
    hdri(scene, smooth(128), rotation=0.4)
    kept.environment(scene, 256)
    mapping_of(scene).inputs["Rotation"].default_value[2] = turn
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = strength
    found = kept.environment(scene, 256)
    assert len(made) == 1  # of what it shows, once
    truth = bake_module.bake(scene, 256)
    cube = Hemicube(patches=4)
    ours, theirs = PatchLight(found, cube), PatchLight(truth, cube)
    np.testing.assert_allclose(ours.whole, theirs.whole, rtol=0.01, atol=0.002 * strength)
    directions = np.array([(1, 0, 0), (0, 1, 0.3), (-1, 0.2, -0.4), (0.5, -1, 1)])
    np.testing.assert_allclose(found.at(directions), truth.at(directions), rtol=0.03, atol=0.02)
    np.testing.assert_allclose(found.irradiance(), truth.irradiance(), rtol=1e-3)


CHANGES = {
    "tilted": lambda s: mapping_of(s).inputs["Rotation"].default_value.__setitem__(0, 0.2),
    "scaled": lambda s: mapping_of(s).inputs["Scale"].default_value.__setitem__(0, 2.0),
    "another node": lambda s: s.world.node_tree.nodes.new("ShaderNodeGamma"),
    "another picture": lambda s: hdri(s, smooth()[::-1]),
    "projection": lambda s: setattr(
        next(n for n in s.world.node_tree.nodes if "Environment" in n.bl_idname),
        "projection",
        "MIRROR_BALL",
    ),
    "colour space": lambda s: setattr(
        next(
            n for n in s.world.node_tree.nodes if "Environment" in n.bl_idname
        ).image.colorspace_settings,
        "name",
        "Linear Rec.2020",
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_another_world_is_made_anew(scene, monkeypatch, change):
    """Each map is asked for once, and is the one that was made of that world and width."""
    made = []

    def bake(_scene, width, *_):
        made.append(width)
        return Environment(np.full((width // 2, width, 3), len(made), np.float32))

    monkeypatch.setattr(kept, "bake", bake)
    hdri(scene, smooth())
    assert [kept.environment(scene, 64).image.max() for _ in range(2)] == [1, 1]
    CHANGES[change](scene)
    assert [kept.environment(scene, 64).image.max() for _ in range(2)] == [2, 2]
    assert [kept.environment(scene, 128).image.max() for _ in range(2)] == [3, 3]
    assert made == [64, 64, 128]


def test_a_world_that_is_bent_by_its_turn_is_made_anew(scene, monkeypatch):
    """Scaled along one axis, a turned world is another one."""
    made = counting(monkeypatch)
    hdri(scene, smooth())
    mapping_of(scene).inputs["Scale"].default_value = (2, 1, 1)
    kept.environment(scene, 64)
    mapping_of(scene).inputs["Rotation"].default_value[2] = 1.0
    found = kept.environment(scene, 64)
    assert len(made) == 2
    np.testing.assert_allclose(found.image, bake_module.bake(scene, 64).image, atol=1e-4)


def test_a_damaged_map_is_made_anew(scene):
    hdri(scene, smooth())
    whole = kept.environment(scene, 64).image
    (path,) = paths.worlds_folder(scene).glob("*.npy")
    for bad in (b"", b"no array", path.read_bytes()[:-50]):
        path.write_bytes(bad)
        np.testing.assert_array_equal(kept.environment(scene, 64).image, whole)


def test_the_oldest_maps_go(scene, monkeypatch):
    monkeypatch.setattr(kept, "MOST", 2)
    for value in (0.1, 0.2, 0.3):
        hdri(scene, np.full((16, 32, 3), value, np.float32))
        kept.environment(scene, 64)
    assert len(list(paths.worlds_folder(scene).glob("*.npy"))) == 2


def field_of(scene):
    captured(scene)
    work.run(fit.fit(scene))


def picture(path):
    return next(iter(exr.read(path).values()))


def test_a_turntable_is_so_many_relights(scene, monkeypatch):
    """And the world is brought to a map once for all of them."""
    made = counting(monkeypatch)
    hdri(scene, smooth(), rotation=0.3)
    field_of(scene)
    done = work.run(many.relight_many(scene, "ViewLayer", turns=4))
    assert [p.name for p in done] == [f"relit_{i:04d}.exr" for i in (1, 2, 3, 4)]
    assert len(made) == 1
    rotation = mapping_of(scene).inputs["Rotation"].default_value
    assert rotation[2] == pytest.approx(0.3)
    for i, path in enumerate(done):
        rotation[2] = 0.3 + i * math.pi / 2
        single, _ = work.run(relight.relight(scene))
        # opaque: Cycles' own world is behind it, with as many samples
        np.testing.assert_allclose(picture(path), picture(single), atol=2e-3)
    assert len({picture(p).tobytes() for p in done}) == 4


@pytest.mark.newest
def test_worlds_from_files(scene, tmp_path):
    rng = np.random.default_rng(0)
    field_of(scene)
    files = []
    for name in ("dawn", "dusk"):
        files.append(tmp_path / f"{name}.exr")
        exr.write(files[-1], {"": smooth() * rng.uniform(0.3, 1, 3).astype(np.float32)})
    before = {b.name for d in (bpy.data.worlds, bpy.data.images) for b in d}
    done = work.run(many.relight_many(scene, "ViewLayer", worlds=files))
    assert [p.name for p in done] == ["relit_dawn.exr", "relit_dusk.exr"]
    assert {b.name for d in (bpy.data.worlds, bpy.data.images) for b in d} == before
    for file, path in zip(files, done, strict=True):
        hdri(scene, exr.read(file)[""][..., :3])
        single, _ = work.run(relight.relight(scene))
        np.testing.assert_allclose(picture(path), picture(single), atol=2e-3)
    with pytest.raises(SceneError, match="there is no environment map"):
        work.run(many.relight_many(scene, "ViewLayer", worlds=[tmp_path / "none.exr"]))


def test_an_animated_world_over_a_still(scene):
    """A picture for each frame, of the one field; the scene is at its frame afterwards."""
    field_of(scene)
    strength = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    for frame, value in ((1, 0.5), (3, 1.5)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    for curve in (
        scene.world.node_tree.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    ):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    scene.frame_set(1)
    scene.render.film_transparent = True
    done = work.run(many.relight_many(scene, "ViewLayer", frames=range(1, 4)))
    assert scene.frame_current == 1
    light = [picture(p)[..., :3].mean() for p in done]
    np.testing.assert_allclose(np.array(light) / light[0], [1, 2, 3], rtol=1e-3)


def test_frames_are_a_sequence_in_the_compositor(scene):
    """The image is a sequence, and its node shows at each frame of the scene that frame's file."""
    captured(scene)
    work.run(fit.fit(scene))
    hdri(scene, smooth())
    strength = scene.world.node_tree.nodes["Background"].inputs["Strength"]
    for frame, value in ((5, 1.0), (7, 3.0)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    action = scene.world.node_tree.animation_data.action
    for curve in action.layers[0].strips[0].channelbags[0].fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    scene.frame_start, scene.frame_end = 5, 7
    scene.frame_set(5)
    scene.render.film_transparent = True
    assert bpy.ops.arto.relight_frames() == {"FINISHED"}
    image = bpy.data.images["ARTO Relit Frames"]
    assert image.source == "SEQUENCE" and image.filepath.endswith("relit_0005.exr")
    node = bpy.data.node_groups["ARTO Relit Frames"].nodes["ARTO Relit"]
    assert (node.frame_start, node.frame_duration, node.frame_offset) == (5, 3, 4)
    # what the compositor shows
    tree = compositor(scene)
    group = next(n for n in tree.nodes if n.label == "ARTO Relit Frames")
    out = next(n for n in tree.nodes if n.bl_idname == OUTPUT)
    tree.links.new(group.outputs["Image"], out.inputs[0])
    from arto.arto_addon.blender.output import float_exr

    shown = []
    folder = relit_file(scene).parent
    float_exr(scene.render, multilayer=False)
    scene.cycles.samples, scene.render.use_compositing = 1, True
    for frame in (5, 6, 7):
        scene.frame_set(frame)
        scene.render.filepath = str(folder / f"shown{frame}.exr")
        bpy.ops.render.render(write_still=True)
        shown.append(picture(folder / f"shown{frame}.exr")[..., :3].mean())
    np.testing.assert_allclose(np.array(shown) / shown[0], [1, 2, 3], rtol=1e-2)


@pytest.mark.newest
def test_an_animated_shot(scene):
    """A field for each frame, of the same patches; a frame without one is refused in words."""
    thing = scene.objects["Matt"]
    for frame, x in ((1, -1.3), (3, 0.7)):
        thing.location.x = x
        thing.keyframe_insert("location", frame=frame)
    scene.frame_set(2)
    scene.arto.keep, scene.arto.adaptive = "never", True
    folders = work.run(capture_frames(scene, "ViewLayer", range(1, 4)))
    assert scene.frame_current == 2
    from arto.core.field.field import Field

    fields = [Field(f.parent / "field") for f in folders]
    assert len({str(f.hemicube.to_json()) for f in fields}) == 1
    albedo = [f.layer("albedo") for f in fields]
    assert np.abs(albedo[0] - albedo[2]).mean() > 0.01
    hdri(scene, smooth())
    done = work.run(many.relight_many(scene, "ViewLayer", frames=range(1, 4)))
    assert [p.name for p in done] == [f"relit_{i:04d}.exr" for i in (1, 2, 3)]
    for frame, path in zip((1, 2, 3), done, strict=True):
        scene.frame_set(frame)
        single, _ = work.run(relight.relight(scene))
        np.testing.assert_array_equal(picture(path)[..., 3], picture(single)[..., 3])
        assert np.abs(picture(path) - picture(single)).mean() < 1e-3
    assert paths.frames(scene, "ViewLayer") == {1: True, 2: True, 3: True}
    for path in done:
        path.unlink()
    # as where the capture was killed in frame 4: frame 3 is not shown in its place
    with pytest.raises(CaptureSetError, match="frames 1, 2, 3 are captured, and 4 not"):
        work.run(many.relight_many(scene, "ViewLayer", frames=range(1, 5)))
    assert not any(path.exists() for path in done)
