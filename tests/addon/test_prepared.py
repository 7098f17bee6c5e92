"""Cycles prepares the scene once for the looks of a capture, and once for all its tiles."""

from __future__ import annotations

import numpy as np
from arto.arto_addon import work
from arto.arto_addon.capture import draft, planned
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.shot import paths, status
from arto.arto_addon.stage.stage import Stage
from arto.core import exr
from arto.core.capture.capture_set import CaptureSet
from scene_tools import captured, small_scene

from bench.heavy import counted


def layers(taken: CaptureSet) -> list[np.ndarray]:
    """All layers of all tiles."""
    names = [taken.folder / name for tile in taken.head.tiles for name in tile.files]
    return [np.array(pixels) for name in names for pixels in exr.read(name).values()]


def first_render(scene) -> str:
    """What a capture renders first, which is not rendered."""
    steps = capture(scene, scene.view_layers[0].name)
    text = next(step.text for step in steps if isinstance(step, work.Render))
    steps.close()
    return text


def test_a_capture_in_tiles_is_prepared_twice_and_is_the_same_to_the_bit(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    scene.arto.memory, scene.arto.samples, scene.arto.adaptive = 1, 48, True
    monkeypatch.setattr(draft, "WORTH", 0)
    place, drafts = paths.place(scene).folder, []

    def say(step: work.Progress | work.Render) -> None:
        if step.text.startswith("a draft of") and step.text.endswith("is there"):
            drafts.append(status.draft_of(place))

    with counted() as kept:
        there = CaptureSet(work.run(capture(scene, "ViewLayer", shows=True), say))
    kept_layers, patches = layers(there), there.head.hemicube
    assert kept.renders >= 3 + 1 + 2  # a look at the patches, two at white, a draft, the tiles
    assert kept.prepared_times == 2
    # the first draft is of the look, by the finest patches
    assert [len(found.hemicube) == len(patches) for found in drafts] == [False, True]
    assert drafts[0].shape == (36, 48)

    # With other samples the scene is the same, and is not looked at again.
    scene.arto.samples = 50
    with counted() as again:
        assert captured(scene).head.hemicube == patches
    assert again.renders == kept.renders - 3 - 1 and again.prepared_times == 1
    scene.arto.samples = 48
    scene.objects["Matt"].location.x += 0.1
    assert first_render(scene).startswith("looking at")
    scene.objects["Matt"].location.x -= 0.1

    monkeypatch.setattr(Stage, "keep_prepared", lambda _: None)
    scene.arto.folder = str(tmp_path / "anew")
    with counted() as anew:
        layers_anew = layers(captured(scene))
    assert anew.prepared_times == anew.renders == kept.renders - 1
    for one, other in zip(kept_layers, layers_anew, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_scene_that_finds_no_room_is_prepared_for_each_tile_with_a_word(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    scene.arto.memory, scene.arto.samples, scene.arto.far = 1, 1, False
    scene.render.resolution_y = 72
    monkeypatch.setattr(planned.room, "lacks_memory", lambda _: True)
    said: list[str] = []
    with counted() as count:
        work.run(capture(scene, scene.view_layers[0].name), lambda step: said.append(step.text))
    assert count.prepared_times == count.renders > 1
    assert any("memory is short" in text for text in said)
