"""Packed patterns and lobes in Blender: the same light as grey patterns show, in fewer layers."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon.capture import planes, planned
from arto.core.capture.kinds import Route
from arto.core.errors import SceneError
from arto.core.measure import uniform_moments
from arto.core.patterns import ONE, UU, VV, U, V, pattern_set
from scene_tools import captured, material, small_scene


def shot(folder, patterns: str, **settings):
    scene = small_scene(folder)
    scene.arto.samples, scene.arto.patterns, scene.arto.patches = 16, patterns, 2
    scene.arto.adaptive, scene.arto.grain = False, False
    for name, value in settings.items():
        setattr(scene.arto, name, value)
    there = captured(scene)
    return there, there.read(0)


@pytest.fixture(scope="module")
def grey(tmp_path_factory):
    return shot(tmp_path_factory.mktemp("grey"), "moments_uv")


def test_packed_moments_are_those_of_grey_patterns(grey, tmp_path) -> None:
    """Where light of one colour comes: the scene is lit by white patches, so by the surface."""
    there, data = grey
    packed_there, packed = shot(tmp_path, "packed")
    assert np.abs(packed.own).max() == 0
    np.testing.assert_allclose(packed.basis[:, 0], data.basis[:, 0], rtol=1e-4, atol=1e-6)
    for k in range(len(there.hemicube)):
        even = uniform_moments(there.hemicube.extent(k))
        for m, channel in ((U, 0), (UU, 0), (V, 1), (VV, 1)):
            name = there.patterns.patterns[m]
            expected = data.basis[k][there.patterns.patterns.index(name)][..., channel]
            p, c = packed_there.patterns.places[packed_there.patterns.told.index(m)]
            assert c == channel
            np.testing.assert_allclose(packed.basis[k, p, ..., c], expected, rtol=1e-3, atol=1e-5)
        found = packed_there.patterns.shared(packed.basis[k].reshape(3, -1, 3), even)
        assert np.isfinite(found).all() and (found[ONE] >= 0).all()
    assert packed.grain is not None and np.nanmax(np.abs(packed.grain)) > 0


@pytest.mark.parametrize("route", ["all", "pattern"])
def test_lobes_add_up_to_all_light(grey, tmp_path, route: str) -> None:
    """Every path sees the planes of one lobe: none is lost, and none is counted twice."""
    _, data = grey
    there, lobes = shot(tmp_path, "lobes", route=route)
    assert there.patterns == pattern_set("lobes")
    assert np.abs(lobes.own).max() == 0
    total = np.stack([lobes.coefficient(k, there.patterns) for k in range(len(there.hemicube))])
    np.testing.assert_allclose(total, data.basis[:, 0], rtol=1e-3, atol=1e-5)
    base, sharp = (lobes.basis[:, p].sum(axis=(0, -1)) for p in there.patterns.shown_by)
    assert base.max() > 0
    if route == "all":
        assert lobes.together
    # what is not lit by one lobe is by the other
    lit = data.basis[:, 0].sum(axis=(0, -1)) > 0
    assert ((base + sharp)[lit] > 0).all()


def test_all_patterns_see_the_same_paths_with_the_same_weights(grey) -> None:
    """Also where a surface is dark and Russian roulette ends most paths: no variance is below 0."""
    there, data = grey
    at = there.patterns.patterns.index
    for mean, square in (("u", "u2"), ("v", "v2")):
        white, first, second = (data.basis[:, at(n)] for n in ("white", mean, square))
        lit = white > 1e-4 * white.max()
        variance = second[lit] / white[lit] - (first[lit] / white[lit]) ** 2
        assert lit.sum() > 1000
        assert variance.min() > -1e-4


def test_lobes_are_refused_where_light_comes_by_shadow_rays_alone(tmp_path, monkeypatch):
    scene = small_scene(tmp_path)
    scene.arto.patterns = "lobes"

    def by_shadow_rays(*_: object):
        yield from ()
        return Route.SAMPLED, None, None

    monkeypatch.setattr(planned, "looked_at", by_shadow_rays)
    with pytest.raises(SceneError, match="choose the patterns '1, u, v'"):
        captured(scene)
    # left to the capture, they are those; and what is sampled must not be faint
    scene.arto.patterns, scene.arto.samples = "auto", 2
    head = captured(scene).head
    assert head.patterns.name == "linear" and head.route == Route.SAMPLED
    assert head.radiance is None


def test_faint_patches_are_the_same_light_and_none_in_the_guides(tmp_path, monkeypatch) -> None:
    """A mirror shows the patches, and their colours were in the albedo that guides the denoiser."""
    found = []
    for name, radiance in (("bright", 1.0), ("faint", planes.FAINT)):
        monkeypatch.setattr(planes, "FAINT", radiance)
        scene = small_scene(tmp_path / name)
        for thing in scene.objects:
            if thing.type == "MESH":
                thing.data.materials.clear()
                thing.data.materials.append(material("Mirror", Metallic=1.0, Roughness=0.0))
        scene.arto.samples, scene.arto.patches, scene.arto.adaptive = 4, 1, False
        found.append(captured(scene).read(0))
    bright, faint = found
    assert bright.basis.max() > 0.1
    np.testing.assert_array_equal(faint.basis, bright.basis)
    np.testing.assert_array_equal(faint.own, bright.own)
    # what leaves the scene has no albedo but the light it shows
    assert bright.guides["albedo"].max() > 1.5
    assert faint.guides["albedo"].max() < 1.001
