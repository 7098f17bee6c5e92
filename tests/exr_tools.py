"""What tests of EXR files share."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from arto.core import exr
from arto.core.exr.head import parsed


def layers(size: tuple[int, int] = (37, 23), seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "Combined": (10 ** rng.uniform(-30, 30, (*size, 4))).astype(np.float32),
        "ViewLayer.Combined_ARTO_0003_u2": rng.random((*size, 3), np.float32),
        "Depth": -rng.random(size, np.float32),
    }


def same(found: dict[str, np.ndarray], given: dict[str, np.ndarray]) -> None:
    assert list(found) == list(given)
    for name, pixels in given.items():
        expected = pixels[..., None] if pixels.ndim == 2 else pixels
        assert found[name].dtype == expected.dtype
        np.testing.assert_array_equal(found[name], expected)


def headers_of(path: Path) -> bytes:
    """The bytes of a file before its tables of chunks."""
    data = path.read_bytes()
    return data[: parsed(data)[1]]


def digest(path: Path) -> list[str]:
    """What is read of a file: its layers, their types and pixels; its first header."""
    found = hashlib.sha256()
    for name, pixels in exr.parts(path):
        found.update(repr((name, pixels.dtype.str, pixels.shape)).encode())
        found.update(np.ascontiguousarray(pixels).tobytes())
    return [found.hexdigest(), repr(exr.header(path))]


def damaged(sound: Sequence[bytes], count: int) -> Iterator[bytearray]:
    """Files that are cut, flipped, and overwritten with large and with negative numbers."""
    rng = np.random.default_rng(7)
    for turn in range(count):
        data = bytearray(sound[turn % len(sound)])
        kind = turn // len(sound) % 4
        if kind == 0:
            data = data[: rng.integers(0, len(data))]
        elif kind == 1:
            for at in rng.integers(0, len(data), 5):
                data[at] ^= 1 << int(rng.integers(8))
        elif kind == 2:  # in the headers and tables, where numbers are
            at = int(rng.integers(4, min(len(data) - 8, 1200)))
            value = int(rng.choice([0, -1, 2**31 - 1, -(2**31), 1 << 24, 65536]))
            struct.pack_into("<i", data, at, value)
        else:
            at, length = int(rng.integers(0, len(data) - 64)), int(rng.integers(1, 64))
            data[at : at + length] = rng.integers(0, 256, length, np.uint8).tobytes()
        yield data
