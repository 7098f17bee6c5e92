"""The field on disk: precision, and what a reader refuses."""

from __future__ import annotations

import json
import mmap
import shutil
from pathlib import Path

import numpy as np
import pytest
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import FieldError
from arto.core.field import tile_file
from arto.core.field.field import Field
from arto.core.field.head import HEADER, VERSION
from arto.core.field.tile import FULL
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter
from arto.core.fit import fit
from arto.core.fit.evidence import DROPPED
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import pattern_set
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.signed import parsed
from arto.core.supports import BOX, LINEAR, NOTHING, REST, WHOLE

CUBE = Hemicube(faces=("top", "back"), patches=2)


@pytest.fixture
def capture(tmp_path: Path, scene, write_scene) -> Path:
    return write_scene(tmp_path / "capture", scene(CUBE))


def entries_of(field: Field, k: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Pixel -> (R, parameters) of one patch of a field of one tile."""
    found = field.tiles[0].entries(k)
    return {
        int(pixel): (e.coefficient[n], e.parameters[n])
        for e in found
        for n, pixel in enumerate(e.pixels)
    }


def assert_coded(got: np.ndarray, r: np.ndarray, peak: np.ndarray) -> None:
    """As near as codes can be: half a step of the root of the pixel's largest, which is a half
    float and may be moved by as much as all codes of its pixel are off together."""
    largest = np.sqrt(peak)
    off = np.abs(np.sqrt(got) - np.sqrt(r))
    assert (off <= largest * (0.5 / FULL + 2**-9)).all(), (off / largest).max()


def test_every_entry_comes_back(tmp_path: Path, capture: Path, scene, fitted) -> None:
    made, field = scene(CUBE), fitted(capture, tmp_path / "field")
    assert field.shape == (6, 8) and field.hemicube == CUBE
    for k in range(len(CUBE)):
        found = entries_of(field, k)
        r = made.coefficient[k].reshape(-1, 3)
        box = made.boxes[k].reshape(-1, 4)
        assert set(found) == set(np.flatnonzero(r.any(axis=-1)).tolist())
        for pixel, (coefficient, parameters) in found.items():
            assert_coded(coefficient, r[pixel], made.coefficient.max(axis=0).reshape(-1, 3)[pixel])
            np.testing.assert_allclose(parameters, box[pixel], atol=2e-5)


def test_layers_come_back(tmp_path: Path, capture: Path, scene, fitted) -> None:
    made, field = scene(CUBE), fitted(capture, tmp_path / "field")
    np.testing.assert_allclose(field.layer("own"), made.own, atol=1e-5)
    np.testing.assert_allclose(field.layer("alpha"), made.alpha, atol=2**-11)
    assert field.tiles[0].has_layer("alpha") and not field.tiles[0].has_layer("normal")
    with pytest.raises(FieldError, match=r"tile_0000\.arto lacks 'normal'"):
        field.layer("normal")


@pytest.mark.parametrize("exposure", [1e-20, 1e-6, 1.0, 1e12])
def test_any_exposure_fits_the_codes(tmp_path: Path, exposure: float) -> None:
    """Relative to the brightest of the pixel, whatever unit a scene is in; and all of a pixel's
    light is there."""
    r = np.random.default_rng(0).uniform(0.01, 1, (2, 4, 3)) * exposure
    tile = TileWriter(Region(0, 0, 4, 1), {})
    for k in range(2):
        tile.add(np.full(4, WHOLE.code, np.uint8), r[k], {WHOLE.code: np.empty((4, 0))})
    writer = FieldWriter(tmp_path / "field", Hemicube(faces=("top", "back"), patches=1), (1, 4))
    writer.add(tile)
    writer.close()
    every = []
    for k in range(2):
        found = entries_of(Field(tmp_path / "field"), k)
        every.append(np.stack([found[p][0] for p in range(4)]))
        assert_coded(every[-1] / exposure, r[k] / exposure, r.max(axis=0) / exposure)
    np.testing.assert_allclose(sum(every), r.sum(axis=0), rtol=2**-11 + 1e-6)


def test_models_side_by_side(tmp_path: Path) -> None:
    """Codes decide whose row is whose, patch after patch."""
    cube = Hemicube(faces=("top",), patches=2)
    rng = np.random.default_rng(0)
    codes = rng.choice([NOTHING, WHOLE.code, LINEAR.code, BOX.code], (4, 12)).astype(np.uint8)
    codes[1] = NOTHING  # a patch that no pixel sees
    r = rng.uniform(0.1, 1, (4, 12, 3))
    parameters = rng.uniform(0, 1, (4, 12, 4))
    tile = TileWriter(Region(0, 0, 4, 3), {"own": np.zeros((3, 4, 3)), "alpha": np.ones((3, 4))})
    for k in range(4):
        used = {
            s.code: parameters[k][codes[k] == s.code][:, : len(s.parameters)]
            for s in (WHOLE, LINEAR, BOX)
        }
        tile.add(codes[k], r[k], used)
    writer = FieldWriter(tmp_path / "field", cube, (3, 4))
    writer.add(tile)
    writer.close()
    field = Field(tmp_path / "field")
    # all have light: where it is no entry, it is in the rest
    np.testing.assert_array_equal(field.tiles[0].codes, np.where(codes == NOTHING, REST, codes))
    rest = np.where((codes == NOTHING)[..., None], r, 0)
    peaks = np.where((codes == NOTHING)[..., None], 0, r).max(axis=0)
    np.testing.assert_allclose(field.tiles[0].rest(), rest.sum(axis=0), rtol=2**-11)
    for k in range(4):
        found = entries_of(field, k)
        assert set(found) == set(np.flatnonzero(codes[k] != NOTHING).tolist())
        for pixel, (coefficient, p) in found.items():
            assert_coded(coefficient, r[k, pixel], peaks[pixel])
            # means in 8 bits, edges in 16
            atol = 0.5 / 255 + 1e-6 if codes[k, pixel] == LINEAR.code else 1e-5
            np.testing.assert_allclose(p, parameters[k, pixel][: len(p)], atol=atol)
            assert len(p) == {1: 0, 2: 2, 3: 4}[codes[k, pixel]]
    for name, code in (("nothing", 0), ("whole", 1), ("linear", 2), ("box", 3)):
        assert field.shares()[name] == pytest.approx((codes == code).mean())
    assert sum(field.shares().values()) == pytest.approx(1)
    counts = [(codes == c).sum() for c in (1, 2, 3)]
    data = counts[0] * 3 + counts[1] * (3 + 2) + counts[2] * (3 + 8)
    # a bit for each of 12 pixels where a patch has the model, and how many those are
    data += sum(2 * sum((row == c).any() for row in codes) for c in (1, 2, 3)) + 3 * 4 * 4
    data += 12 * 6 + 2 * 4  # a pixel's largest coefficient; units
    data += 12 * 6 + 4 * 4 + 12  # the rest of what was dropped, and whose it is
    assert field.bytes_per_pixel() * 12 == data


def test_a_patch_that_does_not_reach_a_material_takes_no_entry(
    tmp_path: Path, scene, write_scene, fitted
) -> None:
    """The left half sees the top alone, the right half the back alone."""
    made = scene(CUBE, unlit=0)
    basis = made.basis.copy()
    basis[:4, :, :, 4:] = 0
    basis[4:, :, :, :4] = 0
    folder = write_scene(tmp_path / "half", made._replace(basis=basis))
    for choice in ("auto", "box", "linear", "whole"):
        field = fitted(folder, tmp_path / choice, choice)
        codes = field.tiles[0].codes.reshape(8, 6, 8)
        dropped = 0
        if choice == "auto":  # drops what nobody would see
            size = basis[:, 0].sum(axis=-1)
            dropped = int((codes == REST).sum())
            assert size[codes == REST].sum() < DROPPED * size.sum()
            assert dropped < 10
        assert (codes != NOTHING).sum() == 8 * 48 / 2
        assert (codes[:4, :, 4:] == NOTHING).all() and (codes[4:, :, :4] == NOTHING).all()
        assert field.shares()["nothing"] == pytest.approx(0.5 + dropped / 8 / 48)
        assert sum(field.tiles[0].used.values()) == (codes != NOTHING).sum() - dropped


def test_opening_reads_no_arrays(tmp_path: Path, capture: Path, fitted, monkeypatch) -> None:
    fitted(capture, tmp_path / "field")

    def touched(*_: object) -> None:
        raise AssertionError("the file of a tile was opened")

    with monkeypatch.context() as m:
        m.setattr(tile_file, "_opened", touched)
        field = Field(tmp_path / "field")
        assert field.shares() and field.about.choice == "box"
        with pytest.raises(AssertionError):
            field.layer("alpha")
    for model in field.tiles[0].models:
        for array in (model.codes, model.parameters, model.bits, model.counts):
            assert isinstance(array.base, mmap.mmap) and not array.flags.writeable


def test_about_says_what_made_it(tmp_path: Path, scene) -> None:
    from arto.core.capture import capture_set

    made = scene(CUBE)
    capture_set.write(tmp_path / "c", CUBE, made.patterns, made.basis, scene="Shot 10", samples=8)
    steps = list(fit.fit(CaptureSet(tmp_path / "c"), tmp_path / "f", "auto"))
    about = Field(tmp_path / "f").about
    assert about.scene == "Shot 10" and about.samples == 8
    assert about.choice == "auto" and about.separate is False and about.view_layer is None
    assert about.fit_seconds is not None and about.read_seconds is not None
    assert about.fit_seconds >= about.read_seconds >= 0
    shares = [share for share, _ in steps]
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] == 1
    assert len(steps) == len(CUBE) + 2


# --- what is refused -----------------------------------------------------------------------------


@pytest.fixture
def field_folder(tmp_path: Path, capture: Path, fitted) -> Path:
    fitted(capture, tmp_path / "field")
    shutil.rmtree(capture)
    return tmp_path / "field"


def test_another_version(field_folder: Path, refused) -> None:
    head = parsed((field_folder / HEADER).read_text())
    for version in (VERSION + 1, 1, "3", 3.0, True, None):
        (field_folder / HEADER).write_text(json.dumps(head | {"version": version}))
        refused(
            field_folder, f"version {version}; this ARTO reads version {VERSION}, and 2: fit again"
        )


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "{}", "3"])
def test_a_damaged_header(field_folder: Path, refused, text: str) -> None:
    (field_folder / HEADER).write_text(text)
    refused(field_folder, HEADER)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("hemicube", {}),
        ("hemicube", None),
        ("height", "x"),
        ("tiles", [{}]),
        ("tiles", [{"file": "tile_0000.arto", "region": [0, 0], "entries": {}}]),
        ("tiles", [{"region": [0, 0, 8, 6], "entries": {}}]),
        ("tiles", [{"file": "tile_0000", "region": [0, 0, 8, 6], "entries": {}}]),
        ("tiles", [{"folder": "tile_0000.arto", "region": [0, 0, 8, 6], "entries": {}}]),
    ],
)
def test_a_header_that_lacks_something(
    field_folder: Path, refused, key: str, value: object
) -> None:
    head = parsed((field_folder / HEADER).read_text())
    (field_folder / HEADER).write_text(json.dumps(head | {key: value}))
    refused(field_folder, HEADER)


def test_a_model_of_the_future(field_folder: Path, refused) -> None:
    head = parsed((field_folder / HEADER).read_text())
    head["tiles"][0]["entries"]["gauss"] = 3
    (field_folder / HEADER).write_text(json.dumps(head))
    refused(field_folder, "'gauss'", "update ARTO")


def test_a_field_without_tiles_has_no_layers(tmp_path: Path) -> None:
    FieldWriter(tmp_path / "field", CUBE, (2, 2)).close()
    with pytest.raises(FieldError, match="holds no tiles"):
        Field(tmp_path / "field").layer("alpha")


def rest_field(folder: Path, coefficients: np.ndarray) -> Field:
    """A field of one row: (K, n, 3) coefficients through the choice as the fit makes it."""
    from arto.core.fit.choice import choose
    from arto.core.fit.evidence import evidence

    cube = Hemicube(patches=1)
    white = pattern_set("linear")
    k, n = coefficients.shape[:2]
    tile = TileWriter(Region(0, 0, n, 1), {"own": np.zeros((1, n, 3)), "alpha": np.ones((1, n))})
    known = evidence(coefficients.sum(axis=-1).astype(np.float32), (1, n), cube.solid_angles)
    uniform = [cube.uniform_moments(i)[[0, 1, 3]] for i in range(k)]
    for i in range(k):
        basis = uniform[i][:, None, None] * coefficients[i]
        codes, parameters = choose("auto", basis, coefficients[i], white, known, i, cube.extent(i))
        tile.add(codes, coefficients[i], parameters)
    writer = FieldWriter(folder, cube, (1, n))
    writer.add(tile)
    writer.close()
    return Field(folder)


def sun_in(cube: Hemicube, k: int) -> np.ndarray:
    """A black map, 64 high, with one texel of 1e5 in patch k."""
    image = np.zeros((64, 128, 3), np.float32)
    d = cube.directions(k, np.array(0.4), np.array(0.6))
    row = int((0.5 - np.arcsin(d[2]) / np.pi) * 64)
    column = int((0.5 - np.arctan2(d[1], d[0]) / (2 * np.pi)) * 128)
    image[row, column] = 1e5
    return image


def test_what_is_dropped_is_kept_as_a_rest(tmp_path: Path) -> None:
    """Under uniform light nothing is lost; under a sun in the one dropped patch nothing of it."""
    rng = np.random.default_rng(3)
    r = rng.uniform(0.5, 1, (6, 40, 3))
    r[2] *= 4e-4  # under a thousandth of each pixel, and dropped
    field = rest_field(tmp_path / "f", r)
    assert (field.tiles[0].codes[2] == REST).all()
    lit = relight(field, PatchLight(Environment.uniform(1.0), field.hemicube), own=0)[0, :, :3]
    np.testing.assert_allclose(lit, r.sum(axis=0), rtol=2**-11)
    light = PatchLight(Environment(sun_in(field.hemicube, 2)), field.hemicube)
    lit = relight(field, light, own=0)[0, :, :3]
    np.testing.assert_allclose(lit, r[2] * light.whole[2], rtol=2**-11)


def test_the_rest_is_lit_by_what_was_dropped_there(tmp_path: Path) -> None:
    """A sun in a patch without light in a pixel, or with an entry, is not in its rest; in one of
    two that were dropped, the rest has its share of it, and never more than all its light."""
    rng = np.random.default_rng(4)
    r = rng.uniform(0.5, 1, (6, 40, 3))
    r[2] *= 3e-4
    r[3] *= 2e-4
    r[2, :10] = 0
    r[3, 10:20] = 0
    field = rest_field(tmp_path / "f", r)
    codes = field.tiles[0].codes
    assert (codes[2, :10] == NOTHING).all() and (codes[2, 10:] == REST).all()

    def lit(k: int) -> np.ndarray:
        light = PatchLight(Environment(sun_in(field.hemicube, k)), field.hemicube)
        return relight(field, light, own=0)[0, :, :3] / light.whole[k]

    two, three, kept = lit(2), lit(3), lit(0)
    assert not two[:10].any() and not three[10:20].any()
    np.testing.assert_allclose(three[:10], r[3, :10], rtol=2**-11)
    np.testing.assert_allclose(two[10:20], r[2, 10:20], rtol=2**-11)
    np.testing.assert_allclose((two + three)[20:], (r[2] + r[3])[20:], rtol=2**-11)
    weights = r[2:4].sum(axis=(1, 2))
    np.testing.assert_allclose(
        two[20:], (r[2] + r[3])[20:] * weights[0] / weights.sum(), rtol=2**-11
    )
    assert_coded(kept, r[0], r.max(axis=0))


def test_a_coefficient_below_nothing_is_no_light(tmp_path: Path) -> None:
    """Patterns that do not fit together can give one; it takes no light from the pixel."""
    r = np.array([[1.0, -0.1, 0.5], [-1e-3, -1e-3, -1e-3], [-0.5, 0.25, -0.5]])
    tile = TileWriter(Region(0, 0, 3, 1), {"alpha": np.ones((1, 3))})
    tile.add(np.array([1, 0, 0], np.uint8), r, {WHOLE.code: np.empty((1, 0))})
    writer = FieldWriter(tmp_path / "f", Hemicube(faces=("top",), patches=1), (1, 3))
    writer.add(tile)
    writer.close()
    field = Field(tmp_path / "f")
    assert field.tiles[0].codes[0].tolist() == [WHOLE.code, NOTHING, REST]
    np.testing.assert_allclose(entries_of(field, 0)[0][0], [1, 0, 0.5], rtol=1e-3)
    rest = field.tiles[0].rest()
    np.testing.assert_allclose(rest, [[0, 0, 0], [0, 0, 0], [0, 0.25, 0]], rtol=2**-11)


def test_a_firefly_leaves_the_others_their_precision(tmp_path: Path) -> None:
    r = np.array([[[1e5, 1e5, 1e5], [1e-3, 2e-3, 3e-3], [1.0, 0.5, 0.25]]])
    tile = TileWriter(Region(0, 0, 3, 1), {})
    tile.add(np.full(3, WHOLE.code, np.uint8), r[0], {WHOLE.code: np.empty((3, 0))})
    writer = FieldWriter(tmp_path / "f", Hemicube(faces=("top",), patches=1), (1, 3))
    writer.add(tile)
    writer.close()
    found = entries_of(Field(tmp_path / "f"), 0)
    got = np.stack([found[p][0] for p in range(3)])
    np.testing.assert_allclose(got, r[0], rtol=2**-11 + 1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_refused_with_its_place(tmp_path: Path, bad: float) -> None:
    tile = TileWriter(Region(10, 20, 2, 1), {})
    good = np.ones((2, 3))
    tile.add(np.full(2, WHOLE.code, np.uint8), good, {WHOLE.code: np.empty((2, 0))})
    broken = good.copy()
    broken[1, 2] = bad
    with pytest.raises(
        FieldError,
        match=r"patch 1 has .* infinite or not a number in 1 pix.*, the first at \(11, 20\)",
    ):
        tile.add(np.full(2, WHOLE.code, np.uint8), broken, {WHOLE.code: np.empty((2, 0))})
