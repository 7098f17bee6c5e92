"""Display and data windows: other readers see each pixel where it belongs, and ours all of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from arto.core import exr
from arto.core.errors import ExrError
from arto.core.exr.window import Window

pytestmark = pytest.mark.usefixtures("library")

SIZE = (23, 37)


def picture(rows: slice, columns: slice, channels: int = 4) -> np.ndarray:
    """Something in a part of a picture, nothing elsewhere."""
    out = np.zeros((*SIZE, channels), np.float32)
    shape = out[rows, columns].shape
    out[rows, columns] = np.random.default_rng(0).uniform(0.1, 1, shape)
    return out


def box(*corners: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array(corners[:2], np.int32), np.array(corners[2:], np.int32)


def delivered(path: Path, part: int = 0) -> tuple[np.ndarray, OpenImageIO.ImageSpec]:
    """What another reader has of the display window, 0 where there are no pixels."""
    image = OpenImageIO.ImageBuf(str(path), part, 0)
    spec = image.spec()
    roi = OpenImageIO.get_roi_full(spec)
    return image.get_pixels("float", roi), spec


@pytest.mark.parametrize("overscan", [0, 1, 4])
@pytest.mark.parametrize("crop", [False, True])
def test_each_pixel_is_where_another_reader_expects_it(tmp_path, overscan, crop):
    pixels = picture(slice(3, 15), slice(2, 30))
    exr.write(tmp_path / "a.exr", {"": pixels}, window=Window(overscan, crop))
    found, spec = delivered(tmp_path / "a.exr")
    n = overscan
    height, width = SIZE
    assert (spec.full_x, spec.full_y) == (0, 0)
    assert (spec.full_width, spec.full_height) == (width - 2 * n, height - 2 * n)
    if crop:
        assert (spec.x, spec.y, spec.width, spec.height) == (2 - n, 3 - n, 28, 12)
    else:
        assert (spec.x, spec.y, spec.width, spec.height) == (-n, -n, width, height)
    np.testing.assert_array_equal(found, pixels[n : height - n, n : width - n])
    # and ours comes back as it was, to the bit and in its size
    np.testing.assert_array_equal(exr.read(tmp_path / "a.exr")[""], pixels)


def test_without_a_window_nothing_is_said(tmp_path):
    """Files are as they were before there were windows."""
    pixels = picture(slice(3, 15), slice(2, 30))
    exr.write(tmp_path / "a.exr", {"": pixels})
    head = exr.header(tmp_path / "a.exr")
    for name in ("dataWindow", "displayWindow"):
        assert head[name] == (0, 0, 36, 22)
    assert not any("picture" in name for name in head)


@pytest.mark.parametrize("overscan", [0, 3])
def test_an_empty_picture_keeps_a_pixel(tmp_path, overscan):
    exr.write(tmp_path / "a.exr", {"": np.zeros((*SIZE, 4))}, window=Window(overscan, True))
    found, spec = delivered(tmp_path / "a.exr")
    assert (spec.width, spec.height) == (1, 1) and (spec.x, spec.y) == (0, 0)
    assert not found.any()
    assert exr.read(tmp_path / "a.exr")[""].shape == (*SIZE, 4)


def test_what_is_not_a_number_is_something(tmp_path):
    pixels = np.zeros((*SIZE, 3), np.float32)
    pixels[5, 7, 1], pixels[8, 4, 2] = np.nan, -0.5
    exr.write(tmp_path / "a.exr", {"": pixels}, window=Window(crop=True), finite=False)
    _, spec = delivered(tmp_path / "a.exr")
    assert (spec.x, spec.y, spec.width, spec.height) == (4, 5, 4, 4)
    np.testing.assert_array_equal(exr.read(tmp_path / "a.exr")[""], pixels)


def test_parts_of_a_file_are_cut_alike(tmp_path):
    """Around what any of them has; so are layers of one part."""
    parts = {"one": {"Z": picture(slice(2, 5), slice(9, 12), 1)[..., 0]},
             "two": {"X": picture(slice(10, 20), slice(30, 31), 1)[..., 0],
                     "Y": np.zeros(SIZE)}}  # fmt: skip
    window = Window(2, True)
    exr.write_planes(tmp_path / "a.exr", parts, {"note": "x"}, window)
    for part in (0, 1):
        _, spec = delivered(tmp_path / "a.exr", part)
        assert (spec.x, spec.y, spec.width, spec.height) == (7, 0, 22, 18)
    for (head, channels), (name, given) in zip(
        exr.whole_parts(tmp_path / "a.exr"), parts.items(), strict=True
    ):
        assert head["name"] == name and head["note"] == "x"
        for channel, plane in given.items():
            np.testing.assert_array_equal(channels[channel], plane.astype(np.float32))
    beauty, layer = picture(slice(2, 5), slice(9, 12)), picture(slice(10, 20), slice(30, 31), 3)
    exr.write_layered(tmp_path / "b.exr", beauty, {"key": layer}, window=window)
    _, spec = delivered(tmp_path / "b.exr")
    assert (spec.x, spec.y, spec.width, spec.height) == (7, 0, 22, 18)
    found = exr.read(tmp_path / "b.exr")
    np.testing.assert_array_equal(found[""], beauty)
    np.testing.assert_array_equal(found["key"], layer)


@pytest.mark.parametrize("compression", ["NO", "ZIP"])
@pytest.mark.parametrize(
    ("display", "data", "size"),
    [
        ((0, 0, 15, 11), (3, 2, 10, 7), (12, 16)),  # cropped
        ((0, 0, 3, 1), (-2, -2, 5, 3), (6, 8)),  # overscan
        ((0, 0, 5, 3), (3, 2, 10, 7), (8, 11)),  # both
        ((100, 50, 107, 55), (100, 50, 107, 55), (6, 8)),  # somewhere
    ],
)
def test_files_of_other_programs_are_read_whole(tmp_path, compression, display, data, size):
    """All of the display window, and what there is beyond it."""
    pixels = np.random.default_rng(0).random((6, 8), np.float32)
    head = {
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
        "type": OpenEXR.scanlineimage,
        "displayWindow": box(*display),
        "dataWindow": box(*data),
    }
    path = tmp_path / "a.exr"
    OpenEXR.File(head, {"Y": pixels}).write(str(path))
    found = exr.read(path)[""][..., 0]
    assert found.shape == size
    y, x = max(data[1] - display[1], 0), max(data[0] - display[0], 0)
    np.testing.assert_array_equal(found[y : y + 6, x : x + 8], pixels)
    assert np.count_nonzero(found) == np.count_nonzero(pixels)


def test_an_overscan_that_cannot_be_is_said(tmp_path):
    pixels = picture(slice(3, 15), slice(2, 30))
    said = {
        -1: "-1 pixels cannot be",
        12: "leaves nothing of a picture of 37x23",
        1000: "2000 more",
    }
    for overscan, words in said.items():
        with pytest.raises(ExrError, match=words):
            exr.write(tmp_path / "a.exr", {"": pixels}, window=Window(overscan))
        assert not list(tmp_path.iterdir())
    exr.write(tmp_path / "a.exr", {"": pixels}, window=Window(11))
    assert delivered(tmp_path / "a.exr")[0].shape == (1, 15, 4)


def test_a_window_of_a_damaged_header_makes_no_room(tmp_path):
    """A display window is a claim: nobody makes memory for one of the whole number line."""
    head = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "displayWindow": box(0, 0, 200_000, 200_000),
        "dataWindow": box(0, 0, 7, 5),
    }
    path = tmp_path / "a.exr"
    OpenEXR.File(head, {"Y": np.ones((6, 8), np.float32)}).write(str(path))
    with pytest.raises(ExrError, match="damaged, its windows make a picture of 200001x"):
        exr.read(path)
