"""One tile of a reflectance field on disk: what each patch gives to each of its pixels.

A coefficient is stored in eight bits as the root of its share of the pixel's largest: its error is
then in proportion to the root of the light, as the noise of any capture is, and under a thirtieth
of it at 128 samples a pixel. A bit for each pixel, patch and model in use says who has an entry.

>>> [(b.start, b.stop) for b in blocks_of(200_000)]
[(0, 131072), (131072, 200000)]
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FieldError
from ..region import Region
from ..supports import BY_CODE, NOTHING, REST
from .model import Entries, Model
from .through import through_of
from .tile_file import Stored, TileFile
from .tile_folder import TileFolder

# The arrays of a tile stand block after block: so many pixels at a time, row by row. A block is
# what a thread adds up and what a crop reads; whole bytes of bits.
BLOCK = 1 << 17
# The largest code of a coefficient: that of the pixel's largest, channel by channel.
FULL = 255
# Where half floats are relative to a largest value, that is at their upper end: nine decades below
# it keep their precision.
LARGEST = 6e4
# What the file of a tile ends in.
SUFFIX = ".arto"
# Beside the models' arrays, what relighting reads.
OTHERS = ("peaks", "scales", "rest", "rest_weights", "rest_patches")


# The ends of the names of a model's arrays.
OF_A_MODEL = ("counts", "pixels", "coefficient", "parameters")


def checksum_of(arrays: Iterable[Stored]) -> int:
    """Compute the checksum of a tile: of all but its layers, which may be replaced.

    It tells a tile from that of another field.

    Parameters
    ----------
    arrays : iterable of Stored
        The index of the tile's file.

    Returns
    -------
    int
    """
    ends = tuple(f"_{end}" for end in OF_A_MODEL)
    of = [
        s
        for s in arrays
        if s.name in OTHERS or (s.name.endswith(ends) and not s.name.startswith("own_"))
    ]
    said = sorted((s.name, s.type, s.shape, s.crc32) for s in of)
    return zlib.crc32(repr(said).encode())


def blocks_of(pixels: int) -> list[slice]:
    """The blocks of a tile.

    Parameters
    ----------
    pixels : int
        How many the tile has.

    Returns
    -------
    list of slice
        Of its pixels, in order.
    """
    return [slice(a, min(a + BLOCK, pixels)) for a in range(0, pixels, BLOCK)]


class Tile:
    """One tile of an opened field; arrays stay on disk until asked for.

    Parameters
    ----------
    path : Path
        Its file; of a field of version 2, its folder.
    region : Region
        Its place in the picture.
    used : dict of str to int
        By the name of each support model in use, how many entries it has.
    patches : int
        Those of the hemicube, K.
    checksum : int, optional
        That the tile must have, see `checksum_of`.
    """

    def __init__(
        self,
        path: Path,
        region: Region,
        used: dict[str, int],
        patches: int,
        checksum: int | None = None,
    ) -> None:
        self.path, self.region, self.used, self.patches = path, region, used, patches
        self.checksum = checksum
        self.blocks = blocks_of(region.pixels)

    @cached_property
    def _arrays(self) -> TileFile | TileFolder:
        if self.path.suffix != SUFFIX:
            return TileFolder(self.path)
        found = TileFile(self.path)
        if self.checksum not in (None, checksum_of(found.index.values())):
            raise FieldError(f"{self.path} is of another field than the head beside it: fit again")
        return found

    def close(self) -> None:
        """Let go of all that is mapped. What is asked for afterwards is mapped anew.

        Arrays that were taken out of the tile keep its file mapped as long as they are there.
        """
        for name, kept in vars(Tile).items():
            if isinstance(kept, cached_property):
                self.__dict__.pop(name, None)

    def load(self, name: str, shape: tuple[int, ...], dtype: np.dtype | type) -> NDArray:
        """One of the tile's arrays.

        Parameters
        ----------
        name : str
        shape : tuple of int
            That it must have.
        dtype : dtype
            That it must have.

        Returns
        -------
        array
            Mapped, and read only.

        Raises
        ------
        FieldError
            If it is missing, or not as it must be.
        """
        out = self._arrays.load(name)
        if out.shape != shape or out.dtype != dtype:
            raise FieldError(
                f"{self.path} is damaged, '{name}' has the shape {out.shape} of {out.dtype}, not "
                f"{shape} of {np.dtype(dtype)}: fit again"
            )
        return out

    def layer(
        self, name: str, part: tuple[slice, slice] = (slice(None), slice(None))
    ) -> NDArray[np.float32]:
        """One of `field.LAYERS`, or a layer of a light group.

        Parameters
        ----------
        name : str
        part : tuple of slice
            Rows and columns that are read.

        Returns
        -------
        (h, w) or (h, w, 3) float32
            Light scene-linear, in the field's colour space.

        Raises
        ------
        FieldError
            If it is missing, or has the wrong size.
        """
        out = self._arrays.load(name)
        if out.shape[:2] != (self.region.height, self.region.width):
            raise FieldError(f"{self.path} is damaged, '{name}' has the wrong size: fit again")
        return out[part].astype(np.float32)

    def through(
        self, part: tuple[slice, slice] = (slice(None), slice(None))
    ) -> NDArray[np.float32]:
        """How much of the world behind is seen, by channel, see `through`.

        Parameters
        ----------
        part : tuple of slice
            Rows and columns that are read.

        Returns
        -------
        (h, w, 3) float32

        Raises
        ------
        FieldError
            If the file is missing or damaged.
        """
        if self.has_layer("through"):
            return self.layer("through", part)
        return through_of(self.layer("alpha", part))

    @property
    def sizes(self) -> dict[str, int]:
        """The names of its arrays, and how many bytes each has on disk. Raises FieldError."""
        return self._arrays.sizes

    def has_layer(self, name: str) -> bool:
        """Whether it has a layer.

        Parameters
        ----------
        name : str

        Returns
        -------
        bool

        Raises
        ------
        FieldError
            If the file is missing or damaged.
        """
        return name in self.sizes

    def own_layers(self) -> list[str]:
        """Its layers of light groups of the scene's own lamps.

        Returns
        -------
        list of str
            Their names.

        Raises
        ------
        FieldError
            If the file is missing or damaged.
        """
        return [name for name in self.sizes if name.startswith("own_")]

    @cached_property
    def models(self) -> list[Model]:
        """The support models in use, in the order of their codes."""
        found = {s.name: s for s in BY_CODE.values()}
        for name in self.used:
            if name not in found:
                raise FieldError(
                    f"{self.path} uses the support model '{name}', which this version does "
                    "not know: update ARTO, or fit again"
                )
        supports = sorted((found[name] for name in self.used), key=lambda s: s.code)
        return [Model(self, support, self.used[support.name]) for support in supports]

    @cached_property
    def _scales(self) -> NDArray[np.float32]:
        """(2,): the units of `peaks` and `rest`."""
        return self._numbers("scales", np.asarray(self.load("scales", (2,), np.float32)))

    @cached_property
    def _peaks(self) -> NDArray[np.float16]:
        return self.load("peaks", (self.region.pixels, 3), np.float16)

    def ones(self, pixels: slice | NDArray[np.intp]) -> NDArray[np.float32]:
        """The R whose code is 1 in each pixel.

        Parameters
        ----------
        pixels : slice or (n,) int
            Of the tile.

        Returns
        -------
        (n, 3) float32

        Raises
        ------
        FieldError
            If the array is missing or damaged.
        """
        out = self._peaks[pixels].astype(np.float32) * (self._scales[0] / FULL**2)
        return self._numbers("peaks", out)

    def _numbers(self, name: str, array: NDArray[np.float32]) -> NDArray[np.float32]:
        """An array, checked: light below nothing, infinite or no number would spoil pictures."""
        # which what is no number fails too
        if not (array.min(initial=0) >= 0 and array.max(initial=0) < np.inf):
            raise FieldError(f"{self.path} is damaged, '{name}' has what is no light: fit again")
        return array

    @cached_property
    def rest_weights(self) -> NDArray[np.float32] | None:
        """(K,): how much of each patch is in the rest of the tile; None where there is no rest."""
        if "rest" not in self.sizes:
            return None
        found = np.asarray(self.load("rest_weights", (self.patches,), np.float32))
        return self._numbers("rest_weights", found)

    @cached_property
    def _rest(self) -> NDArray[np.float16]:
        return self.load("rest", (self.region.pixels, 3), np.float16)

    def rest(self, pixels: slice = slice(None)) -> NDArray[np.float32]:
        """R of all that was too small to be an entry, added up.

        Parameters
        ----------
        pixels : slice
            Of the tile.

        Returns
        -------
        (n, 3) float32

        Raises
        ------
        FieldError
            If the array is missing or damaged.
        """
        out = self._rest[pixels].astype(np.float32) * self._scales[1]
        return self._numbers("rest", out)

    @cached_property
    def rest_patches(self) -> NDArray[np.uint8]:
        """(ceil(K / 8), n): a bit for each patch that a pixel's rest is of, the first the least."""
        return self.load("rest_patches", (-(-self.patches // 8), self.region.pixels), np.uint8)

    def open(self) -> None:
        """Map all that relighting needs.

        Raises
        ------
        FieldError
            If an array is missing or damaged.
        """
        _ = self.models, self._scales, self._peaks
        if self.rest_weights is not None:
            _ = self._rest, self.rest_patches

    @property
    def codes(self) -> NDArray[np.uint8]:
        """(K, n): which model each entry has; 0 for no light, `REST` for light in the rest only."""
        out = np.full((self.patches, self.region.pixels), NOTHING, np.uint8)
        if self.rest_weights is not None:
            bits = np.unpackbits(self.rest_patches, axis=0, count=self.patches, bitorder="little")
            out[bits.astype(bool)] = REST
        for model in self.models:
            for block, where in enumerate(self.blocks):
                for k in np.flatnonzero(model.counts[block]).tolist():
                    out[k, where.start + model.pixels(block, k)] = model.support.code
        return out

    def entries(self, k: int) -> list[Entries]:
        """The entries of a patch, model by model.

        Parameters
        ----------
        k : int
            The patch.

        Returns
        -------
        list of Entries

        Raises
        ------
        FieldError
            If an array is missing or damaged.
        """
        found = []
        for model in self.models:
            here = [b for b in range(len(self.blocks)) if model.has(b, k)]
            if not here:
                continue
            pixels = np.concatenate([self.blocks[b].start + model.pixels(b, k) for b in here])
            shares = np.concatenate([model.shares(model.at(b, k)).T for b in here])
            parameters = np.concatenate([model.parameters_of(model.at(b, k)) for b in here])
            found.append(Entries(model.support, pixels, shares * self.ones(pixels), parameters))
        return found
