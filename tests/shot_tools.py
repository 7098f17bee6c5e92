"""Shots of small scenes from capture to plate, with catchers and footage, for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender.output import float_exr
from arto.arto_addon.farm.job import Job
from arto.arto_addon.farm.plan import plan
from arto.arto_addon.fit import fit
from arto.arto_addon.plate import plate
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.arto_addon.stage.stage import stage
from arto.core import exr
from arto.core.field.field import Field
from arto.core.field.tile_file import TileFile
from scene_tools import captured, hdri, small_scene, smooth


def run_all(scene):
    captured(scene)
    work.run(fit.fit(scene))
    return relit(scene)


def relit(scene):
    path, _ = work.run(relight.relight(scene))
    return exr.read(path)[""]


def unfinished(scene):
    """The folders of captures of the scene's shot that were stopped."""
    return sorted(paths.place(scene).folder.glob("unfinished-*"))


def with_catcher(tmp_path, samples=256, patches=4):
    scene = small_scene(tmp_path)
    scene.objects["Floor"].is_shadow_catcher = True
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patches, scene.arto.keep = samples, patches, "never"
    hdri(scene, smooth())
    return scene


def relit_and_share(scene) -> tuple[np.ndarray, np.ndarray]:
    """The plate (H, W, 4), and how much is seen of what is behind it (H, W, 3)."""
    path, _ = work.run(relight.relight(scene))
    return exr.read(path)[""], exr.read(plate.share_file(path))[""]


def footage_of(scene, tmp_path, colour=(0.25, 0.5, 0.75)):
    """An 8-bit picture behind the camera, of the picture's size."""
    image = bpy.data.images.new("Filmed", 24, 18)
    image.pixels.foreach_set(np.tile(np.float32([*colour, 1]), 24 * 18))
    image.filepath_raw, image.file_format = str(tmp_path / "filmed.png"), "PNG"
    image.save()
    image = bpy.data.images.load(str(tmp_path / "filmed.png"))
    camera = scene.camera.data
    camera.show_background_images = True
    camera.background_images.new().image = image
    return image


def planned_job(
    scene: bpy.types.Scene,
    folder: Path,
    frames: Sequence[int] | None = (1,),
    tiles: int = 2,
    seeds: int = 1,
) -> Job:
    """A farm's job of a scene that was saved."""
    work.run(plan(scene, scene.view_layers[0].name, folder, frames, tiles, seeds))
    return Job(folder)


def arrays(folder: Path) -> dict[str, np.ndarray]:
    """All that a field has, or several, by the names of its files and of their arrays."""
    found = {p: TileFile(p) for p in sorted(folder.rglob("*.arto"))}
    return {
        str(p.relative_to(folder) / name): tile.load(name).copy()
        for p, tile in found.items()
        for name in tile.sizes
    }


def assert_same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    """Bit for bit."""
    assert one.keys() == other.keys() and one
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


def catcher_passes(scene, samples, seed, tmp_path, share=True) -> dict[str, np.ndarray]:
    """What Cycles renders with its own catcher, by pass; share: with its Shadow Catcher pass."""
    with stage(scene, scene.view_layers[0].name) as on:
        float_exr(on.scene.render)
        on.scene.view_layers[0].cycles.use_pass_shadow_catcher = share
        cycles = on.scene.cycles
        cycles.samples, cycles.seed, cycles.sample_clamp_indirect = samples, seed, 0
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        on.scene.render.filepath = str(tmp_path / "catcher.exr")
        request = work.Render(on.scene.name, 0, "")
        work.blocking_render(request)
        request.check()
    return {name.split(".")[-1]: p for name, p in exr.read(tmp_path / "catcher.exr").items()}


def cycles_catcher(scene, samples, seed, tmp_path, share=True) -> np.ndarray:
    """Of these -> (H, W, 3), the Shadow Catcher pass; or else (H, W, 4), its plate, which has the
    shadows where there is no such pass."""
    passes = catcher_passes(scene, samples, seed, tmp_path, share)
    return passes["Shadow Catcher"][..., :3] if share else passes["Combined"]


def comp_by_cycles(scene, samples, seed, tmp_path, footage) -> np.ndarray:
    """The things in footage, (H, W, 3), as that pass is used: the footage times it where the things
    leave it to be seen."""
    passes = catcher_passes(scene, samples, seed, tmp_path)
    things, share = passes["Combined"], passes["Shadow Catcher"][..., :3]
    return things[..., :3] + (1 - things[..., 3:]) * share * footage


def bare_of(scene) -> np.ndarray:
    """Where nothing stands before the ground."""
    return Field(paths.field_folder(scene).parent / "things" / "field").layer("alpha") == 0


def relit_layers(scene):
    """The plate, and its layers by name."""
    path, _ = work.run(relight.relight(scene))
    found = exr.read(plate.layers_file(path))
    np.testing.assert_array_equal(found.pop(""), exr.read(path)[""])
    return exr.read(path)[""], found


def group_at(scene, name, azimuth, elevation, radius):
    group = scene.arto.groups.add()
    group.name, group.azimuth, group.elevation = name, azimuth, elevation
    group.radius = radius
    return group
