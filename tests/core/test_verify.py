"""A verdict tells an error from noise."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.verify import marked, verify

SHAPE = (120, 160)


def _truth() -> np.ndarray:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] / SHAPE[1]
    return np.dstack([0.2 + x, 0.3 + y, 0.5 + 0 * x])


def _render(seed: int, noise: float = 0.3) -> np.ndarray:
    """As a path tracer's: noise in proportion to the light, never below nothing."""
    rng = np.random.default_rng(seed)
    truth = _truth()
    return truth * rng.gamma(1 / noise**2, noise**2, truth.shape)


def test_noise_alone_is_no_error() -> None:
    found = verify(_truth(), _render(1), _render(2))
    assert found.share < 0.01
    assert "Agrees" in found.line
    # the mean size of a normal's deviation from 64 pixels of two renders
    expected = 0.3 / np.sqrt(2 * 64) * np.sqrt(2 / np.pi)
    assert found.noise == pytest.approx(expected, rel=0.1)
    assert found.error == pytest.approx(expected, rel=0.15)


def test_an_error_is_found_where_it_is() -> None:
    picture = _truth()
    picture[40:80, 80:120] *= 1.3
    found = verify(picture, _render(1), _render(2))
    inside = found.off[40:80, 80:120] > 0.02
    outside = found.off > 0.02
    assert inside.mean() > 0.95
    assert (outside.sum() - inside.sum()) / outside.size < 0.01
    assert found.share == pytest.approx(40 * 40 / (120 * 160), rel=0.1)
    red = marked(picture, found)
    assert (red[50:70, 90:110, 0] > red[50:70, 90:110, 1]).all()


def test_a_picture_of_few_samples_has_noise_of_its_own() -> None:
    noisy = _render(3)
    alone = verify(noisy, _render(1), _render(2))
    # one render has twice the variance of the mean of two
    told = verify(noisy, _render(1), _render(2), own=2.0)
    assert told.share < 0.01 < alone.share


def test_darkness_agrees_with_darkness() -> None:
    dark = np.zeros((*SHAPE, 3))
    found = verify(dark, dark, dark)
    assert (found.error, found.share) == (0, 0)
