"""The one button: capture, fit and relight; and Live before there is a capture."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon import shoot, work
from arto.arto_addon.live import live
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight.light_key import HEADER, light_key
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.shot import paths
from arto.core import exr
from arto.core.errors import ArtoError
from scene_tools import set_colour, small_scene


def test_without_a_capture_it_says_so(tmp_path) -> None:
    scene = small_scene(tmp_path)
    with pytest.raises(ArtoError, match="no reflectance field"):
        live.Live(scene)


def test_one_button(tmp_path) -> None:
    """Capture, fit and relight in one: the plate is that of the three by themselves, the shares of
    the work only rise, and its key says that it is of this light."""
    scene = small_scene(tmp_path)
    scene.arto.keep, scene.arto.support, scene.arto.samples = "never", "auto", 16
    scene.arto.grain, scene.arto.patterns = False, "linear"
    set_colour(scene, (0.5, 0.4, 0.3))
    shares = []
    path = work.run(shoot.shoot(scene), lambda step: shares.append(step.share))
    assert path == relit_file(scene) and path.is_file()
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert exr.header(path)[HEADER] == light_key(scene, scene.world)
    one = next(iter(exr.read(path).values()))
    work.run(compute(scene, scene.view_layers[0].name))
    np.testing.assert_array_equal(next(iter(exr.read(path).values())), one)
    scene.world.arto.strength = 2.0
    assert exr.header(path)[HEADER] != light_key(scene, scene.world)


def test_one_button_without_a_world(tmp_path) -> None:
    scene = small_scene(tmp_path)
    scene.arto.samples, scene.world = 4, None
    texts = []
    assert work.run(shoot.shoot(scene), lambda s: texts.append(s.text)) is None
    assert "add a world" in texts[-1]
    assert (paths.field_folder(scene) / "field.json").is_file()
