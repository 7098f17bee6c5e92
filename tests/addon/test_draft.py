"""The draft of a capture: a picture at once, which is no plate, and goes when all is there."""

from __future__ import annotations

import time
from collections.abc import Callable

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import draft
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.live import live
from arto.arto_addon.live.growing import enlarged
from arto.arto_addon.live.image import IMAGE, put_away
from arto.arto_addon.relight import inside
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.shot import paths, status
from arto.core.errors import FieldError
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.relight import relight
from scene_tools import hdri, small_scene, smooth
from shot_tools import arrays, assert_same

from bench.heavy import counted


@pytest.fixture
def scene(tmp_path, monkeypatch) -> bpy.types.Scene:
    monkeypatch.setattr(draft, "WORTH", 0)
    scene = small_scene(tmp_path, lamp=True)
    scene.arto.keep, scene.arto.patterns, scene.arto.support = "never", "linear", "auto"
    scene.arto.samples, scene.arto.grain, scene.arto.live_finish = 48, False, False
    scene.arto.environment_width = 128
    hdri(scene, smooth(16))
    return scene


def picture(field: Field) -> np.ndarray:
    return relight(field, PatchLight(Environment(smooth(32)), field.hemicube))


def run(scene: bpy.types.Scene, moments: dict[str, Callable[[], None]], shows: bool = True) -> None:
    """Capture, and do something once before the first step that says a text."""
    left = dict(moments)

    def say(step: work.Progress | work.Render) -> None:
        for text in [text for text in left if text in step.text]:
            left.pop(text)()

    work.run(capture(scene, "ViewLayer", shows=shows), say)
    assert not left


def test_a_draft_is_the_picture_in_small_and_changes_no_bit_of_the_capture(scene) -> None:
    scene.arto.far = False  # what is made of the look at the scene is in test_prepared
    place = paths.place(scene).folder
    seen: list[np.ndarray] = []

    def look() -> None:
        there = status.draft_of(place)
        assert there and there.about.draft
        seen.append(picture(Field(there.folder)))
        with pytest.raises(FieldError, match=r"no reflectance field|not complete"):
            work.run(compute(scene, "ViewLayer"))

    with counted() as count:
        run(scene, {"render 1 of": look})
    whole = picture(Field(place / "field"))
    assert [small.shape[:2] for small in seen] == [(9, 12)]
    for small in seen:
        large = enlarged(small, whole.shape[:2])
        assert abs(large[..., :3].mean() / whole[..., :3].mean() - 1) < 0.1
    assert not paths.draft_folder(place).exists()

    # the draft is the first render of what is prepared for the tiles
    assert (count.prepared_times, count.renders) == (1, 2)
    kept = arrays(place / "field")
    run(scene, {}, shows=False)
    assert_same(kept, arrays(place / "field"))


def shown(on: live.Live) -> np.ndarray:
    """Tick until the picture of full size is shown -> it, top-down."""
    end = time.monotonic() + 60
    on._source._looked = 0.0
    while True:
        on.dirty = True
        assert on.tick() and not on.trouble, on.trouble
        if on.settled:
            break
        assert time.monotonic() < end, on.line
        time.sleep(0.02)
    image = bpy.data.images[IMAGE]
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1].copy()


def test_live_shows_the_draft_then_the_tiles_then_the_field(scene) -> None:
    scene.render.resolution_y, scene.arto.memory, scene.arto.far = 72, 1, False  # several tiles
    scene.arto.samples = 4
    place = paths.place(scene).folder
    on: list[live.Live] = []
    found: list[tuple[np.ndarray, str]] = []

    def look() -> None:
        on[:] = on or [live.Live(scene)]
        found.append((shown(on[0]), on[0].line))

    def look_inside() -> None:
        look()
        # the lowest pixel of the shot, which is larger than its draft
        assert inside.look(scene, 23, 71).lines[0].startswith("Pixel 23, 71")

    try:
        run(scene, {"render 1 of": look_inside, "render 7 of": look})
        look()
    finally:
        for each in on:
            each.close()
            put_away(each.name)
    (first, said), (second, then), (whole, line) = found
    assert first.shape == second.shape == whole.shape == (72, 24, 4)
    assert said.startswith("From a draft of 8 x 22") and line.startswith("Whole")
    assert "tiles are there" in then and said != then
    assert not paths.draft_folder(place).exists()
    # the first tiles are there to the bit, and below them is the draft
    rows = Field(place / "field").tiles[5].region.y
    np.testing.assert_array_equal(second[:rows], whole[:rows])
    assert not np.array_equal(first[:rows], whole[:rows])
    assert not np.array_equal(second[rows:], whole[rows:])
    assert abs(first[..., :3].mean() / whole[..., :3].mean() - 1) < 0.15
