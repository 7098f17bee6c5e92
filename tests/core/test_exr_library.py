"""Two libraries of EXR files behind one door: what one writes, the other reads as it was."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO
import pytest
from arto.core import exr
from arto.core.errors import ExrError
from arto.core.exr import open_image_io
from arto.core.exr.attributes import Raw, decoded, encoded
from arto.core.exr.head import LayoutError
from arto.core.exr.window import Window
from exr_tools import headers_of

LIBRARIES = {"OpenEXR": exr.OpenExr(), "OpenImageIO": exr.OpenImageIo(OpenImageIO)}
# All that a header of ours may say, and what OpenImageIO drops or takes for something else.
SAID = {
    "arto.key": '{"a": [1, 2]}', "arto.empty": "", "Note": "nächste Fassung",
    "cryptomatte/1a2b3c4/manifest": '{"a": "00000001"}', "Date": "2026/01/02 03:04:05",
    "capDate": "2026:01:02 03:04:05", "DateTime": "x", "owner": "a", "Software": "Blender",
    "oiio:ColorSpace": "x", "tiff:a": "b", "exif:a": "b",
    "a name of more than thirty-one letters": "a",
    "openexr:lineOrder": "decreasingY", "compression ": "b", "worldToCamera": "c", "fps": "25",
    "arto.whole": -(2**31), "arto.number": 0.1, "pixelAspectRatio": 1.5, "arto.four": (1, 2, 3, 4),
    "arto.two": (-1, 2), "arto.three": (1.0, 2.0, 3.5), "arto.texts": ("a", "", "ü"),
    "framesPerSecond": Fraction(24000, 1001), "timeCode": exr.TimeCode(23, 59, 59, 29),
    "arto.raw": Raw(b"keycode", struct.pack("<7i", 1, 2, 3, 4, 5, 4, 64)),
}  # fmt: skip


@pytest.fixture(autouse=True)
def kept() -> Iterator[None]:
    before = exr.chosen()
    yield
    exr.choose(before)


def pictures(size: tuple[int, int] = (70, 33)) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    sizes = {"": 4, "sky": 3, "a layer of quite a long name, such as are given": 3, "Z": 1}
    kinds = ("f2", "f4", "f2", "f4")
    return {
        name: rng.normal(size=(*size, n)).astype(kind)
        for (name, n), kind in zip(sizes.items(), kinds, strict=True)
    }


@pytest.mark.parametrize("compression", ["NO", *exr.COMPRESSIONS])
@pytest.mark.parametrize("window", [Window(), Window(3, True)], ids=["full", "cropped"])
@pytest.mark.parametrize("count", [1, 4])
def test_a_file_is_the_same_whoever_wrote_it(
    tmp_path: Path, count: int, window: Window, compression: str
) -> None:
    given = dict(list(pictures().items())[:count])
    for picture in given.values():
        picture[:9] = 0  # so that there is something to crop
    files, found, heads = {}, {}, {}
    for name, library in LIBRARIES.items():
        exr.choose(library)
        path = files[name] = tmp_path / f"{name}.exr"
        exr.write(path, given, SAID, "ACEScg", window, compression=compression)
    for name, library in LIBRARIES.items():
        exr.choose(library)
        for file, path in files.items():
            found[name, file], heads[name, file] = exr.read(path), exr.header(path)
    one, other = (headers_of(path) for path in files.values())
    assert one == other
    first = found.popitem()[1]
    for read in found.values():
        assert list(read) == list(first)
        for layer, pixels in read.items():
            assert pixels.dtype == first[layer].dtype
            np.testing.assert_array_equal(pixels, first[layer])
    for head in heads.values():
        assert {key: head[key] for key in SAID} == SAID | {"arto.number": pytest.approx(0.1)}
    if compression != "DWAA":
        for pixels, written in zip(first.values(), given.values(), strict=True):
            np.testing.assert_array_equal(pixels, written)
    # and the package says the same of the header, whose values it parses by itself
    head = OpenEXR.File(str(path), header_only=True).parts[0].header
    assert head["arto.empty"] == "" and head["framesPerSecond"] == Fraction(24000, 1001)
    assert head["timeCode"].hours == 23 and list(head["arto.texts"]) == ["a", "", "ü"]
    assert [corner.tolist() for corner in head["arto.four"]] == [[1, 2], [3, 4]]
    assert head["arto.whole"] == -(2**31) and head["compression"].name.startswith(compression)


@pytest.mark.parametrize("kind", ["scanlineimage", "tiledimage"])
def test_bands_join_without_a_seam(tmp_path: Path, monkeypatch, kind: str) -> None:
    """Pixels pass by in bands, so that memory holds them once: here of a few lines each."""
    monkeypatch.setattr(open_image_io, "_BAND_BYTES", 4096)
    rng, path = np.random.default_rng(0), tmp_path / "a.exr"
    planes = {
        "A": rng.random((150, 41)).astype("f2"),
        "B.X": rng.random((150, 41)).astype("f4"),
        "id": rng.integers(0, 2**32, (150, 41), np.uint32),
    }
    for compression in ("ZIP", "ZIPS", "PIZ", "RLE", "NO"):
        tile = OpenEXR.TileDescription()
        tile.xSize, tile.ySize = 16, 24
        head = {
            "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
            "type": getattr(OpenEXR, kind),
            "tiles": tile,
            "displayWindow": (np.array((-4, -7), np.int32), np.array((36, 142), np.int32)),
            "dataWindow": (np.array((-4, -7), np.int32), np.array((36, 142), np.int32)),
        }
        if kind == "scanlineimage":
            del head["tiles"]
        try:
            OpenEXR.File(head, dict(planes)).write(str(path))
        except Exception as e:
            pytest.skip(f"the package writes no tiles ({e})")
        exr.choose(LIBRARIES["OpenImageIO"])
        ((_, found),) = exr.whole_parts(path)
        for name, plane in planes.items():
            assert found[name].dtype == plane.dtype
            np.testing.assert_array_equal(found[name], plane)
    exr.write(path, {"": rng.random((150, 41, 3))})
    exr.choose(LIBRARIES["OpenEXR"])
    rng = np.random.default_rng(0)
    [rng.random((150, 41)) for _ in range(2)], rng.integers(0, 2**32, (150, 41), np.uint32)
    np.testing.assert_array_equal(exr.read(path)[""], rng.random((150, 41, 3)).astype("f4"))


@pytest.mark.parametrize("name", LIBRARIES)
def test_what_cannot_be_stored_as_asked_is_not_stored_as_something_else(
    tmp_path: Path, name: str
) -> None:
    """A library may know a compression and take another: its file is not handed over."""
    exr.choose(LIBRARIES[name])
    for compression in ("HTJ2K256", "PIZ"):
        path = tmp_path / f"{compression}.exr"
        try:
            exr.write(path, pictures(), compression=compression)
        except ExrError as e:
            assert "cannot be written" in str(e) and not path.exists()
        else:
            with exr.Layers(path):
                assert exr.header(path)["compression"] == compression


@pytest.mark.parametrize("value", [None, 2**31, 1.5e39, True, (1, 2.0), (), {"a": 1}, "\ud83d"])
def test_what_no_header_holds_is_refused_by_name(tmp_path: Path, value: object) -> None:
    with pytest.raises(ExrError, match=r"cannot say arto\.key = "):
        exr.write(tmp_path / "a.exr", {"": np.ones((2, 2))}, {"arto.key": value})
    for name in ("", "a\0b", "a" * 256):
        with pytest.raises(ExrError, match="of the name"):
            exr.write(tmp_path / "a.exr", {"": np.ones((2, 2))}, {name: "a"})
    assert not list(tmp_path.iterdir())


def test_attributes_that_others_wrote_are_read_or_kept() -> None:
    """A part of a known kind that has another length is damage; what is unknown is handed on."""
    for kind, data in {
        b"int": bytes(3), b"box2i": bytes(15), b"v2f": bytes(9), b"compression": b"",
        b"stringvector": struct.pack("<I", 9) + b"a", b"timecode": bytes(7), b"string": b"\xff",
    }.items():  # fmt: skip
        with pytest.raises(LayoutError):
            decoded(kind, data)
    for kind, data in {
        b"rational": struct.pack("<iI", 1, 0), b"timecode": struct.pack("<II", 0x40, 0),
        b"preview": bytes(9), b"string ": b"\xff",
    }.items():  # fmt: skip
        assert encoded("a", decoded(kind, data)) == (kind, data)


@pytest.mark.parametrize("name", LIBRARIES)
def test_names_that_mean_something_to_a_library_are_names(tmp_path: Path, name: str) -> None:
    """OpenImageIO has formats by endings, and options after a question mark."""
    exr.choose(LIBRARIES[name])
    given = {"a": np.ones((2, 3, 3), np.float32)}
    for file in ("a?b=c.exr", "x.tif", "ä 日.EXR", "no ending", "a%04d#<UDIM>*.exr", "x.exr.part"):
        if os.name == "nt" and set(file) & set('<>?*"|'):
            continue
        exr.write(tmp_path / file, given)
        assert (tmp_path / file).is_file()
        np.testing.assert_array_equal(exr.read(tmp_path / file)["a"], given["a"])
    with pytest.raises(ExrError, match="is no UTF-8"):
        exr.write(tmp_path / "\udcff.exr", given)


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no list of open files here")
@pytest.mark.parametrize("name", LIBRARIES)
def test_no_file_stays_open(tmp_path: Path, name: str) -> None:
    """Not after an error either, in which a library may forget it."""
    exr.choose(LIBRARIES[name])
    path, bad = tmp_path / "a.exr", tmp_path / "bad.exr"
    exr.write(path, pictures())
    data = bytearray(path.read_bytes())
    data[len(data) // 2 :: 3] = bytes(len(data[len(data) // 2 :: 3]))
    bad.write_bytes(data)
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(3):
        exr.read(path), exr.part_names(path), exr.write(path, pictures())
        with pytest.raises(ExrError):
            exr.read(bad)
        with pytest.raises(ExrError):
            exr.write(tmp_path / "b.exr", pictures(), compression="none")
        with pytest.raises(ExrError):
            exr.write(path / "b.exr", pictures())
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_file_of_many_channels_changes_no_limit_of_others(tmp_path: Path) -> None:
    before = OpenImageIO.get_int_attribute("limits:channels")
    many = {f"L{n:04d}.Y": np.full((1, 2), n, "f4") for n in range(before + 2)}
    path = tmp_path / "a.exr"
    exr.choose(LIBRARIES["OpenImageIO"])
    exr.write_planes(path, {"": many}, {})
    assert exr.read(path)[f"L{before:04d}"][0, 0] == before
    assert OpenImageIO.get_int_attribute("limits:channels") == before
    more = many | {f"M{n:04d}.Y": np.ones((1, 2), "f4") for n in range(4096)}
    exr.choose(LIBRARIES["OpenEXR"])
    exr.write_planes(path, {"": more}, {})
    exr.choose(LIBRARIES["OpenImageIO"])
    with pytest.raises(ExrError, match="and OpenImageIO reads 4096: save its layers as parts"):
        exr.read(path)


def test_a_library_that_is_missing_is_named_and_not_replaced(tmp_path: Path, monkeypatch) -> None:
    exr.choose(LIBRARIES["OpenEXR"])
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(ExrError, match="pip install OpenEXR"):
        exr.write(tmp_path / "a.exr", {"": np.ones((2, 2))})
    monkeypatch.delitem(sys.modules, "OpenImageIO")
    monkeypatch.setattr(open_image_io.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ExrError, match="python3-openimageio"):
        exr.imported([tmp_path])
    assert not list(tmp_path.iterdir())
