"""One tile of a reflectance field in the making: entries patch after patch, written at the end.

>>> tile = TileWriter(Region(0, 0, 2, 1), {})
>>> light = np.array([[0.5, 0.5, 0.5], [0, 0, 0]])
>>> tile.add(np.array([1, 0], np.uint8), light, {1: np.empty((1, 0))})
>>> tile.patches, tile.peaks[0].tolist()
(1, [0.5, 0.0])
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ..capture.names import OF_ONE_RAY
from ..errors import FieldError
from ..region import Region
from ..supports import BY_CODE, NOTHING
from .model import steps_of
from .tile import FULL, LARGEST, blocks_of
from .tile_file import TileFileWriter


class TileWriter:
    """Collects one tile's entries, patch after patch, and writes them at the end.

    Parameters
    ----------
    region : Region
        The tile's place in the picture.
    layers : dict of str to array
        By their names, (h, w) or (h, w, 3) of the region, see `field.LAYERS`.
    """

    def __init__(self, region: Region, layers: dict[str, NDArray]) -> None:
        self.region = region
        self.layers = layers
        self.patches = 0
        # by model: of each patch that has any its number, pixels, R (3, m) and parameters (p, m)
        self.models: dict[int, list[tuple[int, NDArray, NDArray, NDArray]]] = {}
        # the largest R of an entry, by channel and pixel
        self.peaks: NDArray[np.float32] = np.zeros((3, region.pixels), np.float32)
        # what was dropped: by pixel and channel, by patch, and a bit for each of both
        self.rest: NDArray[np.float64] = np.zeros((region.pixels, 3))
        self.rest_of: list[float] = []
        self.rest_bits: list[NDArray[np.uint8]] = []

    def add(self, codes: NDArray, coefficient: NDArray, parameters: dict[int, NDArray]) -> None:
        """Add the next patch.

        Light without an entry is added to the pixel's rest. A coefficient below 0, which only
        patterns that do not fit together can give, is no light.

        Parameters
        ----------
        codes : (n,) uint8
            Which model each pixel's entry has; `NOTHING` for no entry.
        coefficient : (n, 3) float
            R, scene-linear.
        parameters : dict of int to (m, p) float
            By the code of each model in use, its entries' parameters, in [0, 1].

        Raises
        ------
        FieldError
            If a coefficient is infinite or no number, saying where.
        """
        low, high = coefficient.min(initial=0), coefficient.max(initial=0)
        if not (low > -np.inf and high < np.inf):  # which NaN fails too
            self._refuse(coefficient)
        if low < 0:
            coefficient = np.maximum(coefficient, 0)
        lit = (coefficient[:, 0] > 0) | (coefficient[:, 1] > 0) | (coefficient[:, 2] > 0)
        dropped = np.flatnonzero((codes == NOTHING) & lit)
        self.add_rest(dropped, coefficient[dropped])
        for code, values in parameters.items():
            pixels = np.flatnonzero(codes == code)
            # a channel a row: numpy is slow at rows of three
            light = np.stack([coefficient[:, c].take(pixels) for c in range(3)])
            self.add_entries(code, pixels, light, values.T)
        self.patches += 1

    def add_rest(self, pixels: NDArray[np.intp], coefficient: NDArray) -> None:
        """Add what is too small to be an entry, of the patch that is being added.

        Parameters
        ----------
        pixels : (m,) int
            Whose it is.
        coefficient : (m, 3) float
            R, scene-linear.
        """
        self.rest[pixels] += coefficient
        self.rest_of.append(float(coefficient.sum(dtype=np.float64)))
        byte, bit = divmod(self.patches, 8)
        if len(self.rest_bits) == byte:
            self.rest_bits.append(np.zeros(self.region.pixels, np.uint8))
        self.rest_bits[byte][pixels] |= np.uint8(1 << bit)

    def add_entries(
        self, code: int, pixels: NDArray[np.intp], coefficient: NDArray, parameters: NDArray
    ) -> None:
        """Add the entries of one model, of the patch that is being added.

        Parameters
        ----------
        code : int
            Of the model.
        pixels : (m,) int
            Whose they are.
        coefficient : (3, m) float
            R, scene-linear.
        parameters : (p, m) float
            In [0, 1].
        """
        if not len(pixels):
            return
        coefficient = coefficient.astype(np.float32, copy=False)
        steps = steps_of(BY_CODE[code])
        stored = np.clip(parameters, 0, 1) * np.iinfo(steps).max
        kept = (self.patches, pixels.astype(np.uint32), coefficient, np.rint(stored).astype(steps))
        self.models.setdefault(code, []).append(kept)
        for peak, light in zip(self.peaks, coefficient, strict=True):
            peak[pixels] = np.maximum(peak.take(pixels), light)

    def _refuse(self, coefficient: NDArray) -> NoReturn:
        bad = np.flatnonzero(~np.isfinite(coefficient).all(axis=-1))
        row, column = divmod(int(bad[0]), self.region.width)
        raise FieldError(
            f"patch {self.patches} has reflection coefficients that are infinite or not a "
            f"number in {len(bad)} pixels, the first at ({self.region.x + column}, "
            f"{self.region.y + row}): repair the basis images there, or capture again"
        )

    def write(self, out: TileFileWriter) -> dict[str, int]:
        """Write the arrays.

        Parameters
        ----------
        out : TileFileWriter
            What takes them.

        Returns
        -------
        dict of str to int
            By the name of each model in use, how many entries it took.

        Raises
        ------
        OSError
            If they cannot be written.
        """
        used = {}
        blocks = blocks_of(self.region.pixels)
        inverse = np.divide(1, self.peaks, out=np.zeros_like(self.peaks), where=self.peaks > 0)
        # what the codes will add up to, and what they should: even light must give all of it
        coded, meant = (np.zeros(self.peaks.shape, np.float32) for _ in range(2))
        for code, patches in sorted(self.models.items()):
            name = BY_CODE[code].name
            counts = np.zeros((len(blocks), self.patches), np.uint32)
            # by block and patch, which is the order in the file
            parts: dict[tuple[int, int], tuple[NDArray, NDArray, NDArray]] = {}
            for k, pixels, coefficient, parameters in patches:
                codes = np.empty(coefficient.shape, np.uint8)
                for c, light in enumerate(coefficient):
                    shares = inverse[c].take(pixels)
                    shares *= light
                    np.add.at(meant[c], pixels, shares)
                    codes[c] = shares = np.rint(np.sqrt(shares) * FULL)
                    shares *= shares
                    np.add.at(coded[c], pixels, shares)
                bits = np.zeros(self.region.pixels, bool)
                bits[pixels] = True
                ends = np.searchsorted(pixels, [where.stop for where in blocks]).tolist()
                for b, where in enumerate(blocks):
                    rows = slice(ends[b - 1] if b else 0, ends[b])
                    counts[b, k] = rows.stop - rows.start
                    if counts[b, k]:
                        packed = np.packbits(bits[where])
                        parts[b, k] = codes[:, rows], parameters[:, rows], packed
            each = [parts[key] for key in sorted(parts)]
            out.add(f"{name}_counts", counts)
            for what, arrays in zip(
                ("coefficient", "parameters", "pixels"), zip(*each, strict=True), strict=True
            ):
                out.add(f"{name}_{what}", np.concatenate(arrays, axis=-1))
            used[name] = int(counts.sum())
        peaks = self.peaks * np.divide(meant, coded, out=np.zeros_like(coded), where=coded > 0)
        peaks *= np.float32(FULL**2)
        units = _unit(peaks), _unit(self.rest)
        out.add("peaks", _halves(peaks.T, units[0]))
        out.add("scales", np.array(units, np.float32))
        if self.rest.any():
            out.add("rest", _halves(self.rest, units[1]))
            out.add("rest_patches", np.stack(self.rest_bits))
            # relative to the largest: only their ratios count, and none that is one may vanish
            weights = np.array(self.rest_of) / max(self.rest_of)
            weights = np.where(weights > 0, np.maximum(weights, 1e-30), 0)
            out.add("rest_weights", weights.astype(np.float32))
        for name, pixels in self.layers.items():
            out.add(name, stored_layer(name, pixels))
        return used


def _unit(values: NDArray) -> float:
    """What half floats are a multiple of, so that any exposure fits them."""
    return float(np.float32(values.max(initial=0) / LARGEST)) or 1.0


def _halves(values: NDArray, unit: float) -> NDArray[np.float16]:
    # the unit's own rounding must not take the largest past what a half float holds
    return np.minimum(values / unit, 65504).astype(np.float16)


def stored_layer(name: str, pixels: NDArray) -> NDArray:
    """A layer as it is stored: exactly what is of one ray or light, else in half floats.

    Parameters
    ----------
    name : str
        One of `field.LAYERS`, or of a light group.
    pixels : (h, w) or (h, w, 3) float

    Returns
    -------
    array
        float32 or float16, of the same shape.
    """
    exact = name in OF_ONE_RAY or name.startswith("own")
    return pixels.astype(np.float32 if exact else np.float16)
