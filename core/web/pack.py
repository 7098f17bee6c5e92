"""Arrays made small: differences of neighbours, in planes of bytes, deflated.

Examples
--------
>>> picture = np.arange(12, dtype=np.uint16).reshape(1, 3, 4) * 300
>>> packed = pack(picture)
>>> bool((unpack(packed.data, packed.about) == picture).all())
True
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import WebError

# By their names in the file; all are little-endian.
TYPES: dict[str, np.dtype] = {
    "u8": np.dtype("u1"),
    "u16": np.dtype("<u2"),
    "f16": np.dtype("<f2"),
    "f32": np.dtype("<f4"),
}
# What is subtracted: nothing, the neighbour on the left, the one above, or left and above less the
# one between.
DELTAS = ("none", "left", "up", "plane")
# The most numbers of an array.
MOST = 1 << 28
# How hard deflate tries, to choose a difference and at last.
_QUICK, _BEST = 1, 9


@dataclass(frozen=True)
class Packed:
    """An array as bytes.

    Parameters
    ----------
    data : bytes
    about : dict
        What the file's head says of it: type, shape, delta, first.
    """

    data: bytes
    about: dict[str, Any]


def pack(array: NDArray) -> Packed:
    """Make an array small; whole numbers are tried with every kind of difference.

    Parameters
    ----------
    array : (..., h, w) uint8, uint16, float16 or float32

    Returns
    -------
    Packed
    """
    kind = next(name for name, t in TYPES.items() if t == array.dtype.newbyteorder("<"))
    about: dict[str, Any] = {"type": kind, "shape": list(array.shape)}
    if kind[0] == "f":
        return Packed(zlib.compress(_bytes(array), _BEST), about | {"delta": "none"})
    best: tuple[int, dict[str, Any]] | None = None
    for first in (False, True) if array.ndim == 3 and array.shape[0] == 3 else (False,):
        for delta in DELTAS:
            size = len(zlib.compress(_differences(array, delta, first), _QUICK))
            if best is None or size < best[0]:
                best = size, {"delta": delta, "first": first}
    assert best is not None
    found = best[1]
    return Packed(zlib.compress(_differences(array, **found), _BEST), about | found)


def unpack(data: bytes, about: dict[str, Any]) -> NDArray:
    """Give back an array.

    Parameters
    ----------
    data : bytes
    about : dict
        As `Packed` has it.

    Returns
    -------
    array

    Raises
    ------
    WebError
        The bytes are not what the head says.
    """
    kind, shape = TYPES.get(str(about.get("type"))), about.get("shape")
    good = isinstance(shape, list) and all(type(n) is int and n >= 0 for n in shape)
    delta = about.get("delta")
    if kind is None or not good or not shape or delta not in DELTAS or math.prod(shape) > MOST:
        raise WebError("this is no shot for a page: an array is of an unknown form")
    size = math.prod(shape) * kind.itemsize
    try:
        unzip = zlib.decompressobj()
        raw = unzip.decompress(data, size + 1)
    except zlib.error as e:
        raise WebError(f"the shot for a page is damaged ({e}): make the page again") from None
    if len(raw) != size:
        raise WebError("the shot for a page is damaged, an array is short: make the page again")
    if kind.kind == "f":
        planes = np.frombuffer(raw, np.uint8).reshape(kind.itemsize, -1)
        return np.ascontiguousarray(planes.T).view(kind).reshape(shape)
    planes = np.frombuffer(raw, np.uint8).reshape(kind.itemsize, -1)
    steps = planes[0].astype(kind)
    if kind.itemsize == 2:
        steps = steps | (planes[1].astype(kind) << np.uint16(8))
        steps = (steps >> np.uint16(1)) ^ (np.uint16(0) - (steps & np.uint16(1)))
    out = steps.reshape(shape).astype(kind)
    if delta in ("left", "plane"):
        out = np.add.accumulate(out, axis=-1, dtype=kind)
    if delta in ("up", "plane"):
        out = np.add.accumulate(out, axis=-2, dtype=kind)
    if about.get("first"):
        out[1:] += out[:1]
    return out


def _differences(array: NDArray, delta: str, first: bool) -> bytes:
    out = array.copy()
    if first:
        out[1:] -= array[:1]
    if delta in ("up", "plane"):
        out[..., 1:, :] -= out[..., :-1, :].copy()
    if delta in ("left", "plane"):
        out[..., 1:] -= out[..., :-1].copy()
    if out.dtype.itemsize == 2:
        # small differences to both sides become small numbers
        signed = out.astype(np.int16)
        out = ((signed << 1) ^ (signed >> 15)).astype(np.uint16)
    return _bytes(out)


def _bytes(array: NDArray) -> bytes:
    """All first bytes, then all second ones."""
    flat = np.ascontiguousarray(array).reshape(-1)
    raw = flat.view(np.uint8).reshape(-1, flat.itemsize)
    return np.ascontiguousarray(raw.T).tobytes()
