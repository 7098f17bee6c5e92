"""What single support models find in planted transports: search, tilt, two components, colour."""

from __future__ import annotations

import numpy as np
import pytest
from arto.core.capture.moments import Moments
from arto.core.fit import matte
from arto.core.fit.search import search
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.measure import box_averages
from arto.core.patterns import monomials, pattern_set
from arto.core.supports import PER_CHANNEL, SUPPORTS

SEES_A_BOX = ("moments", "moments_uv")
# So small that area and solid angle are one; a quarter of a face; a whole one.
FLAT, QUARTER, FACE = (-1e-6, 1e-6, -1e-6, 1e-6), (0.0, 1.0, -1.0, 0.0), (-1.0, 1.0, -1.0, 1.0)


def boxes(n: int, seed: int = 0, least: float = 0.05) -> np.ndarray:
    rng = np.random.default_rng(seed)
    size = rng.uniform(least, 0.9, (n, 2))
    low = rng.uniform(size=(n, 2)) * (1 - size)
    return np.stack([low[:, 0], low[:, 0] + size[:, 0], low[:, 1], low[:, 1] + size[:, 1]], -1)


def images(patterns, averages: np.ndarray, colour=(1.0, 0.7, 0.4)) -> np.ndarray:
    """Basis images (P, n, 3) of transports with these averages of the monomials (6, n)."""
    return (patterns.matrix @ averages)[..., None] * np.array(colour)


@pytest.mark.parametrize("name", SEES_A_BOX)
def test_planted_boxes_come_back(name):
    """In closed form to 1e-5. The search stops where no single move helps, which along the narrow
    valley of a thin box is up to 1e-4 early, however small its last step."""
    patterns, planted = pattern_set(name), boxes(200)
    basis = images(patterns, box_averages(planted, FLAT))
    closed = SUPPORTS["box"].fit(Moments.from_basis(basis, patterns, FLAT))
    np.testing.assert_allclose(closed, planted, atol=1e-5)
    found = search(basis, patterns, FLAT, 1, finest=2.0**-20, follow=False)
    np.testing.assert_allclose(found, planted, atol=1e-4)


@pytest.mark.parametrize("extent", [QUARTER, FACE])
@pytest.mark.parametrize("name", SEES_A_BOX)
def test_boxes_that_are_even_in_solid_angle_come_back(box_moments, name, extent):
    """On patches so large that their area is another measure: by it a box would be off by up to a
    tenth of the patch."""
    patterns, planted = pattern_set(name), boxes(200)
    basis = images(patterns, box_moments(planted, extent))
    closed = SUPPORTS["box"].fit(Moments.from_basis(basis, patterns, extent))
    np.testing.assert_allclose(closed, planted, atol=1e-5)
    by_area = SUPPORTS["box"].fit(Moments.from_basis(basis, patterns, FLAT))
    assert np.abs(by_area - planted).max() > 0.05
    found = search(basis, patterns, extent, 1, finest=2.0**-20, follow=False)
    np.testing.assert_allclose(found, planted, atol=1e-3)


def test_search_is_as_good_as_its_last_step():
    """What it finds explains the images to about one step; a thin box's sides are less certain."""
    patterns, planted = pattern_set("moments"), boxes(100, 1)
    truth = box_averages(planted, QUARTER)
    found = search(images(patterns, truth), patterns, QUARTER, 1, finest=1 / 256)
    assert np.abs(box_averages(found, QUARTER) - truth).max() < 2 / 256
    assert np.median(np.abs(found - planted)) < 2 / 256


def test_search_cannot_tell_a_quarter_turn_by_the_papers_patterns():
    """The box and its quarter turn about its centre have the same error, which is none; what the
    search returns explains the images, and is not always the box that was planted."""
    patterns = pattern_set("paper")
    planted = np.array([[0.4, 0.6, 0.1, 0.9], [0.1, 0.9, 0.4, 0.6]])
    basis = images(patterns, box_averages(planted, FLAT))
    np.testing.assert_allclose(basis[:, 0], basis[:, 1], atol=1e-12)
    found = search(basis, patterns, FLAT, 1, finest=2.0**-16, follow=False)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)
    explained = images(patterns, box_averages(found, FLAT))
    np.testing.assert_allclose(explained, basis, atol=1e-3)


def test_search_follows_the_previous_pixel_and_stays_on_the_patch():
    """Along a row of equal pixels the start is the answer already; noise never leaves the patch."""
    patterns = pattern_set("paper")
    planted = np.repeat(boxes(4, 2), 8, axis=0)
    basis = images(patterns, box_averages(planted, FLAT))
    found = search(basis, patterns, FLAT, 4).reshape(4, 8, 4)
    assert np.abs(found - found[:, :1]).max() < 1e-9
    rng = np.random.default_rng(3)
    noisy = basis * (1 + 0.4 * rng.normal(size=basis.shape))
    found = search(np.maximum(noisy, 0), patterns, FLAT, 4)
    assert ((found >= 0) & (found <= 1)).all()
    assert (found[:, 1] >= found[:, 0]).all() and (found[:, 3] >= found[:, 2]).all()


def grid(density) -> np.ndarray:
    """Averages of the monomials (6, 1) under a density on the patch, by quadrature."""
    t = (np.arange(400) + 0.5) / 400
    u, v = t[None, :], t[:, None]
    weight = density(u, v)
    return ((monomials(u, v) * weight).sum(axis=(1, 2)) / weight.sum())[:, None]


@pytest.mark.parametrize("name", ["oriented_box", "gaussian"])
def test_tilt_is_found(name):
    """An ellipse at 30 degrees: its mean, deviations and tilt come back, and light that lies along
    it is seen where the axis-aligned box is blind to the tilt."""
    turn = np.radians(30)

    def ellipse(u, v):
        x, y = u - 0.5, v - 0.5
        along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
        return np.exp(-((along / 0.15) ** 2 + (across / 0.03) ** 2) / 2)

    patterns = pattern_set("moments_uv")
    moments = Moments.from_basis(images(patterns, grid(ellipse)), patterns, FLAT)
    mu, mv, du, dv, tilt = SUPPORTS[name].fit(moments)[0]
    su = np.hypot(0.15 * np.cos(turn), 0.03 * np.sin(turn))
    sv = np.hypot(0.15 * np.sin(turn), 0.03 * np.cos(turn))
    covariance = (0.15**2 - 0.03**2) * np.cos(turn) * np.sin(turn)
    np.testing.assert_allclose([mu, mv], 0.5, atol=1e-6)
    np.testing.assert_allclose([du / 2, dv / 2], [su, sv], rtol=0.01)
    assert 2 * tilt - 1 == pytest.approx(covariance / (su * sv), rel=0.02)

    # light on one side of the diagonal through the patch's centre at the ellipse's angle
    cube = Hemicube(faces=("top",), patches=1)
    z, x, y = None, None, None
    height, width = 256, 512
    latitude = np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    z = np.sin(latitude)[:, None] * np.ones(width)
    x = np.cos(latitude)[:, None] * np.cos(azimuth)
    y = np.cos(latitude)[:, None] * np.sin(azimuth)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (x / z + 1) / 2, (1 - y / z) / 2
    off = (v - 0.5) * np.cos(turn) - (u - 0.5) * np.sin(turn)
    stripe = np.where((z > 0.5) & (np.abs(off) < 0.06), 1.0, 0.0)
    light = PatchLight(Environment(np.dstack([stripe] * 3).astype(np.float32)), cube, 128)
    seen = {n: SUPPORTS[n].average(light, 0, SUPPORTS[n].fit(moments))[0, 0] for n in (name, "box")}
    # two deviations across: 95% of the ellipse's light
    assert seen[name] > 0.8
    assert seen["box"] < 0.6


def test_two_components_are_told_apart_off_the_middle_lines():
    rng = np.random.default_rng(4)
    n = 100
    size = rng.uniform(0.02, 0.2, (n, 2))
    # away from both middle lines
    centre = rng.choice([0.22, 0.3, 0.7, 0.78], (n, 2))
    narrow = np.stack(
        [centre[:, 0] - size[:, 0], centre[:, 0] + size[:, 0],
         centre[:, 1] - size[:, 1], centre[:, 1] + size[:, 1]], -1,
    )  # fmt: skip
    share = rng.uniform(0.1, 1, n)
    whole = box_averages(np.tile([0.0, 1.0, 0.0, 1.0], (n, 1)), FLAT)
    averages = share * box_averages(narrow, FLAT) + (1 - share) * whole
    patterns = pattern_set("moments_uv")
    moments = Moments.from_basis(images(patterns, averages), patterns, FLAT)
    found = SUPPORTS["double"].fit(moments)
    np.testing.assert_allclose(found[:, 0], share, atol=1e-6)
    np.testing.assert_allclose(found[:, 1:], narrow, atol=1e-5)


@pytest.mark.parametrize("extent", [QUARTER, FACE])
def test_two_components_are_told_apart_on_a_large_patch(box_moments, extent):
    """There the base has its own mean, and covariance, and the box a little of one."""
    rng = np.random.default_rng(14)
    size, share = rng.uniform(0.02, 0.2, (50, 2)), rng.uniform(0.1, 1, 50)
    centre = rng.choice([0.22, 0.3, 0.7, 0.78], (50, 2))
    low, high = centre - size, centre + size
    narrow = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], -1)
    whole = box_moments([[0, 1, 0, 1]], extent)
    averages = share * box_moments(narrow, extent) + (1 - share) * whole
    patterns = pattern_set("moments_uv")
    moments = Moments.from_basis(images(patterns, averages), patterns, extent)
    found = SUPPORTS["double"].fit(moments)
    np.testing.assert_allclose(found[:, 0], share, atol=1e-3)
    np.testing.assert_allclose(found[:, 1:], narrow, atol=1e-3)


def test_what_is_no_two_components_is_one_box():
    """A narrow tilted ellipse has a covariance that no share explains: nothing of it can be an even
    base, as its spread is under the base's alone."""
    turn = np.radians(40)

    def ellipse(u, v):
        x, y = u - 0.47, v - 0.53
        along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
        return np.exp(-((along / 0.08) ** 2 + (across / 0.02) ** 2) / 2)

    patterns = pattern_set("moments_uv")
    for density in (ellipse, lambda u, v: ellipse(u, 1 - v)):
        moments = Moments.from_basis(images(patterns, grid(density)), patterns, FLAT)
        double, box = (SUPPORTS[n].fit(moments)[0] for n in ("double", "box"))
        assert double[0] > 0.9
        np.testing.assert_allclose(double[1:], box, atol=0.1)


def test_two_components_on_a_middle_line_become_one_box():
    """There the six moments do not tell the share: nothing is made up."""
    whole = box_averages(np.array([0.0, 1.0, 0.0, 1.0]), FLAT)
    narrow = box_averages(np.array([0.45, 0.55, 0.1, 0.2]), FLAT)
    averages = (0.5 * narrow + 0.5 * whole)[:, None]
    patterns = pattern_set("moments_uv")
    moments = Moments.from_basis(images(patterns, averages), patterns, FLAT)
    double = SUPPORTS["double"].fit(moments)
    assert double[0, 0] >= 2 * 0.15  # the least share that has its box on the patch
    assert ((double >= 0) & (double <= 1)).all()


def test_a_support_for_each_channel(box_moments):
    """Dispersion: a box for each channel, which a shared support can only average."""
    patterns, planted = pattern_set("moments"), [boxes(50, seed) for seed in (5, 6, 7)]
    extent = Hemicube(patches=2).extent(3)
    basis = np.stack([patterns.matrix @ box_moments(b, extent) for b in planted], axis=-1)
    moments = Moments.from_basis(basis, patterns, extent, per_channel=True)
    found = PER_CHANNEL["box"].fit(moments)
    np.testing.assert_allclose(found, np.concatenate(planted, axis=-1), atol=1e-5)
    rng = np.random.default_rng(8)
    image = rng.random((64, 128, 3)).astype(np.float32)
    light = PatchLight(Environment(image), Hemicube(patches=2), 16)
    separate = PER_CHANNEL["box"].average(light, 3, found)
    for c in range(3):
        alone = SUPPORTS["box"].average(light, 3, planted[c])[:, c]
        np.testing.assert_allclose(separate[:, c], alone, rtol=1e-3)
    shared = SUPPORTS["box"].average(light, 3, SUPPORTS["box"].fit(moments))
    assert np.abs(shared - separate).max() > 0.02


def test_matte_is_one_cap_of_directions():
    """A mirror's cap is a point, seen where it looks; a uniform sphere's is everything."""
    cube, patterns = Hemicube(patches=2), pattern_set("moments")
    basis = np.zeros((len(cube), 5, 2, 3))
    basis[7, :, 0] = images(patterns, box_averages(np.array([[0.3, 0.3, 0.6, 0.6]]), FLAT))[:, 0]
    for k in range(len(cube)):
        whole = images(patterns, cube.uniform_moments(k)[:, None], (1, 1, 1))[:, 0]
        basis[k, :, 1] = whole * cube.solid_angles[k]
    caps = matte.fit(basis, patterns, cube)
    np.testing.assert_allclose(caps.axis[0], cube.directions(7, 0.3, 0.6), atol=1e-9)
    assert caps.cosine[0] == pytest.approx(1, abs=1e-9)
    assert caps.cosine[1] == pytest.approx(-1, abs=1e-6)
    rng = np.random.default_rng(9)
    image = rng.random((16, 32, 3)).astype(np.float32).repeat(8, 0).repeat(8, 1)
    environment = Environment(image)
    light = PatchLight(environment, cube)
    picture = matte.relight(caps, light)
    k, u, v = cube.locate(caps.axis[0])
    point = SUPPORTS["box"].average(light, int(k), np.array([[u, u, v, v]]))[0]
    np.testing.assert_allclose(picture[0], point * [1.0, 0.7, 0.4], rtol=0.05)
    np.testing.assert_allclose(picture[1], environment.irradiance(), rtol=0.15)


@pytest.mark.parametrize("border", ["patch", "face"])
def test_narrow_support_over_a_border_does_not_tear(border):
    """A mirror's little box that slides over a border: each patch has its part, and together they
    see what one box would, at every step. The sun is on the border itself."""
    cube, patterns = Hemicube(patches=2), pattern_set("moments")
    left = cube.face_slice("back").start + (0 if border == "patch" else 1)
    right = left + 1 if border == "patch" else cube.face_slice("right").start
    sun = cube.directions(left, np.array(1.0), np.array(0.5))
    height, width = 256, 512
    latitude = np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    d = np.empty((height, width, 3))
    d[..., 0] = np.cos(latitude)[:, None] * np.cos(azimuth)
    d[..., 1] = np.cos(latitude)[:, None] * np.sin(azimuth)
    d[..., 2] = np.sin(latitude)[:, None]
    disc = np.where(d @ sun > np.cos(np.radians(2)), 100.0, 1.0)
    light = PatchLight(Environment(np.dstack([disc] * 3).astype(np.float32)), cube, 128)
    size, seen = 0.2, []
    for at in np.linspace(0.7, 1.3, 61):
        total = 0.0
        for k, shift in ((left, 0.0), (right, 1.0)):
            u0, u1 = np.clip([at - size / 2 - shift, at + size / 2 - shift], 0, 1)
            share = (u1 - u0) / size
            if share <= 0:
                continue
            averages = box_averages(np.array([[u0, u1, 0.4, 0.6]]), cube.extent(k))
            basis = share * images(patterns, averages, (1, 1, 1))
            box = SUPPORTS["box"]
            moments = Moments.from_basis(basis, patterns, cube.extent(k))
            total += share * box.average(light, k, box.fit(moments))[0, 0]
        seen.append(total)
    seen = np.array(seen)
    # no sun at both ends, all of it in the middle, and no step larger than the box's own edge makes
    assert seen[0] == pytest.approx(1) and seen[-1] == pytest.approx(1)
    assert seen[30] > 0.9 * seen.max() > 5
    inside = (np.linspace(0.7, 1.3, 61) > 0.96) & (np.linspace(0.7, 1.3, 61) < 1.04)
    assert np.ptp(seen[inside]) < 0.15 * seen[30]
    assert np.abs(np.diff(seen)).max() < 0.35 * seen.max()
