"""Arrays in files: any damage is an error of two kinds, soon, and never another array."""

from __future__ import annotations

import os
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from arto.core import arrays

LARGE = 1 << 24


def test_an_array_is_read_as_it_was_written(tmp_path: Path) -> None:
    image = np.random.default_rng(0).random((4, 8, 3), np.float32)
    arrays.write(tmp_path / "a.npy", image)
    assert np.array_equal(arrays.read(tmp_path / "a.npy", image.nbytes), image)
    assert np.array_equal(np.load(tmp_path / "a.npy"), image)  # by any other reader too
    assert arrays.is_signed(tmp_path / "a.npy")
    np.save(tmp_path / "theirs.npy", image)
    assert not arrays.is_signed(tmp_path / "theirs.npy")
    assert np.array_equal(arrays.read(tmp_path / "theirs.npy", image.nbytes, signed=False), image)


def test_an_array_in_the_place_of_another_is_found(tmp_path: Path) -> None:
    """Each is whole: it has another name."""
    for name in ("a.npy", "b.npy"):
        arrays.write(tmp_path / name, np.full((2, 3), ord(name[0]), np.float32))
    (tmp_path / "a.npy").replace(tmp_path / "b.npy")
    with pytest.raises(ValueError, match="not what was written"):
        arrays.read(tmp_path / "b.npy", LARGE)


def test_every_flipped_bit_is_found(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    arrays.write(path, np.arange(24, dtype=np.float32).reshape(2, 4, 3))
    good = path.read_bytes()
    for at in range(len(good)):
        bad = bytearray(good)
        bad[at] ^= 1 << at % 8
        path.write_bytes(bad)
        with pytest.raises(ValueError):
            arrays.read(path, LARGE)


@pytest.mark.parametrize("signed", [True, False])
def test_cuts_and_damaged_heads(tmp_path: Path, signed: bool) -> None:
    """The head of an array is Python text: what is damaged in it must not become work or memory."""
    path = tmp_path / "a.npy"
    np.save(path, np.arange(24, dtype=np.float32).reshape(2, 4, 3))
    good = path.read_bytes()
    heads = [b"(2, 4, 3)", b"(2, 4, 3", b"(9**99999999, )", b"(99999999999999999999, 4, 3)", b"(("]
    texts = [good[:n] for n in range(0, len(good), 7)] + [b"", b"x" * 1000]
    texts += [good.replace(heads[0], other.ljust(9))[: len(good)] for other in heads[1:]]
    texts += [good.replace(b"<f4", kind) for kind in (b"|O8", b"<M8", b"xxx")]
    tracemalloc.start()
    begun = time.process_time()
    for text in texts:
        path.write_bytes(text)
        with pytest.raises(ValueError):
            arrays.read(path, LARGE, signed)
    assert time.process_time() - begun < 5
    assert tracemalloc.get_traced_memory()[1] < LARGE
    tracemalloc.stop()


@pytest.mark.skipif(os.name == "nt", reason="there are no pipes as files")
def test_a_pipe_and_a_device_do_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.npy")
    (tmp_path / "b.npy").symlink_to("/dev/zero")
    for name in ("a.npy", "b.npy"):
        with pytest.raises(OSError):
            arrays.read(tmp_path / name, LARGE)
