"""The capture set: what was captured comes back, and what would bend the light is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from arto.core import exr
from arto.core.capture import capture_set, names
from arto.core.capture import head as heads
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.head import HEADER, VERSION, CaptureHead
from arto.core.errors import CaptureSetError
from arto.core.hemicube import Hemicube
from arto.core.marked import MARK
from arto.core.patterns import PATTERN_SETS, pattern_set
from arto.core.region import Region
from arto.core.signed import parsed

CUBE = Hemicube(faces=("top", "back"), patches=2, half_sides=True, centre=(1.0, 2.0, 3.0))
FILE = "tile_0000.exr"
SMALL = CaptureHead(CUBE, pattern_set("white"), 6, 8)


@pytest.fixture
def folder(tmp_path: Path, scene, write_scene) -> Path:
    """A capture set of six patches under five patterns, 6x8."""
    return write_scene(tmp_path / "capture", scene(CUBE))


def change(folder: Path, **layers: np.ndarray | None) -> None:
    """Replace parts of the tile's file; None takes one away."""
    held = exr.read(folder / FILE) | layers
    exr.write(
        folder / FILE, {name: px for name, px in held.items() if px is not None}, finite=False
    )
    without_sums(folder)


def without_sums(folder: Path) -> None:
    """As the version before wrote it, which had no checksums."""
    tiles = parsed((folder / HEADER).read_text())["tiles"]
    change_header(folder, tiles=[{n: v for n, v in t.items() if n != "sums"} for t in tiles])


def change_header(folder: Path, **values: object) -> None:
    head = parsed((folder / HEADER).read_text())
    (folder / HEADER).write_text(json.dumps(head | values))


def refused(folder: Path, *says: str) -> str:
    """Opening or reading fails, and the message names and advises all of `says`."""
    with pytest.raises(CaptureSetError) as e:
        CaptureSet(folder).read(0)
    for text in says:
        assert text in str(e.value), (text, str(e.value))
    assert re.search("capture again|run Capture|Capture again", str(e.value))
    return str(e.value)


@pytest.mark.parametrize("patterns", list(PATTERN_SETS))
def test_round_trip(tmp_path: Path, scene, write_scene, patterns: str) -> None:
    made = scene(CUBE, patterns=patterns)
    found = CaptureSet(write_scene(tmp_path / "c", made))
    assert found.hemicube == CUBE
    assert found.patterns == pattern_set(patterns)
    assert found.shape == (6, 8) and found.pixels == 48
    assert found.regions == (Region(0, 0, 8, 6),)
    tile = found.read(0)
    assert tile.region == Region(0, 0, 8, 6)
    np.testing.assert_array_equal(tile.basis, made.basis)
    np.testing.assert_array_equal(tile.alpha, made.alpha)
    # what is left of the picture when the basis images are taken away
    rounding = 2e-7 * made.basis.sum(axis=(0, 1)).max() + 2e-7
    np.testing.assert_allclose(tile.own, made.own, atol=rounding)
    assert tile.guides == {}
    assert {f.name for f in (tmp_path / "c").iterdir()} == {HEADER, FILE}


def test_without_own_light_nothing_is_left_of_the_sum(tmp_path: Path, scene) -> None:
    """Exactly: rounding of hundreds of passes must not become a lamp."""
    cube = Hemicube(patches=4)
    made = scene(cube, (3, 4))
    capture_set.write(tmp_path / "c", cube, made.patterns, made.basis, samples=64)
    tile = CaptureSet(tmp_path / "c").read(0)
    np.testing.assert_array_equal(tile.own, 0)
    np.testing.assert_array_equal(tile.alpha, 1)
    assert CaptureSet(tmp_path / "c").head.samples == 64


@pytest.mark.parametrize("shape", [(6, 8), (1, 8), (6, 1), (1, 1)])
def test_guides_keep_their_shape(tmp_path: Path, scene, write_scene, shape) -> None:
    folder = write_scene(tmp_path / "c", scene(CUBE, shape))
    rng = np.random.default_rng(0)
    albedo, normal = rng.random((2, *shape, 3), np.float32)
    depth = rng.random(shape, np.float32)
    change(
        folder,
        **{
            "ViewLayer.Denoising Albedo": albedo,
            "ViewLayer.Denoising Normal": normal - 1,  # may be negative
            "Depth": depth,
            "ViewLayer.Mist": depth,  # nobody asked for it
        },
    )
    guides = CaptureSet(folder).read(0).guides
    assert set(guides) == {"albedo", "normal", "depth"}
    np.testing.assert_array_equal(guides["albedo"], albedo)
    np.testing.assert_array_equal(guides["normal"], normal - 1)
    np.testing.assert_array_equal(guides["depth"], depth)


def test_places_of_two_seeds_are_not_mixed(tmp_path: Path, scene, write_scene) -> None:
    """Albedos are averaged by their samples; a mean of two rays' depths is on neither's way."""
    folder = write_scene(tmp_path / "c", scene(CUBE))
    rng = np.random.default_rng(0)
    albedo, position = rng.random((2, 2, 6, 8, 3), np.float32)
    depth = np.stack([rng.random((6, 8), np.float32), np.full((6, 8), 1e10, np.float32)])
    held = exr.read(folder / FILE)
    for seed in (0, 1):
        guides = {"Denoising Albedo": albedo[seed], "Depth": depth[seed]}
        exr.write(folder / f"{seed}.exr", held | guides | {"Position": position[seed]})
    (tile,) = parsed((folder / HEADER).read_text())["tiles"]
    tile["files"] = ["0.exr", "1.exr"]
    tile["seeds"] = [[3, ["0.exr"]], [1, ["1.exr"]]]
    change_header(folder, tiles=[tile])
    found = CaptureSet(folder).read(0).guides
    np.testing.assert_allclose(found["albedo"], 0.75 * albedo[0] + 0.25 * albedo[1], rtol=1e-6)
    np.testing.assert_array_equal(found["depth"], depth[0])
    np.testing.assert_array_equal(found["position"], position[0])


def test_names_with_a_view_layer_are_understood(folder: Path, scene) -> None:
    """As Blender writes them."""
    held = exr.read(folder / FILE)
    exr.write(folder / FILE, {f"View Layer.{name}": px for name, px in held.items()})
    without_sums(folder)
    np.testing.assert_array_equal(CaptureSet(folder).read(0).basis, scene(CUBE).basis)


def test_layers_interleaved_in_one_part_are_the_same(folder: Path) -> None:
    """As Blender writes them in a scene that was saved before its version 5."""
    before = CaptureSet(folder).read(0)
    planes = {}
    for name, pixels in exr.read(folder / FILE).items():
        for n, c in enumerate("RGBA"[: pixels.shape[-1]]):
            planes[f"ViewLayer.{name}.{c}"] = np.ascontiguousarray(pixels[..., n])
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(head, planes).write(str(folder / FILE))
    without_sums(folder)
    after = CaptureSet(folder).read(0)
    for name in ("basis", "own", "alpha"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_an_image_that_was_changed_is_found(folder: Path) -> None:
    """Also where it is a whole file with light in it: of another render, for example."""
    held = exr.read(folder / FILE)
    name = next(name for name in held if name.startswith("Combined_ARTO"))
    held[name][0, 0] = 1e12
    exr.write(folder / FILE, held)
    refused(folder, f"{FILE} is not what was rendered: capture again")


def test_a_tile_may_lie_in_several_files(tmp_path: Path, scene, write_scene) -> None:
    """One render a group of patches: each file's Combined holds its own patches and the lamps."""
    made = scene(CUBE)
    folder = write_scene(tmp_path / "c", made)
    held = exr.read(folder / FILE)
    combined = held.pop("Combined")
    names = list(held)
    for n, part in enumerate((names[:11], names[11:])):
        sum_ = sum(held[name].astype(np.float64) for name in part) + made.own
        layers = {"Combined": np.dstack([sum_, combined[..., 3:]])}
        exr.write(folder / f"part_{n}.exr", layers | {name: held[name] for name in part})
    tile = {"region": [0, 0, 8, 6], "files": ["part_0.exr", "part_1.exr"], "done": True}
    change_header(folder, tiles=[tile])
    found = CaptureSet(folder).read(0)
    np.testing.assert_array_equal(found.basis, made.basis)
    np.testing.assert_allclose(found.own, made.own, atol=1e-5)
    # the same image in both files
    exr.write(folder / "part_1.exr", held | {"Combined": combined})
    refused(folder, "part_1.exr", "Combined_ARTO_0000_white", "there twice")


def test_a_name_says_patch_and_pattern() -> None:
    name = f"Combined_{names.group_name(7, 'gradient45')}"
    match = names.GROUP.search(f"ViewLayer.{name}")
    assert match and (int(match[1]), match[2]) == (7, "gradient45")
    assert names.GROUP.search(f"Not{name}") is None


# --- what is refused -----------------------------------------------------------------------------


def test_nothing_there(tmp_path: Path) -> None:
    refused(tmp_path / "none", "there is no capture set", str(tmp_path / "none"))


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "{}", '"x"', "\x00\x01"])
def test_a_damaged_header(folder: Path, text: str) -> None:
    (folder / HEADER).write_text(text)
    refused(folder, HEADER, "cannot be read")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("hemicube", None),
        ("hemicube", {"faces": ["top"]}),
        ("patterns", "stripes"),
        ("patterns", None),
        ("height", None),
        ("tiles", [{}]),
        ("tiles", 3),
        ("tiles", [{"region": [1, 2], "files": [], "done": True}]),
    ],
)
def test_a_header_that_lacks_something(folder: Path, key: str, value: object) -> None:
    change_header(folder, **{key: value})
    refused(folder, HEADER)


def test_bytes_that_are_no_text(folder: Path) -> None:
    (folder / HEADER).write_bytes(b"\xff\xfe\x80")
    refused(folder, HEADER, "cannot be read")


def test_another_version(folder: Path) -> None:
    change_header(folder, version=VERSION + 1)
    says = f"version {VERSION + 1}; this ARTO reads versions 1 and {VERSION}"
    refused(folder, says, "use the ARTO that made it")


def test_unfinished(folder: Path) -> None:
    head = parsed((folder / HEADER).read_text())
    tiles = [*head["tiles"], {"region": [0, 0, 8, 6], "files": [], "done": False}]
    change_header(folder, tiles=tiles)
    refused(folder, "unfinished (1 of 2 tiles)", "it goes on from there")
    assert len(CaptureSet(folder, unfinished=True).regions) == 2


def test_a_missing_file(folder: Path) -> None:
    (folder / FILE).unlink()
    refused(folder, f"there is no file {folder / FILE}", "run Capture again")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file(folder: Path, share: float) -> None:
    whole = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(whole[: int(len(whole) * share)])
    refused(folder, str(folder / FILE))


PART = "Combined_ARTO_0003_u2"


def test_a_missing_basis_image(folder: Path) -> None:
    change(folder, **{PART: None, "Combined_ARTO_0004_v": None})
    refused(folder, str(folder), "2 basis images", f"patch {CUBE.patch_name(3)} under 'u2'")


def test_no_files_at_all(folder: Path) -> None:
    change_header(folder, tiles=[{"region": [0, 0, 8, 6], "files": [], "done": True}])
    refused(folder, "lacks 30 basis images")


@pytest.mark.parametrize("part", ["Combined_ARTO_0099_u2", "Combined_ARTO_0003_uv"])
def test_a_basis_image_of_something_else(folder: Path, part: str) -> None:
    change(folder, **{part: np.zeros((6, 8, 3))})
    refused(folder, FILE, part, "not of this capture set")


def test_no_whole_picture(folder: Path) -> None:
    change(folder, Combined=None)
    refused(folder, FILE, "no part 'Combined'")


def test_another_size(folder: Path) -> None:
    change_header(folder, tiles=[{"region": [0, 0, 7, 6], "files": [FILE], "done": True}])
    refused(folder, FILE, "has the size 8x6 with 3 channels, not 7x6 with 3")


def test_another_count_of_channels(folder: Path) -> None:
    change(folder, **{PART: np.ones((6, 8, 4))})
    refused(folder, FILE, PART, "8x6 with 4 channels, not 8x6 with 3")
    change(folder, **{PART: np.ones((6, 8))})
    refused(folder, FILE, PART, "8x6 with 1 channels, not 8x6 with 3")


@pytest.mark.parametrize("part", [PART, "Combined"])
def test_half_floats(folder: Path, part: str) -> None:
    change(folder, **{part: exr.read(folder / FILE)[part].astype(np.float16)})
    refused(folder, FILE, part, "half floats put a floor under small supports", "32-bit float")


@pytest.mark.parametrize(
    ("part", "bad", "what"),
    [
        *((PART, bad, "negative, infinite") for bad in (np.nan, np.inf, -np.inf, -1e-6)),
        *(("Combined", bad, "infinite") for bad in (np.nan, np.inf, -np.inf)),
    ],
)
def test_pixels_that_are_no_light(folder: Path, part: str, bad: float, what: str) -> None:
    """A patch gives no light below 0; the scene's own lamps, which only Combined has, may."""
    pixels = exr.read(folder / FILE)[part].copy()
    pixels[4, 5, 1] = bad
    pixels[5, 0] = bad
    change(folder, **{part: pixels})
    refused(folder, FILE, part, f"2 pixels that are {what}", "the first at (5, 4)", "material")


def test_a_pixel_that_outshines_all_light_is_refused(folder: Path) -> None:
    """One of 1e12 took their precision from all others; the scene's own lamps may be so bright."""
    pixels = exr.read(folder / FILE)[PART].copy()
    pixels[2, 3] = 1e12
    change(folder, **{PART: pixels})
    refused(folder, FILE, PART, "too bright to be light of a patch", "the first at (3, 2)")
    pixels[2, 3] = 1
    combined = exr.read(folder / FILE)["Combined"].copy()
    combined[2, 3] = 1e12
    change(folder, **{PART: pixels, "Combined": combined})
    assert CaptureSet(folder).read(0).own[2, 3, 0] > 9e11


def test_a_negative_zero_is_no_error(folder: Path) -> None:
    change(folder, **{PART: np.full((6, 8, 3), -0.0)})
    there = CaptureSet(folder)
    assert (there.read(0).basis[3, there.patterns.patterns.index("u2")] == 0).all()


def test_a_header_that_cannot_be_written(read_only: Path, tmp_path: Path) -> None:
    with pytest.raises(CaptureSetError, match=r"capture\.json cannot be written .* make room"):
        heads.write(read_only / "c", SMALL)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(CaptureSetError, match=r"capture\.json cannot be written"):
        heads.write(tmp_path / "file", SMALL)


def test_a_header_is_replaced_whole_or_not_at_all(tiny_disk: Path) -> None:
    heads.write(tiny_disk, SMALL)
    with pytest.raises(CaptureSetError, match="make room on the disk"):
        heads.write(tiny_disk, replace(SMALL, others={"long": "x" * 300_000}))
    assert heads.read(tiny_disk) == SMALL
    assert sorted(f.name for f in tiny_disk.iterdir()) == sorted([HEADER, MARK])
