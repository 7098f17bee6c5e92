"""What the tests in Blender as a module share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import arto
import bpy
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture.capture import capture
from scene_tools import captured, hdri, small_scene, smooth


@pytest.fixture(scope="session", autouse=True)
def registered() -> Iterator[None]:
    # tests of `bench` may have come before: they register it too, and leave it
    if not hasattr(bpy.types.Scene, "arto"):
        arto.register()
    yield
    arto.unregister()


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    return small_scene(tmp_path)


@pytest.fixture
def farm_scene(tmp_path: Path) -> bpy.types.Scene:
    """A saved scene, as a farm's machines open it."""
    scene = small_scene(tmp_path)
    scene.arto.keep, scene.arto.patterns, scene.arto.samples = "never", "linear", 16
    scene.arto.adaptive, scene.arto.patches = True, 2
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return scene


@pytest.fixture(scope="session")
def noise(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Any]:
    """Basis images of the small scene by route and seed, each captured once a session."""
    kept: dict[tuple[str, int], Any] = {}

    def get(route: str, seed: int) -> Any:
        if (route, seed) not in kept:
            made = small_scene(tmp_path_factory.mktemp("route"))
            made.arto.route, made.arto.seed = route, seed
            kept[route, seed] = captured(made).read(0)
        return kept[route, seed]

    return get


@pytest.fixture
def lit(tmp_path):
    scene = small_scene(tmp_path, lamp=True)
    scene.render.film_transparent = True
    scene.arto.samples, scene.arto.patches, scene.arto.keep = 32, 2, "never"
    scene.arto.layers, scene.arto.layers_half = "FACES", False
    hdri(scene, smooth())
    captured(scene)
    return scene


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> bpy.types.Scene:
    """A captured shot of few samples; each test leaves the settings as it found them."""
    folder = tmp_path_factory.mktemp("shot")
    scene = small_scene(folder)
    scene.arto.output = str(folder / "plates" / "shot_relit.exr")
    scene.arto.samples, scene.arto.patches, scene.arto.adaptive = 4, 1, False
    scene.arto.keep, scene.arto.denoise, scene.arto.environment_width = "never", False, 64
    scene.arto.far, scene.arto.size = False, 20  # the light of a near hemicube is not checked
    hdri(scene, smooth(16))
    work.run(capture(scene, scene.view_layers[0].name))
    return scene
