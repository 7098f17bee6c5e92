"""The probe: patches where the scene needs them, and the same light as with any others."""

from __future__ import annotations

import pytest
from arto.arto_addon import work
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.core import exr
from arto.core.errors import HemicubeError
from scene_tools import assert_as_cycles, captured, differences, set_colour, small_scene, snapshot


def adaptive(folder):
    scene = small_scene(folder)
    scene.render.film_transparent = True
    scene.arto.adaptive, scene.arto.patches = True, 4
    scene.arto.patterns, scene.arto.grain = "linear", False
    return scene


@pytest.mark.newest
def test_patches_of_many_sizes_light_the_scene_as_cycles_does(tmp_path):
    """The floor is opaque: of the light from below little arrives, and few patches stay there.
    Under white light the plate is Cycles' picture, with the noise of its paths."""
    scene = adaptive(tmp_path)
    before = snapshot()
    there = captured(scene)
    assert not differences(before, snapshot())
    cube = there.hemicube
    assert cube.closed and 6 < len(cube) <= 192
    count = {f: sum(face == f for face, _, _, _ in cube.leaves) for f in cube.faces}
    assert count["top"] > 4 * count["bottom"]
    work.run(fit.fit(scene))
    set_colour(scene, (1, 1, 1))
    path, _ = work.run(relight.relight(scene))
    assert_as_cycles(exr.read(path)[""], scene, 64, tmp_path)


@pytest.mark.newest
def test_going_on_does_not_probe_again(tmp_path):
    scene = adaptive(tmp_path)
    scene.arto.samples, scene.arto.memory = 4, 16
    scene.render.resolution_x, scene.render.resolution_y = 80, 60
    steps = capture.capture(scene, scene.view_layers[0].name)
    texts = []
    for step in steps:
        if isinstance(step, work.Render):
            texts.append(step.text)
            if texts.count(step.text) == 1 and step.text.startswith("render 2 of "):
                break
            work.blocking_render(step)
    steps.close()
    assert [t for t in texts if "looking at" in t]
    again = []
    work.run(capture.capture(scene, scene.view_layers[0].name), again.append)
    assert not [s for s in again if "looking at" in s.text]


def test_half_sides_cannot_be_refined_and_the_paper_does_not_try(tmp_path):
    scene = adaptive(tmp_path)
    scene.arto.half_sides = True
    steps = capture.capture(scene, scene.view_layers[0].name)
    with pytest.raises(HemicubeError, match="turn Adaptive Patches off"):
        next(steps)  # before anything is rendered
    scene.arto.preset = "paper"
    assert not scene.arto.adaptive
