"""The file of a tile: what docs/field-format.md says of it; damaged ones are refused."""

from __future__ import annotations

import json
import os
import struct
import threading
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arto.core.errors import FieldError
from arto.core.field import tile_file
from arto.core.field.field import Field
from arto.core.field.tile_file import ALIGNED, TileFile, rewrite, written
from arto.core.hemicube import Hemicube
from arto.core.marked import MARK

CUBE = Hemicube(faces=("top", "back"), patches=2)
# As docs/field-format.md has it.
HEAD = struct.Struct("<8sIIQQII")
ARRAYS = ["peaks", "scales", "own", "alpha"]
ARRAYS += [f"box_{name}" for name in ("coefficient", "parameters", "pixels", "counts")]
REST = ["rest", "rest_weights", "rest_patches"]


@pytest.fixture
def folder(tmp_path: Path, scene, write_scene, fitted) -> Path:
    """A field of one tile."""
    fitted(write_scene(tmp_path / "capture", scene(CUBE)), tmp_path / "field")
    return tmp_path / "field"


@pytest.fixture
def tile(folder: Path) -> Path:
    return folder / "tile_0000.arto"


def index_of(content: bytes) -> list[dict[str, Any]]:
    _, _, _, offset, length, _, _ = HEAD.unpack_from(content)
    return json.loads(content[offset : offset + length])


def with_index(content: bytes, index: Any) -> bytes:
    """The file with another index, whose checksums are right."""
    text = index if isinstance(index, bytes) else json.dumps(index).encode()
    offset = HEAD.unpack_from(content)[3]
    head = HEAD.pack(b"ARTOTILE", 1, 0, offset, len(text), zlib.crc32(text), 0)[:-4]
    head += struct.pack("<I", zlib.crc32(head))
    return head + content[len(head) : offset] + text


def test_the_file_is_what_the_page_says(tile: Path, folder: Path) -> None:
    content = tile.read_bytes()
    magic, version, nothing, offset, length, of_index, of_head = HEAD.unpack_from(content)
    assert (magic, version, nothing) == (b"ARTOTILE", 1, 0)
    assert of_head == zlib.crc32(content[: HEAD.size - 4])
    assert of_index == zlib.crc32(content[offset : offset + length])
    assert offset + length == len(content)
    index = index_of(content)
    names = [entry["name"] for entry in index]
    assert set(names) >= {*ARRAYS} and len(set(names)) == len(names)
    end = 64
    there = TileFile(tile)
    for entry in index:
        assert entry["offset"] % 64 == 0 and end <= entry["offset"] < end + 64
        end = entry["offset"] + entry["bytes"]
        data = content[entry["offset"] : end]
        assert entry["crc32"] == zlib.crc32(data)
        array = np.frombuffer(data, f"<{entry['type']}").reshape(entry["shape"])
        found = there.load(entry["name"])
        np.testing.assert_array_equal(found, array)
        assert found.ctypes.data % ALIGNED == 0 and not found.flags.writeable
    assert there.load("peaks").shape == (48, 3) and there.load("peaks").dtype == np.float16


def test_arrays_come_back_whatever_their_layout(tmp_path: Path) -> None:
    """Big endian, columns first, views, and of no size."""
    rng = np.random.default_rng(0)
    given = {
        "big": rng.random((3, 5)).astype(">f4"),
        "columns": np.asfortranarray(rng.random((4, 6)).astype(np.float16)),
        "view": rng.integers(0, 256, (9, 9), np.uint8)[1::2, ::3],
        "none": np.empty((3, 0), np.uint16),
        "own_key ~light": rng.random((2, 2, 3)).astype(np.float32),
    }
    with written(tmp_path / "a.arto") as out:
        for name, array in given.items():
            out.add(name, array)
    there = TileFile(tmp_path / "a.arto")
    assert there.sizes == {name: array.nbytes for name, array in given.items()}
    for name, array in given.items():
        np.testing.assert_array_equal(there.load(name), array)


@pytest.mark.parametrize("name", ARRAYS)
def test_an_array_that_is_missing_or_of_another_shape(
    folder: Path, tile: Path, put_arrays, arrays_of, used, refused, name: str
) -> None:
    right = arrays_of(tile)
    used(folder)
    put_arrays(tile, **{name: right[name][:-1]})
    refused(folder, "tile_0000.arto", f"'{name}'")
    put_arrays(tile, **{name: right[name].astype(np.uint32 if name != "box_counts" else "u1")})
    if name in ("own", "alpha"):  # which are read in any type
        used(folder)
    else:
        refused(folder, "tile_0000.arto", f"'{name}'")
    put_arrays(tile, **{name: None})
    refused(folder, "tile_0000.arto", f"lacks '{name}'")


def test_bits_and_counts_that_do_not_fit_the_entries(
    folder: Path, tile: Path, put_arrays, arrays_of, used, refused
) -> None:
    for name in ("box_pixels", "box_counts"):
        right = arrays_of(tile)[name]
        wrong = right.copy()
        wrong.flat[0] = 0 if right.flat[0] else 1
        put_arrays(tile, **{name: wrong})
        refused(folder, "damaged, its counts differ")
        put_arrays(tile, **{name: right})
    used(folder)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0])
@pytest.mark.parametrize("name", ["peaks", "scales"])
def test_what_is_no_light_is_refused(
    folder: Path, tile: Path, put_arrays, arrays_of, refused, name: str, bad: float
) -> None:
    wrong = arrays_of(tile)[name]
    wrong.flat[1] = bad
    put_arrays(tile, **{name: wrong})
    refused(folder, f"'{name}' has what is no light")


def test_the_rest_is_checked_as_the_other_arrays_are(
    tmp_path: Path, scene, write_scene, fitted, put_arrays, arrays_of, used, refused
) -> None:
    made = scene(CUBE, unlit=0)
    basis = made.basis.copy()
    basis[2] *= 1e-4  # too small to be an entry
    fitted(write_scene(tmp_path / "c", made._replace(basis=basis)), tmp_path / "f", "auto")
    folder, tile = tmp_path / "f", tmp_path / "f" / "tile_0000.arto"
    right = arrays_of(tile)
    assert right["rest"].any()
    for name in REST:
        put_arrays(tile, **{name: right[name][:-1]})
        refused(folder, f"'{name}'")
        put_arrays(tile, **{name: right[name]})
        if name != "rest":  # without which there is none
            put_arrays(tile, **{name: None})
            refused(folder, f"lacks '{name}'")
            put_arrays(tile, **{name: right[name]})
    for name in REST[:2]:
        wrong = right[name].copy()
        wrong.flat[0] = np.nan
        put_arrays(tile, **{name: wrong})
        refused(folder, f"'{name}' has what is no light")
        put_arrays(tile, **{name: right[name]})
    used(folder)


# --- a damaged file -------------------------------------------------------------------------------


def test_a_file_that_is_cut(folder: Path, tile: Path, used, refused) -> None:
    """Anywhere; and one that is longer than it was."""
    content = tile.read_bytes()
    lengths = {0, 1, 7, 8, 43, 44, 63, 64, len(content) - 1, *range(0, len(content), 97)}
    for length in sorted(lengths):
        tile.write_bytes(content[:length])
        refused(folder, "tile_0000.arto is missing or damaged")
    for other in (content + b"\0", b"no tile at all, but some text", bytes(len(content))):
        tile.write_bytes(other)
        refused(folder, "tile_0000.arto is missing or damaged")
    tile.unlink()
    refused(folder, "tile_0000.arto is missing or damaged")
    tile.mkdir()
    refused(folder, "is no regular file")
    tile.rmdir()
    tile.write_bytes(content)
    used(folder)


def test_every_bit_of_the_head_and_many_of_the_index(folder: Path, tile: Path) -> None:
    """A checksum tells of each."""
    content = tile.read_bytes()
    offset = HEAD.unpack_from(content)[3]
    index = np.random.default_rng(1).choice(8 * (len(content) - offset), 300, replace=False)
    for bit in [*range(8 * HEAD.size), *(8 * offset + index).tolist()]:
        wrong = bytearray(content)
        wrong[bit // 8] ^= 1 << bit % 8
        tile.write_bytes(wrong)
        with pytest.raises(FieldError, match=r"fit again"):
            TileFile(tile)


def test_bits_of_the_arrays(folder: Path, tile: Path, used) -> None:
    """Each is found before a picture is made of it; and nothing copies what was not written."""
    content = tile.read_bytes()
    rng = np.random.default_rng(2)
    entries = index_of(content)
    for _ in range(100):
        entry = entries[rng.integers(len(entries))]
        at = entry["offset"] + int(rng.integers(entry["bytes"]))
        wrong = bytearray(content)
        wrong[at] ^= 1 << int(rng.integers(8))
        tile.write_bytes(wrong)
        says = f"'{entry['name']}' is not what was written"
        with pytest.raises(FieldError, match=says):
            used(folder)
        with pytest.raises(FieldError, match=says):
            rewrite(tile, {"depth": np.ones((6, 8), np.float32)})
        assert tile.read_bytes() == bytes(wrong)
    assert {p.name for p in folder.iterdir() if p.is_file()} == {MARK, "field.json", tile.name}


def test_a_whole_tile_of_another_field_is_found(
    tmp_path: Path, folder: Path, tile: Path, scene, write_scene, fitted, refused, used
) -> None:
    """Also where all else of it is the same; layers that were denoised since do no harm."""
    made = scene(CUBE)
    brighter = made._replace(basis=2 * made.basis)
    fitted(write_scene(tmp_path / "other", brighter), tmp_path / "of")
    rewrite(
        tile, {"albedo": np.ones((6, 8, 3), np.float16), "own_a_pixels": np.ones((6, 8, 3), "f2")}
    )
    used(folder)
    tile.write_bytes((tmp_path / "of" / tile.name).read_bytes())
    refused(folder, "is of another field")


def put(index: list[dict[str, Any]], key: str, value: Any) -> list[dict[str, Any]]:
    return [{**index[0], key: value}, *index[1:]]


WRONG: dict[str, Callable[[list[dict[str, Any]]], Any]] = {
    "no list": lambda index: {"arrays": index},
    "no json": lambda index: b"{",
    "no text": lambda index: b"\xff\xfe",
    "no end": lambda index: b"[" * 100000,
    "too many": lambda index: [{**index[0], "name": f"a{n}"} for n in range(5000)],
    "an entry of nothing": lambda index: [*index, {}],
    "an entry that is none": lambda index: [*index, 3],
    "too much": lambda index: [{**index[0], "more": 1}, *index[1:]],
    "two of a name": lambda index: put(index, "name", index[1]["name"]),
    "one over the other": lambda index: put(index, "offset", index[1]["offset"]),
    "over the head": lambda index: put(index, "offset", 0),
    "behind the end": lambda index: put(index, "offset", 1 << 40),
    "in the index": lambda index: put(index, "offset", index[-1]["offset"] + 64),
    "off its place": lambda index: put(index, "offset", index[0]["offset"] + 1),
    "before the begin": lambda index: put(index, "offset", -64),
    "place of a truth": lambda index: put(index, "offset", True),
    "huge": lambda index: put(put(index, "shape", [1 << 40, 1 << 21]), "bytes", 1 << 61),
    "other bytes": lambda index: put(index, "bytes", index[0]["bytes"] - 1),
    "no shape": lambda index: put(index, "shape", []),
    "many axes": lambda index: put(index, "shape", [1] * 64),
    "sides of fractions": lambda index: put(index, "shape", [1.0, 2]),
    "sides below 0": lambda index: put(index, "shape", [-1, -2]),
    "objects": lambda index: put(index, "type", "O8"),
    "a type of its own": lambda index: put(index, "type", ["f4"]),
    "a path": lambda index: put(index, "name", "../peaks"),
    "no name": lambda index: put(index, "name", 3),
    "no checksum": lambda index: put(index, "crc32", 1 << 32),
    "not a number": lambda index: json.dumps(put(index, "crc32", 0)).replace("0", "NaN").encode(),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_an_index_that_is_signed_and_cannot_be(
    folder: Path, tile: Path, refused, wrong: str
) -> None:
    """Its checksums are right, so the bounds themselves are what is looked at."""
    content = tile.read_bytes()
    index = index_of(content)
    tile.write_bytes(with_index(content, index))
    TileFile(tile)
    tile.write_bytes(with_index(content, WRONG[wrong](index)))
    tracemalloc.start()
    try:
        refused(folder, "tile_0000.arto is missing or damaged")
        assert tracemalloc.get_traced_memory()[1] < 50 << 20
    finally:
        tracemalloc.stop()


def test_another_version_of_the_file(folder: Path, tile: Path, monkeypatch, put_arrays) -> None:
    with monkeypatch.context() as m:
        m.setattr(tile_file, "VERSION", 2)
        with written(tile) as out:
            out.add("scales", np.ones(2, np.float32))
    with pytest.raises(FieldError, match=r"version 2; this ARTO reads version 1: update ARTO"):
        TileFile(tile)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are pipes on POSIX alone")
def test_a_pipe_or_a_device_is_not_waited_for(folder: Path, tile: Path, refused) -> None:
    tile.unlink()
    tile.symlink_to("/dev/zero")
    refused(folder, "is no regular file")
    tile.unlink()
    os.mkfifo(tile)
    done = threading.Thread(target=refused, args=(folder, "is no regular file"), daemon=True)
    done.start()
    done.join(30)
    assert not done.is_alive()


# --- arrays in the place of others ----------------------------------------------------------------


def test_layers_take_the_place_of_others(folder: Path, tile: Path, arrays_of, used) -> None:
    before, picture, size = arrays_of(tile), used(folder), tile.stat().st_size
    alpha = np.full((6, 8), 0.25, np.float16)
    for _ in range(3):
        rewrite(tile, {"alpha": alpha, "own_key": before["own"]})
    after = arrays_of(tile)
    assert after.keys() - before.keys() == {"own_key"}
    for name, array in before.items():
        np.testing.assert_array_equal(after[name], alpha if name == "alpha" else array)
    np.testing.assert_array_equal(used(folder)[..., :3], picture[..., :3])
    assert (used(folder)[..., 3] == 0.25).all()
    # no bytes are left of what was replaced
    assert tile.stat().st_size < size + before["own"].nbytes + 512


def test_a_rewrite_that_fails_leaves_the_file(folder: Path, tile: Path, monkeypatch) -> None:
    content = tile.read_bytes()

    def failing(*_: object) -> None:
        raise OSError("no room")

    with monkeypatch.context() as m:
        m.setattr(tile_file.TileFileWriter, "close", failing)
        with pytest.raises(OSError, match="no room"):
            rewrite(tile, {"alpha": np.ones((6, 8), np.float16)})
    assert tile.read_bytes() == content
    assert {p.name for p in folder.iterdir() if p.is_file()} == {MARK, "field.json", tile.name}
    assert Field(folder).has_layer("alpha")
