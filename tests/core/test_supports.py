"""What every support model must hold to, whatever its shape."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import MONOMIALS, pattern_set
from arto.core.supports import BY_CODE, SUPPORTS, Support

MODELS = list(BY_CODE.values())
ALL = pattern_set("moments_uv")


@pytest.fixture(scope="module")
def moments(hits) -> Moments:
    """Of points, pairs and clouds of them; the last pixel sees no light."""
    rng = np.random.default_rng(0)
    u, v = rng.random((2, 30, 200))
    weights = rng.exponential(size=(30, 200, 3))
    weights[1:, :30] = 0
    weights[2:, 30:60] = 0
    weights[:, -1] = 0
    u[:, 60:80] = rng.choice([0.0, 1.0], (30, 20))
    return Moments.from_basis(hits(ALL, u, v, weights), ALL, Hemicube(patches=2).extent(0), True)


@pytest.mark.parametrize("support", MODELS, ids=lambda s: s.name)
def test_parameters_fit_the_files(moments: Moments, support: Support) -> None:
    """In [0, 1], as many as have names; and the moments that they need exist."""
    parameters = support.fit(moments)
    assert parameters.shape == (200, len(support.parameters))
    assert len(set(support.parameters)) == len(support.parameters)
    assert ((parameters >= 0) & (parameters <= 1)).all()
    assert all(0 <= m < len(MONOMIALS) for m in support.needs)


@pytest.mark.parametrize("support", MODELS, ids=lambda s: s.name)
def test_uniform_light_stays_uniform(moments: Moments, support: Support) -> None:
    colour = np.array([0.25, 3.0, 700.0])
    image = np.tile(colour.astype(np.float32), (32, 64, 1))
    light = PatchLight(Environment(image), Hemicube(patches=2))
    for k in (0, 9, 23):
        found = support.average(light, k, support.fit(moments))
        np.testing.assert_allclose(found, np.tile(colour, (200, 1)), rtol=1e-5)


@pytest.mark.parametrize("support", MODELS, ids=lambda s: s.name)
def test_a_model_uses_only_the_moments_that_it_asks_for(moments: Moments, support) -> None:
    """What the patterns cannot tell is not a number, and must not reach the parameters."""

    def blind(m: Moments) -> Moments:
        normalised = m.normalised.copy()
        normalised[[i for i in range(len(MONOMIALS)) if i not in support.needs]] = np.nan
        return Moments(m.coefficient, normalised, m.extent, tuple(blind(c) for c in m.channels))

    np.testing.assert_array_equal(support.fit(blind(moments)), support.fit(moments))


@pytest.mark.parametrize("support", MODELS, ids=lambda s: s.name)
def test_the_filter_is_linear_in_the_light(noisy, moments: Moments, support: Support) -> None:
    cube, a, b = Hemicube(patches=2), noisy(1), noisy(2)
    parameters = support.fit(moments)

    def seen(image: np.ndarray) -> np.ndarray:
        return support.average(PatchLight(Environment(image), cube), 5, parameters)

    both, apart = seen(a.image + 2 * b.image), seen(a.image) + 2 * seen(b.image)
    np.testing.assert_allclose(both, apart, rtol=1e-4, atol=1e-4)


def test_names_are_those_of_the_choice() -> None:
    assert {name: s.name for name, s in SUPPORTS.items()} == {n: n for n in SUPPORTS}
