"""Damaged EXR files: a typed error or the right pixels, soon, and without much memory."""

from __future__ import annotations

import struct
import time
import tracemalloc
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from arto.core import exr
from arto.core.errors import ExrError
from arto.core.exr import head
from exr_tools import damaged

pytestmark = pytest.mark.usefixtures("library")

SECONDS, BYTES = 1.0, 200 * 2**20
COMPRESSIONS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB")


def picture(seed: int = 0, size: tuple[int, int] = (40, 33)) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {c: rng.random(size, np.float32).astype(np.float32) for c in "RGB"}


def made(path: Path, parts: int, compression: str, tiled: bool = False) -> bytes:
    """A valid file, as the library writes it."""
    head = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION")}
    head["type"] = OpenEXR.tiledimage if tiled else OpenEXR.scanlineimage
    if tiled:
        tile = OpenEXR.TileDescription()
        tile.xSize, tile.ySize = 16, 8
        tile.mode = OpenEXR.LevelMode.ONE_LEVEL
        head["tiles"] = tile
    if parts == 1:
        OpenEXR.File(head, picture()).write(str(path))
    else:
        some = [OpenEXR.Part(dict(head), picture(n), f"part{n}") for n in range(parts)]
        OpenEXR.File(some).write(str(path))
    return path.read_bytes()


def opened(path: Path) -> str:
    """What comes of reading a file, within its bounds: `read`, or the error's text."""
    tracemalloc.start()
    begun = time.process_time()
    try:
        exr.part_names(path)
        exr.read(path)
        said = "read"
    except ExrError as e:
        said = str(e)
    finally:
        took = time.process_time() - begun
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert took < SECONDS and most < BYTES, (took, most)
    return said


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("parts", [1, 3])
def test_every_valid_file_is_whole_and_every_shorter_one_is_not(
    tmp_path: Path, parts: int, compression: str
) -> None:
    path = tmp_path / "a.exr"
    data = made(path, parts, compression)
    assert opened(path) == "read"
    for cut in (1, 7, len(data) // 2, len(data) - 9):
        path.write_bytes(data[:-cut])
        assert "is truncated or damaged" in opened(path) or "no EXR file" in opened(path)


@pytest.mark.parametrize("order", ["INCREASING_Y", "DECREASING_Y"])
def test_lines_in_either_order(tmp_path: Path, order: str) -> None:
    """The chunk that is named first may lie last: the table does not end where it begins."""
    path = tmp_path / "a.exr"
    head = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
    head["lineOrder"] = getattr(OpenEXR, order)
    OpenEXR.File(head, picture()).write(str(path))
    assert opened(path) == "read"
    data = path.read_bytes()
    # turned by hand, whatever the library wrote: the table reversed names the same chunks
    found = exr.read(path)[""]
    expected = np.stack([picture()[c] for c in "RGB"], axis=-1)
    np.testing.assert_array_equal(found, expected)
    path.write_bytes(data[:-1])
    assert "is truncated or damaged" in opened(path)


def test_tiles(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    try:
        data = made(path, 1, "ZIP", tiled=True)
    except Exception as e:
        pytest.skip(f"this OpenEXR writes no tiles ({e})")
    assert opened(path) == "read"
    path.write_bytes(data[:-3])
    assert "is truncated or damaged" in opened(path)


def test_a_table_that_runs_in_circles_ends(tmp_path: Path) -> None:
    """Offsets that lead back into the table itself."""
    path = tmp_path / "a.exr"
    data = bytearray(made(path, 1, "ZIP"))
    _, table = head.parsed(bytes(data))
    first = struct.unpack_from("<Q", data, table)[0]
    assert first > table
    struct.pack_into("<Q", data, table, table + 8)
    path.write_bytes(data)
    assert "chunks of it are missing" in opened(path)


def test_two_hundred_damaged_files(tmp_path: Path) -> None:
    """Cut, flipped, overwritten with large and negative numbers: a typed error or good pixels."""
    path = tmp_path / "a.exr"
    sound = [
        made(path, parts, compression)
        for parts in (1, 3)
        for compression in ("NO", "ZIP", "ZIPS", "RLE", "PXR24")
    ]
    refused = 0
    for data in damaged(sound, 200):
        path.write_bytes(data)
        refused += opened(path) != "read"
    assert refused > 80
