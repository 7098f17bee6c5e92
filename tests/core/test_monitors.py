"""Monitors: what they are to show, what photographs tell of them, and what becomes of noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import PhotographsError
from arto.core.field.field import Field
from arto.core.fit.evidence import evidence
from arto.core.fit.fit import fit
from arto.core.patterns import monomials, pattern_set
from arto.core.photographs import __main__ as command
from arto.core.photographs import (
    description_file,
    monitor_set,
    noise,
    png_file,
    shown,
    simulate,
)
from arto.core.photographs.description import Description, Kind, Monitors, Photograph
from arto.core.photographs.opened import Photographs
from arto.core.photographs.photographer import MonitorRig
from arto.core.photographs.reader import InMemory
from arto.core.photographs.screen_curve import (
    assumed_curve,
    falls_of,
    light_of,
    measured_curve,
    value_of,
)
from arto.core.photographs.screens import hemicube_of, hole, screen_of, screens_of, to_hemicube
from arto.core.supports import BOX

FOUR = Monitors(("top", "left", "right", "back"), 4, "moments_uv", 64, 48)


def screen_light(values: np.ndarray) -> np.ndarray:
    """A monitor that is no power: dark greys are crushed, and each channel has its own curve."""
    powers = np.array([2.1, 2.25, 2.4])
    return 0.9 * np.clip(values, 0, 1)[..., None] ** powers + 0.1 * values[..., None] ** 6


def test_the_curve_is_that_of_the_monitor_though_black_shines_and_the_steps_are_noisy() -> None:
    rng = np.random.default_rng(5)
    steps = np.array(shown.STEPS)
    lights = 300 * (0.004 + screen_light(steps))
    curve = measured_curve(steps, lights * rng.normal(1, 0.002, lights.shape))
    values = np.linspace(0.1, 1, 50)
    true = screen_light(values)
    assert np.abs(light_of(curve, values[:, None]) / true - 1).max() < 0.04
    assert np.abs(value_of(curve, true) - values[:, None]).max() < 0.01
    assert (np.diff(curve, axis=1) >= 0).all() and (curve[:, 0] == 0).all()


@pytest.mark.parametrize("steps", [[0.0, 0.5], [0.5, 1.0], [0.0]])
def test_a_curve_needs_black_and_white(steps: list[float]) -> None:
    with pytest.raises(PhotographsError, match="black or white"):
        measured_curve(np.array(steps), np.ones((len(steps), 3)))


def test_a_screen_that_is_always_black_is_refused() -> None:
    with pytest.raises(PhotographsError, match="no brighter"):
        measured_curve(np.array([0.0, 1.0]), np.full((2, 3), 0.2))


@pytest.mark.parametrize("corners", [False, True])
def test_the_thing_sees_the_pattern_whatever_curve_and_fall_off(corners: bool) -> None:
    monitors = replace(FOUR, patches=2, curve=tuple(map(tuple, assumed_curve(1.8))), falls=1.5)
    if corners:  # a screen that leans, off its side, far larger than it need be
        turn, tilt = (
            np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (0.2, 0.1)
        )
        flat = np.array([[x, y, -2.0] for x, y in ((-5, -4), (4, -4), (4, 5), (-5, 5))])
        flat[:, [0, 2]] = flat[:, [0, 2]] @ turn.T
        flat[:, [1, 2]] = flat[:, [1, 2]] @ tilt.T
        monitors = replace(monitors, sides=("back",), corners=(tuple(map(tuple, flat)),))
    cube = hemicube_of(monitors)
    screens = screens_of(monitors)
    whole = shown.level(monitors, cube)
    for k in (0, len(cube) - 1):
        screen = screens[screen_of(cube, k, screens)]
        for name in ("white", "u2", "uv"):
            values = shown.picture(screen, cube, k, name, monitors, whole) / 255
            light = light_of(np.array(monitors.curve), values)[..., 0]
            seen = light * screen.cosines(screen.places) ** monitors.falls / whole
            patch, u, v = cube.locate(screen.places)
            row = np.array(pattern_set("moments_uv").emission(name)[0])
            wanted = np.where(patch == k, np.tensordot(row, monomials(u, v), axes=1), 0)
            assert np.abs(seen - wanted).max() < 0.02
            assert (patch == k).sum() > 50


def test_a_screen_with_corners_lights_the_patches_that_it_covers_and_no_others() -> None:
    # from the thing's middle, in its own frame: x right, y up, z towards the camera
    wall = ((-2.0, -1.2, -2.0), (2.0, -1.2, -2.0), (2.0, 1.2, -2.0), (-2.0, 1.2, -2.0))
    monitors = Monitors(("back",), 4, "white", 160, 96, corners=(wall,))
    cube = hemicube_of(monitors)
    # as wide as the side of the cube, and as high as half of it
    assert cube.leaves == tuple(("back", 4, row, c) for row in (1, 2) for c in range(4))
    assert hole(cube) == pytest.approx(1 - cube.solid_angles.sum() / (4 * np.pi))
    met, _ = screens_of(monitors)[0].meets(
        cube.directions(0, np.array([0.1, 0.9]), np.full(2, 0.5))
    )
    assert met.all()
    assert to_hemicube(np.array([0.0, 0.0, 1.0])).tolist() == [0, -1, 0]
    with pytest.raises(PhotographsError, match="no rectangle"):
        screens_of(replace(monitors, corners=((wall[0], wall[2], wall[1], wall[3]),)))
    with pytest.raises(PhotographsError, match="no patch is covered"):
        hemicube_of(replace(monitors, patches=1))


def test_a_power_of_the_cosine_is_found() -> None:
    degrees = np.array([0, 15, 30, 45, 60])
    lights = 12 * np.cos(np.radians(degrees)) ** 2.4 * np.random.default_rng(2).normal(1, 0.01, 5)
    assert falls_of(degrees, lights) == pytest.approx(2.4, abs=0.1)


# Rows of pixels that see a patch evenly, and rows that see a point of it.
HIGH, LOW = slice(2, 10), slice(14, 22)


def simulated(
    patterns: str, camera: simulate.Camera, light: float = 0.2
) -> tuple[Description, object]:
    """Photographs of two patches, of which a pixel sees a point, half of one or the whole."""
    monitors = Monitors(("left", "right"), 1, patterns, 64, 64, curve=None)
    cube = hemicube_of(monitors)
    said = Description(shown.photographs(monitors, cube), monitors=monitors)
    screen = simulate.TrueScreen(
        measured_curve(np.array(shown.STEPS), screen_light(np.array(shown.STEPS))), 3.0, 0.01
    )
    known = replace(monitors, curve=tuple(map(tuple, screen.curve)))
    shows = simulate.emissions(screen, cube, known)
    even, rng = cube.uniform_moments(0), np.random.default_rng(0)
    point = monomials(np.array(0.7), np.array(0.2))
    rows = np.concatenate([np.tile(even, (12, 1)), np.tile(point, (12, 1))])
    moments = light * np.broadcast_to(rows.T[:, :, None, None], (6, 24, 24, 3))

    def taken(photos: tuple[Photograph, ...]) -> np.ndarray:
        (photo,) = photos
        if photo.kind is Kind.STEP:
            light = np.broadcast_to(screen.shows(np.array(photo.step)), (24, 24, 3))
        else:
            room = 2 * screen.white * screen.black * moments[0]
            light = (
                room
                if photo.kind is Kind.DARK
                else room + screen.white * (simulate.basis_image(moments, shows[photo.pattern]))
            )
        values = camera.values(light, 1 / 3.3, rng)
        found = values / np.iinfo(values.dtype).max
        return (
            found * 3.3
            if camera.curve == "linear"
            else np.where(found <= 0.04045, found / 12.92, ((found + 0.055) / 1.055) ** 2.4) * 3.3
        )

    return said, taken


@pytest.mark.parametrize("patterns", ["moments_uv", "paper"])
def test_photographs_of_patterns_become_the_basis_images(tmp_path: Path, patterns: str) -> None:
    said, taken = simulated(patterns, simulate.Camera(16, np.inf, 0.0, "linear"))
    for _ in monitor_set.write(tmp_path, said, taken):
        pass
    there = CaptureSet(tmp_path)
    basis = there.read(0).basis
    even = there.hemicube.uniform_moments(0)
    point = monomials(np.array(0.7), np.array(0.2))
    for rows, moments in ((HIGH, even), (LOW, point)):
        wanted = 0.2 * there.patterns.matrix @ moments
        # eight bits of the monitor are a hundredth of what it shows
        assert np.abs(basis[0, :, rows].mean(axis=(1, 2, 3)) - wanted).max() < 0.003
    assert there.head.told_choice[0] == ("auto" if patterns == "moments_uv" else "search")


def test_a_missing_photograph_is_named(tmp_path: Path) -> None:
    said, taken = simulated("white", simulate.IDEAL)
    some = tuple(p for p in said.photographs if p.patch != 1)
    with pytest.raises(PhotographsError, match=r"1 of 2 photographs are missing.*right 0,0"):
        next(monitor_set.write(tmp_path, replace(said, photographs=some), taken))


def test_noise_is_measured_and_decides_which_support_is_believed(tmp_path: Path) -> None:
    boxes = {}
    for light in (0.2, 0.02):
        said, taken = simulated("moments_uv", simulate.Camera(16, 400.0, 4.0, "linear"), light)
        noisy = monitor_set.measured_noise(said, taken)
        if light == 0.2:
            # photons: at a light of 3.3 a pixel is full, and 400 of them are its width
            assert noisy.taken[1] == pytest.approx(3.3 / 400, rel=0.3)
        for _ in monitor_set.write(tmp_path / "photos", said, taken, clean=False):
            pass
        captured = CaptureSet(tmp_path / "photos")
        for told in (captured.head.noise, None):
            source = CaptureSet(captured.folder, head=replace(captured.head, noise=told))
            for _ in fit(source, tmp_path / "field"):
                pass
            found = np.asarray(Field(tmp_path / "field").tiles[0].codes).reshape(2, 24, 24)
            boxes[light, told is None] = [(found[:, r] == BOX.code).mean() for r in (HIGH, LOW)]
    even, point = boxes[0.2, False]
    assert point > 3 * even
    # where noise is greater than the light, it is taken for narrow supports unless it is known
    assert max(boxes[0.02, False]) < 0.01 and min(boxes[0.02, True]) > 0.2


def test_the_filter_takes_noise_out_and_leaves_edges() -> None:
    rng = np.random.default_rng(3)
    light = np.zeros((2, 40, 40, 3)) + 0.01
    light[..., 20:, :] = 1.0
    light[0] *= 0.5
    given = 1e-5, 2e-3
    noisy = light + rng.normal(size=light.shape) * np.sqrt(noise.variance_of(given, light))
    clean = noise.without_noise(noisy, given)
    flat = np.s_[:, 5:35, 25:35]
    assert np.std(clean[flat] - light[flat]) < 0.35 * np.std(noisy[flat] - light[flat])
    step = clean[1, 5:35, 20].mean() - clean[1, 5:35, 19].mean()
    assert step > 0.9
    assert clean.mean() == pytest.approx(light.mean(), rel=0.01)


def test_an_evidence_of_noise_counts_less_where_it_is_darker() -> None:
    sizes = np.array([[1.0, 0.1, 0.01]], np.float32)
    known = evidence(sizes, (1, 3), np.ones(1), noise=(1e-4, 0.0))
    hits = known.hits(0, np.arange(3))
    assert hits == pytest.approx(sizes[0] ** 2 / 12e-4, rel=1e-5)


def test_greys_of_a_monitor_tell_the_curve_of_the_camera_too() -> None:
    """Within 2%, of exposures three stops apart, and so the light of white and black."""
    rig = MonitorRig(Monitors(("top",), 1, "white", 64, 64))
    light = np.geomspace(1e-3, 1, 20)[None, :, None] * np.ones((12, 1, 3))
    files: dict[str, np.ndarray] = {}
    said = rig.photograph(lambda k: np.stack([light] * 6), files.__setitem__)
    photos = Photographs(Path(), said, lambda path: InMemory(files[path.as_posix()] / 255))
    values = np.arange(20, 245)
    z = values / 255
    true = np.where(z <= 0.04045, z / 12.92, ((z + 0.055) / 1.055) ** 2.4)
    assert np.abs(photos.curve.table[:, values] / true - 1).max() < 0.02
    found = monitor_set.calibrated(photos.said, photos.light)
    assert found.white == pytest.approx(np.full(3, 0.998), rel=0.01)
    assert found.black == pytest.approx(rig.screen.black, rel=0.05)


def test_a_folder_of_greys_is_calibrated_by_the_command(tmp_path: Path, capsys) -> None:
    pytest.importorskip("OpenImageIO")
    rig = MonitorRig(Monitors(("top",), 1, "white", 64, 64), falls=1.5)
    files: dict[str, np.ndarray] = {}
    said = rig.photograph(lambda k: np.full((6, 12, 20, 3), 0.3), files.__setitem__)
    for name, values in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        png_file.write(tmp_path / name, values)
    description_file.write(tmp_path, replace(said, monitors=replace(said.monitors, falls=0.0)))
    assert command.main(["calibrate", str(tmp_path)]) == 0, capsys.readouterr()
    found = description_file.read(tmp_path / description_file.FILE).monitors
    assert found is not None and found.falls == pytest.approx(1.5, abs=0.05)
    assert np.abs(np.array(found.curve) - rig.screen.curve).max() < 0.02
