"""Checksums of bytes: CRC-32 as zlib has it, of large ones in blocks, a thread each.

A checksum tells damage, and not malice. One core takes the CRC-32 of some 3 GB a second.

Examples
--------
>>> data = bytes(range(256)) * (BLOCK // 64)
>>> crc32(data) == zlib.crc32(data)
True
"""

from __future__ import annotations

import functools
import mmap
import os
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .regular import open_regular

# Bytes of a block. A thread is worth its while from a few of them on.
BLOCK = 1 << 22
_POLYNOMIAL = 0xEDB88320


def crc32(data: bytes | memoryview) -> int:
    """Compute the checksum of some bytes.

    Parameters
    ----------
    data : bytes or memoryview
        A memoryview of single bytes.

    Returns
    -------
    int
        As `zlib.crc32` gives.
    """
    threads = min(os.cpu_count() or 1, len(data) // BLOCK)
    if threads < 2:
        return zlib.crc32(data)
    view = memoryview(data)
    blocks = [view[at : at + BLOCK] for at in range(0, len(view), BLOCK)]
    with ThreadPoolExecutor(threads) as pool:
        first, *others = pool.map(zlib.crc32, blocks)
    found = first
    for block, crc in zip(blocks[1:], others, strict=True):
        found = _times(_after(len(block)), found) ^ crc
    return found


def of_file(path: Path) -> int:
    """Compute the checksum of a regular file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    int

    Raises
    ------
    OSError
        The file cannot be read, or is no regular file.
    """
    with open_regular(path, follow=True) as file:
        if not os.fstat(file.fileno()).st_size:
            return 0
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data, memoryview(data) as view:
            return crc32(view)


@functools.lru_cache(maxsize=8)
def _after(length: int) -> tuple[int, ...]:
    """What so many bytes of nothing make of the checksum before them.

    As a matrix of bits: 32 columns of 32 bits.

    Source
    ------
    crc32_combine of zlib, by M. Adler.
    """
    bit = (_POLYNOMIAL, *(1 << n for n in range(31)))
    power = bit
    for _ in range(3):
        power = tuple(_times(power, column) for column in power)  # of one byte
    out = tuple(1 << n for n in range(32))
    while length:
        if length & 1:
            out = tuple(_times(power, column) for column in out)
        power = tuple(_times(power, column) for column in power)
        length >>= 1
    return out


def _times(matrix: tuple[int, ...], vector: int) -> int:
    """The product of a matrix and a vector of bits."""
    out = 0
    for column in matrix:
        if vector & 1:
            out ^= column
        vector >>= 1
    return out
