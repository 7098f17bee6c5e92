"""Finish and Verify: samples of the truth are kept, go on, and mend a plate where it is off."""

import numpy as np
import pytest
from arto.arto_addon import shoot, work
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import samples
from arto.arto_addon.relight.finished import SAMPLES, finish_plate, finished_file
from arto.arto_addon.relight.verify import verify_plate
from arto.core import exr
from arto.core.errors import SceneError
from scene_tools import set_colour, small_scene


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    scene = small_scene(tmp_path_factory.mktemp("finished"), lamp=True)
    scene.arto.keep, scene.arto.samples = "never", 32
    set_colour(scene, (0.5, 0.4, 0.3))
    work.run(shoot.shoot(scene))
    return scene


def _read(path) -> np.ndarray:
    return next(iter(exr.read(path).values()))


def _truth(scene) -> np.ndarray:
    """A render of many samples, by other seeds than those of the work."""
    with samples.truth(scene, scene.view_layers[0].name) as on:
        return work.run(samples.render(on, 77, 0, 512, 0.0, 1.0)).mean


def _error(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(np.abs(picture - truth)[..., :3].mean() / truth[..., :3].mean())


def test_samples_go_on_and_mend_what_is_off(ready) -> None:
    path = relit_file(ready)
    work.run(verify_plate(ready))
    before = _read(samples.samples_file(path))
    path_verified = work.run(verify_plate(ready))
    assert exr.header(path_verified)["arto.samples"] == "2 x 32"  # the second look has both

    # a plate that is too bright in its right half, as if the scene had other light there
    good, header = _read(path), exr.header(path)
    bad = good.copy()
    half = bad.shape[1] // 2
    bad[:, half:, :3] *= 1.5
    kept = {k: v for k, v in header.items() if k.startswith("arto.")}
    exr.write(path, {"": bad}, kept)
    ready.arto.finish_samples = 192
    out = work.run(finish_plate(ready))
    assert out == finished_file(path) and exr.header(out)[SAMPLES] == "192"
    there = _read(samples.samples_file(path))
    assert not np.array_equal(before, there)
    truth, found = _truth(ready), _read(out)
    inside = slice(half + 4, None)
    assert _error(bad[:, inside], truth[:, inside]) > 0.3
    assert _error(found[:, inside], truth[:, inside]) < 0.05
    # where the plate is right, the picture is no worse than it
    left = slice(0, half - 8)
    assert _error(found[:, left], truth[:, left]) <= 1.1 * _error(good[:, left], truth[:, left])

    # at the number it stops at there is nothing to render, and the picture is the same
    again = _read(work.run(finish_plate(ready)))
    np.testing.assert_allclose(again, found, atol=1e-3)

    # of another light the samples do not count
    ready.world.arto.strength = 2.0
    assert samples.kept(path, samples.key_now(ready, ready.view_layers[0].name)) is None
    with pytest.raises(SceneError, match="press Relight first"):
        work.run(finish_plate(ready))
    ready.world.arto.strength = 1.0
    ready.arto.own_lamps = 0.5
    with pytest.raises(SceneError, match="press Relight first"):
        work.run(finish_plate(ready))
    ready.arto.own_lamps = 1.0
