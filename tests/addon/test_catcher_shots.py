"""Shadow catchers in shots as artists have them: what Cycles makes of each is the truth."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon.shot import paths
from arto.core.field.field import Field
from scene_tools import captured
from shot_tools import comp_by_cycles, relit_and_share, with_catcher

FOOTAGE = np.float32([0.3, 0.5, 0.8])


def assert_in_footage_as_by_cycles(scene, tmp_path, samples=256):
    """The comp is off by no more than two renders are from each other and a little, on the mean
    over all of the picture by next to nothing. -> (how much of the footage is seen, the comp)."""
    picture, share = relit_and_share(scene)
    one, two = (comp_by_cycles(scene, samples, seed, tmp_path, FOOTAGE) for seed in (1, 2))
    comp = picture[..., :3] + share * FOOTAGE
    noise = np.abs(one - two).mean()
    assert np.abs(comp - one).mean() < 2 * noise
    assert abs((comp - one).mean()) < 0.003
    return share, comp


@pytest.mark.newest
@pytest.mark.parametrize("flag", ["visible_shadow", "visible_diffuse"])
def test_a_thing_that_some_rays_pass(tmp_path, flag):
    """A world's light comes by shadow rays and by others, in part each: the shadow of what one of
    them passes is lighter, not gone. It was too dark by 0.1, and too light."""
    scene = with_catcher(tmp_path, samples=192, patches=2)
    setattr(scene.objects["Matt"], flag, False)
    captured(scene)
    assert Field(paths.field_folder(scene)).about.route == "sampled"
    share, _ = assert_in_footage_as_by_cycles(scene, tmp_path)
    assert share[14:].min() < 0.95
