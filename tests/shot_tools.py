"""Shots of small scenes from capture to plate, with catchers and footage, for tests."""

from __future__ import annotations

import bpy
import numpy as np
from arto.arto_addon import fit, work
from arto.arto_addon.relight import plate, relight
from arto.arto_addon.shot import paths
from arto.core import exr
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
