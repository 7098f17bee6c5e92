"""Plate and samples together: at least as good as either, wherever one of them is wrong."""

import numpy as np
import pytest
from arto.core.errors import FieldError
from arto.core.finish import Samples, plate_share, together

SIDE = 96


def planted(noise: float, plate_noise: float = 0.03, seed: int = 0):
    """A picture with bright and dark parts, a plate that is off in its right third, and samples."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    truth = np.dstack([0.1 + y, 0.3 + 0 * y, 5.0 * (x < 0.5) + 0.05, np.ones_like(y)])
    off = x > 2 / 3
    plate = truth * (1 + plate_noise * rng.normal(size=truth.shape)) * (1 + 0.4 * off[..., None])
    one, two = (
        (truth * (1 + noise * rng.normal(size=truth.shape))).astype(np.float32) for _ in range(2)
    )
    return truth, plate.astype(np.float32), Samples(one, two, 16), off


def error(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(np.sqrt((((picture - truth) / truth)[..., :3] ** 2).mean()))


@pytest.mark.parametrize(("noise", "worse"), [(0.4, 1.35), (0.1, 1.03), (0.02, 1.03)])
def test_it_is_better_than_both(noise: float, worse: float) -> None:
    """In the two thirds where the plate is right, and in the third where it is not.

    worse: where noise is ten times the plate's error, a square cannot tell how small that is.
    """
    truth, plate, samples, off = planted(noise)
    picture, _ = together(plate, samples)
    render = samples.mean
    right = ~off
    # the errors are measured on squares of 13 pixels, which see both sides of an edge
    right[:, 2 * SIDE // 3 - 6 :] = False
    for part in (off, right):
        best = min(error(plate[part], truth[part]), error(render[part], truth[part]))
        assert error(picture[part], truth[part]) <= worse * best
    # of two independent errors, the best mean has less than either
    both = 1 / np.sqrt(1 / error(plate[right], truth[right]) ** 2 + 2 / noise**2)
    assert error(picture[right], truth[right]) <= 1.05 * worse * both


def test_what_is_off_takes_the_render() -> None:
    _, plate, samples, off = planted(0.05)
    renders = samples.one[..., :3], samples.two[..., :3]
    share = plate_share(plate[..., :3], renders, renders)
    inner = np.zeros_like(off)
    inner[:, 72:] = True
    assert share[inner].max() < 0.05
    assert share[:, :56].mean() > 0.5


def test_samples_add_up_by_their_number() -> None:
    """A mean of 16 and one of 48 are the mean of 64; its noise is that of 64 samples."""
    rng = np.random.default_rng(1)

    def of(count: int) -> Samples:
        one, two = 1 + rng.normal(size=(2, 64, 64, 4)) / np.sqrt(count)
        return Samples(one.astype(np.float32), two.astype(np.float32), count)

    sixteen, more = of(16), of(48)
    both = sixteen.more(more)
    assert both.count == 64
    np.testing.assert_allclose(both.one, sixteen.one / 4 + more.one * 3 / 4, rtol=1e-5, atol=1e-6)
    assert both.two.std() == pytest.approx(1 / 8, rel=0.05)
    assert both.mean.std() == pytest.approx(1 / np.sqrt(128), rel=0.05)


def test_black_and_equal_pictures_are_finite() -> None:
    black = np.zeros((8, 9, 4), np.float32)
    picture, share = together(black, Samples(black, black, 16))
    assert not picture.any() and share == 0
    one = np.ones((8, 9, 4), np.float32)
    assert np.array_equal(together(one, Samples(one, one, 16))[0], one)


def test_two_sizes_are_refused() -> None:
    one, two = np.zeros((8, 9, 4), np.float32), np.zeros((9, 8, 4), np.float32)
    with pytest.raises(FieldError, match="9, 8, 4"):
        together(one, Samples(two, two, 16))
    with pytest.raises(FieldError, match="9, 8, 4"):
        Samples(one, one, 16).more(Samples(two, two, 16))
