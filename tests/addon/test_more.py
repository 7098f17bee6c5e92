"""More samples for a capture that is there: as one stretch more of its sequence."""

from __future__ import annotations

import shutil

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture.more import more_samples
from arto.arto_addon.fit import fit
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.shot import paths
from arto.arto_addon.ui import result_panel
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import CancelledError, CaptureSetError
from arto.core.field.field import Field
from scene_tools import captured, hdri, small_scene, smooth
from shot_tools import arrays, assert_same


@pytest.fixture
def scene(tmp_path) -> bpy.types.Scene:
    scene = small_scene(tmp_path)
    scene.arto.samples, scene.arto.patterns, scene.arto.support = 8, "linear", "linear"
    scene.arto.far, scene.arto.environment_width = False, 64
    hdri(scene, smooth(16))
    return scene


def basis(captured: CaptureSet) -> np.ndarray:
    """All basis images, tile below tile, (K, P, H, W, 3)."""
    tiles = range(len(captured.regions))
    return np.concatenate([captured.read(t).basis for t in tiles], axis=2)


def add(scene: bpy.types.Scene, samples: int) -> CaptureSet:
    work.run(more_samples(scene, "ViewLayer", samples))
    return CaptureSet(paths.place(scene).folder / "capture")


def test_samples_are_added_and_the_field_and_the_plate_know_it(scene, tmp_path) -> None:
    first = captured(scene)
    work.run(fit.fit(scene))
    place = paths.place(scene).folder
    before, key = basis(first), first.head.key
    work.run(compute(scene, "ViewLayer"))
    assert result_panel._plate_line(scene)[1]
    shutil.copytree(place, tmp_path / "copy")

    there = add(scene, 24)
    after = basis(there)
    assert there.head.samples == 32 and there.head.key != key
    assert [seed.samples for seed in there.head.tiles[0].seeds] == [8, 24]
    about = Field(place / "field").about
    assert about.samples == 32 and about.key == there.head.key
    assert not result_panel._plate_line(scene)[1] and relit_file(scene).is_file()

    # weighted by their samples: the error falls as with as many samples at once
    scene.arto.samples, scene.arto.folder = 256, str(tmp_path / "many")
    many = basis(captured(scene))
    scene.arto.samples, scene.arto.folder = 8, str(tmp_path / "arto")
    error, was = (np.sqrt(np.mean((found - many) ** 2)) for found in (after, before))
    assert error < 0.65 * was

    # the same again is the same to the bit
    kept = arrays(place / "field")
    shutil.rmtree(place)
    shutil.copytree(tmp_path / "copy", place)
    add(scene, 24)
    assert_same(kept, arrays(place / "field"))


def test_stopped_in_the_middle_it_leaves_all_as_it_was_and_goes_on(scene) -> None:
    scene.arto.memory, scene.render.resolution_y = 1, 36
    first = captured(scene)
    work.run(fit.fit(scene))
    tiles, place = len(first.regions), paths.place(scene).folder
    assert tiles > 1
    renders: list[str] = []

    def one(step: work.Progress | work.Render) -> None:
        if isinstance(step, work.Render):
            renders.append(step.text)
            if len(renders) == tiles:
                raise CancelledError("stopped")

    with pytest.raises(CancelledError):
        work.run(more_samples(scene, "ViewLayer", 8), one)
    assert CaptureSet(place / "capture").head == first.head
    assert Field(place / "field").about.samples == 8
    # one was not rendered when it was stopped, and that one alone is rendered now
    renders.clear()
    work.run(
        more_samples(scene, "ViewLayer", 8),
        lambda step: renders.append(step.text) if isinstance(step, work.Render) else None,
    )
    assert len(renders) == 1
    assert CaptureSet(place / "capture").head.samples == 16
    named = {name for tile in CaptureSet(place / "capture").head.tiles for name in tile.files}
    assert named == {p.name for p in (place / "capture").glob("*.exr")}


def test_what_cannot_have_more_is_refused_with_what_to_do(scene) -> None:
    with pytest.raises(CaptureSetError, match="run Capture first"):
        add(scene, 8)
    first = captured(scene)
    scene.objects["Matt"].location.x += 0.1
    with pytest.raises(CaptureSetError, match="not as it was captured"):
        add(scene, 8)
    scene.objects["Matt"].location.x -= 0.1
    scene.arto.patterns = "moments"
    with pytest.raises(CaptureSetError, match="the patterns"):
        add(scene, 8)
    assert CaptureSet(first.folder).head == first.head
    scene.arto.keep, scene.arto.patterns = "never", "linear"
    captured(scene)
    with pytest.raises(CaptureSetError, match="not kept"):
        add(scene, 8)
