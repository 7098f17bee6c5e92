"""Shadow catchers and what holds out: through a hole the footage is seen as it is."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon.relight import relight
from arto.arto_addon.world import kept
from arto.core import exr
from arto.core.light.light import PatchLight
from arto.core.preview import Preview
from scene_tools import captured, holding_out
from shot_tools import comp_by_cycles, cycles_catcher, relit_and_share, with_catcher

FOOTAGE = np.float32([0.3, 0.5, 0.8])


@pytest.mark.newest
@pytest.mark.parametrize("how", ["collection", "mixed"])
def test_footage_is_seen_through_a_hole(tmp_path, how):
    """As in Cycles' own picture, to within what two of its renders differ by; and by the live
    picture too."""
    scene = with_catcher(tmp_path, samples=128, patches=2)
    holding_out(scene, how)
    captured(scene)
    picture, share = relit_and_share(scene)
    one, two = (comp_by_cycles(scene, 256, seed, tmp_path, FOOTAGE) for seed in (1, 2))
    comp = picture[..., :3] + share * FOOTAGE
    noise = np.abs(one - two)
    assert np.abs(comp - one).mean() < 1.7 * noise.mean()
    assert np.abs(comp - one).max() < 2.5 * noise.max()
    assert abs((comp - one).mean()) < 0.003
    if how != "mixed":
        # the middle of the hole
        np.testing.assert_allclose(share[9:11, 4:7], 1, atol=1e-3)
        np.testing.assert_allclose(picture[9:11, 4:7], 0, atol=1e-3)
    # there is a shadow of it on the ground still
    assert share[13:, 1:9].min() < 0.9
    shown = relight.Shown(scene, scene.view_layers[0].name)
    light = PatchLight(kept.environment(scene, scene.arto.environment_width), shown.field.hemicube)
    live = Preview([take.field for take in shown.takes], holds_out=True).picture(light)
    np.testing.assert_allclose(live, picture, atol=2e-3)


def test_an_opaque_film_has_holes_and_shadows(tmp_path):
    """The world is behind, darkened by the shadow, and in the hole it is not. Cycles squares what
    is seen of it at outlines (5.2), so these are left out."""
    scene = with_catcher(tmp_path, samples=128, patches=2)
    holding_out(scene, "object")
    captured(scene)
    things = relit_and_share(scene)[0][..., :3]
    scene.render.film_transparent = False
    picture, share = relit_and_share(scene)
    one, two = (cycles_catcher(scene, 256, s, tmp_path, share=False) for s in (1, 2))
    hole = np.zeros(share.shape[:2], bool)
    hole[9:11, 4:7] = True
    np.testing.assert_allclose(picture[hole], 0, atol=1e-3)
    np.testing.assert_allclose(one[hole][:, :3], 0, atol=1e-3)
    whole = ~hole & ((things == 0).all(axis=-1)) & (picture[..., 3] > 0.999)
    assert whole.mean() > 0.4
    off, noise = np.abs(picture - one)[whole][:, :3], np.abs(one - two)[whole][:, :3]
    assert off.mean() < 2.5 * noise.mean() and off.max() < 4 * noise.max()
    assert picture[whole].mean() == pytest.approx(one[whole].mean(), rel=0.02)


def test_layers_have_no_more_than_the_plate_beside_a_hole(tmp_path):
    scene = with_catcher(tmp_path, samples=16, patches=1)
    holding_out(scene, "object")
    scene.arto.layers, scene.arto.layers_half = "FACES", False
    scene.render.film_transparent = False
    captured(scene)
    picture, _ = relit_and_share(scene)
    parts = exr.read(tmp_path / "relit_layers.exr")
    parts.pop("")
    np.testing.assert_allclose(sum(parts.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    assert all((part >= 0).all() for part in parts.values())
    assert (parts["LG_behind"][9:11, 4:7] < 1e-3).all()
