"""EXR files: what goes in comes out, and what is not whole is refused, quietly."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from arto.core import exr, files
from arto.core.errors import ExrError
from exr_tools import layers, same

pytestmark = pytest.mark.usefixtures("library")


def test_float_comes_back_to_the_bit(tmp_path: Path) -> None:
    given = layers()
    given["Depth"][0, :3] = np.nan, np.inf, -np.inf
    exr.write(tmp_path / "a.exr", given, finite=False)
    same(exr.read(tmp_path / "a.exr"), given)
    assert exr.part_names(tmp_path / "a.exr") == list(given)
    assert [f.name for f in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_no_picture_is_written_with_what_is_no_number(tmp_path: Path, bad: float) -> None:
    """Of no kind; the file that was there stays, and the message says where to look."""
    path, plane = tmp_path / "a.exr", np.ones((3, 4), np.float32)
    exr.write(path, {"": plane})
    kept, wrong = path.read_bytes(), plane.copy()
    wrong[1, 2] = bad
    parts = {"position": {"Z": wrong}}
    for write, layer in (
        (lambda: exr.write(path, {"key": wrong}), "key.Y"),
        (
            lambda: exr.write_layered(path, np.ones((3, 4, 4)), {"sky": np.dstack([wrong] * 3)}),
            "sky.R",
        ),
        (lambda: exr.write_planes(path, parts, {}), "position.Z"),
    ):
        with pytest.raises(
            ExrError, match=f"'{layer}' is .* in 1 pixels, the first at row 1, column 2"
        ):
            write()
    assert path.read_bytes() == kept
    exr.write_planes(path, parts, {}, handed_on=["position"])


@pytest.mark.parametrize("compression", exr.COMPRESSIONS)
def test_a_plate_is_packed_as_it_is_asked_for(tmp_path: Path, compression: str) -> None:
    rng, path = np.random.default_rng(0), tmp_path / "a.exr"
    (picture,) = exr.as_half(rng.random((40, 50, 4), np.float32))
    exr.write(path, {"": picture}, compression=compression)
    head = OpenEXR.File(str(path), header_only=True).header()
    assert head["compression"] == getattr(OpenEXR, f"{compression}_COMPRESSION")
    found = exr.read(path)[""]
    off = np.abs(found.astype(np.float32) - picture.astype(np.float32)).max()
    assert found.dtype == np.float16 and (0 < off < 0.1 if compression == "DWAA" else off == 0)


def test_half_is_taken_where_all_of_the_light_fits() -> None:
    for most, kind in ((65504, np.float16), (65600, np.float32), (-65600, np.float32)):
        pictures = [np.ones((2, 2)), np.full((2, 2), most, np.float32)]
        assert exr.as_half(*pictures)[1].dtype == kind


def test_the_speed_and_the_moment_are_in_the_header(tmp_path: Path) -> None:
    """Of the types that EXR has for them, in each part."""
    path, plane = tmp_path / "a.exr", np.ones((3, 4))
    about = {"framesPerSecond": Fraction(24000, 1001), "timeCode": exr.TimeCode(1, 2, 3, 4)}
    parts = {"albedo": dict.fromkeys("RGB", plane), "depth": {"Z": plane}}
    exr.write_planes(path, parts, about, colours={"albedo": "ACEScg"}, compression="ZIPS")
    one, two = (part.header for part in OpenEXR.File(str(path), header_only=True).parts)
    for head in (one, two):
        moment = head["timeCode"]
        assert head["framesPerSecond"] == Fraction(24000, 1001)
        assert (moment.hours, moment.minutes, moment.seconds, moment.frame) == (1, 2, 3, 4)
    # albedo is a colour, depth is not
    assert one["colorInteropID"] == "lin_ap1_scene" and two["colorInteropID"] == "data"


def test_half_stays_half_and_double_becomes_float(tmp_path: Path) -> None:
    half = np.random.default_rng(0).random((5, 4, 3)).astype(np.float16)
    exr.write(tmp_path / "a.exr", {"half": half, "double": half.astype(np.float64)})
    found = exr.read(tmp_path / "a.exr")
    assert found["half"].dtype == np.float16 and found["double"].dtype == np.float32
    np.testing.assert_array_equal(found["half"], half)
    np.testing.assert_array_equal(found["double"], half)


def test_rows_run_top_down_and_channels_keep_their_names(tmp_path: Path) -> None:
    """As another reader of the same file sees it."""
    pixels = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    exr.write(tmp_path / "a.exr", {"": pixels})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels = file.channels()
        assert set(channels) == {"R", "G", "B"}
        for n, name in enumerate("RGB"):
            np.testing.assert_array_equal(channels[name].pixels, pixels[..., n])
    same(exr.read(tmp_path / "a.exr"), {"": pixels})


def test_views_and_strides_are_written_as_they_look(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).random((9, 8, 3), np.float32)
    for view in (pixels[::-1, 1:7:2], pixels.transpose(1, 0, 2), pixels[..., ::-1]):
        exr.write(tmp_path / "a.exr", {"": view})
        np.testing.assert_array_equal(exr.read(tmp_path / "a.exr")[""], view)


@pytest.mark.parametrize(
    ("space", "interop"),
    [
        ("Linear Rec.709", "lin_rec709_scene"),
        ("ACEScg", "lin_ap1_scene"),
        ("Linear Rec.2020", "lin_rec2020_scene"),
        ("a studio's own", None),
    ],
)
def test_the_header_tells_the_colour_space(tmp_path: Path, space: str, interop) -> None:
    exr.write(
        tmp_path / "a.exr",
        layers(),
        attributes={"artoCamera": "Camera.001", "artoSamples": 128},
        colour_space=space,
    )
    head = exr.header(tmp_path / "a.exr")
    assert head["colorSpace"] == space
    assert head.get("colorInteropID") == interop
    assert head["artoCamera"] == "Camera.001" and head["artoSamples"] == 128


def test_channels_come_in_the_order_of_colour(tmp_path: Path) -> None:
    planes = {c: np.full((3, 4), n, np.float32) for n, c in enumerate("RGBAZ")}
    head = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(head, dict(planes)).write(str(tmp_path / "a.exr"))
    assert next(iter(exr.read(tmp_path / "a.exr").values()))[0, 0].tolist() == [0, 1, 2, 3, 4]
    normal = {f"Normal.{c}": np.full((3, 4), n, np.float32) for n, c in enumerate("XYZ")}
    OpenEXR.File(head, normal).write(str(tmp_path / "n.exr"))
    assert next(iter(exr.read(tmp_path / "n.exr").values()))[0, 0].tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    "head",
    [
        {"compression": c, "type": OpenEXR.scanlineimage}
        for c in (OpenEXR.NO_COMPRESSION, OpenEXR.ZIPS_COMPRESSION, OpenEXR.PIZ_COMPRESSION)
    ]
    + [
        {
            "compression": OpenEXR.ZIP_COMPRESSION,
            "type": OpenEXR.scanlineimage,
            "lineOrder": OpenEXR.DECREASING_Y,
        },
        {
            "compression": OpenEXR.ZIP_COMPRESSION,
            "type": OpenEXR.tiledimage,
            "tiles": OpenEXR.TileDescription(),
        },
    ],
    ids=["none", "zips", "piz", "decreasing", "tiled"],
)
def test_files_of_other_programs(tmp_path: Path, head: dict) -> None:
    """Bottom row first, tiles: whatever an HDRI may come as."""
    planes = np.random.default_rng(0).random((3, 70, 50), np.float32)
    path = tmp_path / "a.exr"
    OpenEXR.File(head, dict(zip("RGB", planes, strict=True))).write(str(path))
    found = next(iter(exr.read(path).values()))
    np.testing.assert_array_equal(found, np.moveaxis(planes, 0, -1))
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.7, 0.99):
        path.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(ExrError):
            exr.read(path)


@pytest.mark.parametrize("parts", [1, 3])
def test_a_truncated_file_is_refused_at_every_length(tmp_path: Path, capfd, parts: int) -> None:
    """The library would read what is left, fill the rest and print: wrong light, without a word
    that a program sees."""
    path = tmp_path / "a.exr"
    exr.write(path, dict(list(layers((40, 16)).items())[:parts]))
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    lengths = {*range(0, 600, 7), *rng.integers(0, len(whole), 200).tolist()}
    lengths |= {len(whole) - n for n in (1, 2, 4, 8, 100)}
    for length in sorted(lengths):
        path.write_bytes(whole[:length])
        for read in (exr.read, exr.part_names, exr.header):
            with pytest.raises(ExrError, match=r"a\.exr (is|cannot be read)"):
                read(path)
    said = capfd.readouterr()
    assert said.out == said.err == ""
    path.write_bytes(whole)
    exr.read(path)


def test_a_damaged_chunk_does_not_take_its_part_away(tmp_path: Path) -> None:
    """The library leaves out a part that it cannot decode."""
    path = tmp_path / "a.exr"
    smooth = np.linspace(0, 1, 64 * 64 * 3).reshape(64, 64, 3)  # so that it is compressed
    exr.write(path, {"a": smooth, "b": smooth**2, "c": smooth**3})
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 200] = bytes(200)
    path.write_bytes(data)
    with pytest.raises(ExrError, match="damaged"):
        exr.read(path)


def test_a_damaged_table_or_header_is_an_error_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    exr.write(path, {"": layers()["Combined"]})
    whole = path.read_bytes()
    end = whole.index(b"\0\0", whole.rindex(b"screenWindowWidth")) + 1
    table = next(
        at
        for at in range(end, end + 40)
        if whole[at + 1 : at + 8] in (b"\x01\0\0\0\0\0\0",)
        or 0 < int.from_bytes(whole[at : at + 8], "little") - at < 200
    )
    for at in (8, 20, table, table + 7, table + 8):
        data = bytearray(whole)
        data[at : at + 3] = b"\xff\xff\xff"
        path.write_bytes(data)
        with pytest.raises(ExrError):
            exr.read(path)


def test_missing_and_no_exr(tmp_path: Path) -> None:
    with pytest.raises(ExrError, match=r"there is no file .*none\.exr"):
        exr.read(tmp_path / "none.exr")
    with pytest.raises(ExrError, match="there is no file"):
        exr.read(tmp_path)
    for content in (b"", b"\x76\x2f", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n", b"\x89PNG" * 50):
        (tmp_path / "x.exr").write_bytes(content)
        with pytest.raises(ExrError, match="no EXR file"):
            exr.read(tmp_path / "x.exr")


def test_a_folder_is_made_and_an_old_file_replaced(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "a.exr"
    exr.write(path, layers(seed=0))
    exr.write(path, layers(seed=1))
    same(exr.read(path), layers(seed=1))
    assert [f.name for f in path.parent.iterdir()] == ["a.exr"]


def refused(path: Path, given: dict[str, np.ndarray]) -> None:
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(ExrError) as e:
        exr.write(path, given)
    assert str(path) in str(e.value) and "cannot be written" in str(e.value)
    assert "make room on the disk, or choose a folder" in str(e.value)
    assert not path.with_name(path.name + ".part").exists()
    assert (path.read_bytes() if path.is_file() else None) == before


def test_a_folder_that_cannot_be_written(read_only: Path) -> None:
    refused(read_only / "a.exr", layers())
    refused(read_only / "deeper" / "a.exr", layers())


def test_a_file_that_cannot_be_opened(tmp_path: Path, monkeypatch) -> None:
    exr.write(tmp_path / "a.exr", layers())

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("not yours")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ExrError, match=r"a\.exr cannot be read \(not yours\)"):
        exr.read(tmp_path / "a.exr")


def test_a_file_in_the_place_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    refused(tmp_path / "file" / "a.exr", layers())
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("size", [(200, 200), (60, 60)])
def test_a_full_disk_keeps_the_old_file(tiny_disk: Path, size: tuple[int, int]) -> None:
    path = tiny_disk / "a.exr"
    exr.write(path, layers((4, 4)))
    with (tiny_disk / "ballast").open("wb") as f:  # leave 16 kB
        f.write(bytes(256 * 1024 - 4 * 4096 - path.stat().st_size // 4096 * 4096 - 4096))
    refused(path, layers(size))
    same(exr.read(path), layers((4, 4)))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("size", [(2, 2), (200, 200)])
def test_a_write_that_fails_at_its_very_end_is_noticed(tmp_path: Path, size, monkeypatch) -> None:
    """A small file stays in a buffer until it is closed: the library then says nothing."""
    path = tmp_path / "a.exr"
    exr.write(path, layers((3, 3)))
    monkeypatch.setattr(files, "new_file", lambda partial: partial.symlink_to("/dev/full"))
    refused(path, {"": np.zeros((*size, 3), np.float32) + np.random.default_rng(0).random(3)})
    same(exr.read(path), layers((3, 3)))
