"""The entries of one support model in a tile: which pixels have one, codes of R, parameters.

>>> from arto.core.supports import LINEAR, BOX
>>> steps_of(LINEAR).itemsize, steps_of(BOX).itemsize
(1, 2)
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import FieldError
from ..supports import Support


class Source(Protocol):
    """What a model asks of its tile, see `tile.Tile`.

    Parameters
    ----------
    path : Path
        Of the tile, for messages.
    blocks : list of slice
        Of its pixels.
    patches : int
        Those of the hemicube, K.
    """

    path: Path
    blocks: list[slice]
    patches: int

    def load(self, name: str, shape: tuple[int, ...], dtype: np.dtype | type) -> NDArray:
        """As `tile.Tile.load`.

        Parameters
        ----------
        name : str
        shape : tuple of int
        dtype : dtype

        Returns
        -------
        array
        """
        ...


@dataclass(frozen=True)
class Entries:
    """The entries of one patch that share a support model.

    Parameters
    ----------
    support : Support
        The model.
    pixels : (n,) int
        Whose they are, indices into the tile, row by row.
    coefficient : (n, 3) float32
        The reflection coefficients R, scene-linear.
    parameters : (n, p) float32
        Those of the model, in [0, 1].
    """

    support: Support
    pixels: NDArray[np.intp]
    coefficient: NDArray[np.float32]
    parameters: NDArray[np.float32]


def steps_of(support: Support) -> np.dtype:
    """How finely a model's parameters are stored: means of many paths in 8 bits, edges in 16.

    Parameters
    ----------
    support : Support
        The model.

    Returns
    -------
    dtype
        Unsigned; its largest number is 1.
    """
    return np.dtype(np.uint8 if support.name == "linear" else np.uint16)


class Model:
    """The entries of one support model in a tile: (3, m) codes of R, (p, m) parameters.

    Entries stand in the order of (block, patch, pixel). `counts`, (B, K), says how many each block
    has for each patch; `bits`, for each block and patch that has any, which pixels have one.

    Parameters
    ----------
    tile : Source
        The tile whose they are; it is not kept.
    support : Support
        The model.
    count : int
        How many entries there are, m.

    Raises
    ------
    FieldError
        If an array is missing or damaged.
    """

    def __init__(self, tile: Source, support: Support, count: int) -> None:
        # not the tile itself: it has its models, and a circle would keep its file mapped
        self.path, self.blocks, self.support = tile.path, tile.blocks, support
        name, p = support.name, len(support.parameters)
        blocks = tile.blocks
        counts = tile.load(f"{name}_counts", (len(blocks), tile.patches), np.uint32)
        lengths = np.array([b.stop - b.start for b in blocks])[:, None]
        if (counts > lengths).any() or counts.sum(dtype=np.int64) != count:
            raise FieldError(f"{tile.path} is damaged, its counts differ: fit again")
        self.counts = counts
        self.starts = _starts(counts)
        row = np.where(counts > 0, -(-lengths // 8), 0)
        self.rows = _starts(row)
        self.codes = tile.load(f"{name}_coefficient", (3, count), np.uint8)
        self.parameters = tile.load(f"{name}_parameters", (p, count), steps_of(support))
        self.bits = tile.load(f"{name}_pixels", (int(row.sum()),), np.uint8)
        # parameters are in [0, 1], of which this is the end
        self.end = np.float32(np.iinfo(self.parameters.dtype).max)

    def has(self, block: int, k: int) -> bool:
        """Whether any pixel has an entry.

        Parameters
        ----------
        block, k : int
            The block, and the patch.

        Returns
        -------
        bool
        """
        return bool(self.counts[block, k])

    def at(self, block: int, k: int) -> slice:
        """Where the entries of a patch in a block are.

        Parameters
        ----------
        block, k : int
            The block, and the patch.

        Returns
        -------
        slice
            Of the columns of `codes` and `parameters`.
        """
        a = self.starts[block, k]
        return slice(a, a + int(self.counts[block, k]))

    def pixels(self, block: int, k: int) -> NDArray[np.intp]:
        """Which pixels have an entry.

        Parameters
        ----------
        block, k : int
            The block, and the patch.

        Returns
        -------
        (n,) int
            Pixels, counted from the block's first.

        Raises
        ------
        FieldError
            If they are not as many as `counts` says.
        """
        where = self.blocks[block]
        n = where.stop - where.start
        first = self.rows[block, k]
        found = np.flatnonzero(
            np.unpackbits(self.bits[first : first + -(-n // 8)], count=n).view(bool)
        )
        if len(found) != self.counts[block, k]:
            raise FieldError(f"{self.path} is damaged, its counts differ: fit again")
        return found

    def shares(self, at: slice) -> NDArray[np.float32]:
        """Reflection coefficients, relative to that whose code is 1.

        Parameters
        ----------
        at : slice
            Of the entries, see `at`.

        Returns
        -------
        (3, n) float32
            In units of `Tile.ones`.
        """
        out = self.codes[:, at].astype(np.float32)
        out *= out
        return out

    def parameters_of(self, at: slice) -> NDArray[np.float32]:
        """Parameters of the model.

        Parameters
        ----------
        at : slice
            Of the entries, see `at`.

        Returns
        -------
        (n, p) float32
            In [0, 1].
        """
        out = self.parameters[:, at].astype(np.float32)
        out /= self.end
        return out.T


def _starts(sizes: NDArray) -> NDArray[np.int64]:
    """Where each of some runs begins, that stand in the order of (block, patch)."""
    ends = np.cumsum(sizes, dtype=np.int64)
    return (ends - sizes.ravel()).reshape(sizes.shape)
