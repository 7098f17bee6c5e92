"""The figure that the project quotes: |x - ref| / (ref + 1% of mean ref)."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.metrics import (
    mean_relative_error,
    relative_error,
    relative_squares,
    trimmed_mean,
)


def test_by_hand() -> None:
    reference = np.array([[[1.0] * 3, [3.0] * 3]])
    picture = np.array([[[1.1] * 3, [2.7] * 3]])
    # mean of the reference 2, so 0.02 on top
    np.testing.assert_allclose(
        relative_error(picture, reference), [[0.1 / 1.02] * 3, [0.3 / 3.02] * 3]
    )
    assert mean_relative_error(picture, reference) == pytest.approx((0.1 / 1.02 + 0.3 / 3.02) / 2)


def test_the_mask_decides_what_counts_and_what_the_mean_is() -> None:
    reference = np.array([[[1.0] * 3, [1e9] * 3]])
    picture = np.array([[[2.0] * 3, [0.0] * 3]])
    mask = np.array([[True, False]])
    assert relative_error(picture, reference, mask).shape == (1, 3)
    assert mean_relative_error(picture, reference, mask) == pytest.approx(1 / 1.01)


def test_exposure_does_not_matter_and_equal_is_zero() -> None:
    rng = np.random.default_rng(0)
    reference, picture = rng.random((2, 5, 4, 3))
    assert mean_relative_error(reference, reference) == 0
    assert mean_relative_error(picture, reference) == pytest.approx(
        mean_relative_error(picture * 1e-4, reference * 1e-4)
    )


def test_single_precision_pictures_are_compared_in_double() -> None:
    reference = np.full((2, 2, 3), 1, np.float32)
    assert relative_error(reference, reference).dtype == np.float64
    # dark beside bright: the mean of a million pixels does not lose the dark
    many = np.full((1000, 1000, 3), 0.1, np.float32)
    expected = 0.1 / (0.1 * 1.01)
    assert mean_relative_error(2 * many, many) == pytest.approx(expected, rel=1e-6)


def test_the_noise_of_the_references_has_no_part_in_relmse() -> None:
    """A picture that is off by a tenth everywhere, against references with noise as large."""
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.5, 2, (200, 200, 3))
    one, two = truth * (1 + 0.1 * rng.normal(size=(2, *truth.shape)))
    found = relative_squares(1.1 * truth, one, two).mean()
    assert found == pytest.approx(0.01, rel=0.25)  # the weights' own noise
    assert relative_squares(truth, one, two).mean() == pytest.approx(0, abs=2e-4)
    assert np.square(relative_error(1.1 * truth, one)).mean() > 0.02


def test_the_trimmed_mean_leaves_out_the_largest() -> None:
    values = np.ones(2000)
    values[[3, 77]] = 1e6
    assert trimmed_mean(values) == 1
    assert trimmed_mean(np.array([2.0])) == 2
