"""Readers of pictures: a door for libraries that the core does not import.

`OpenImageIO`, which Blender brings along and which is on PyPI, is handed in as a module. It reads
JPEG, PNG, TIFF, EXR and, where it was built with LibRaw, the raw files of cameras.

Examples
--------
>>> picture = InMemory(np.full((2, 3, 3), 0.5, np.float32), linear=True)
>>> picture.shape, picture.rows(1, 2).shape
((2, 3), (1, 3, 3))
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..description import LARGEST_SIDE
from ..errors import PhotographsError
from ..picture_files import is_cut_file

# Names of what cameras note down, as OpenImageIO and as EXIF have them.
_EXPOSURE = ("ExposureTime", "Exif:ExposureTime", "raw:shutter")
_APERTURE = ("FNumber", "Exif:FNumber", "raw:aperture")
_ISO = ("Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings", "raw:ISO")
_FOCAL = ("Exif:FocalLengthIn35mmFilm",)
# Files whose values are light, not a display's.
_LINEAR = ("openexr", "hdr", "raw")


class Picture(Protocol):
    """A picture whose header was read.

    Attributes
    ----------
    shape : tuple of int
        (height, width).
    linear : bool
        Whether its values are scene-linear, and need no curve.
    levels : int
        The steps from black to white, such as 255; 0 for values without steps.
    exposure, aperture, iso, focal : float or None
        What the camera noted down: seconds, f-number, speed, and the lens for a picture 36
        millimetres wide.
    """

    shape: tuple[int, int]
    linear: bool
    levels: int
    exposure: float | None
    aperture: float | None
    iso: float | None
    focal: float | None

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        """Read some rows, of which the first is the top one.

        Parameters
        ----------
        first, last : int
            From the first up to the last, which is left out.

        Returns
        -------
        (last - first, W, 3) float32
            From 0 to 1 where the picture has levels.
        """
        ...


# Opens a picture. Raises PhotographsError where there is none.
Reader = Callable[[Path], Picture]


@dataclass
class InMemory:
    """A picture that is in memory already.

    Parameters
    ----------
    pixels : (H, W, 3) float
    linear : bool
    levels : int
    exposure, aperture, iso, focal : float, optional
        See `Picture`.
    """

    pixels: NDArray
    linear: bool = False
    levels: int = 255
    exposure: float | None = None
    aperture: float | None = None
    iso: float | None = None
    focal: float | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        return self.pixels.shape[0], self.pixels.shape[1]

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        """Give some rows, see `Picture`.

        Parameters
        ----------
        first, last : int

        Returns
        -------
        (last - first, W, 3) float32
        """
        return self.pixels[first:last].astype(np.float32)


class OpenImageIoPicture:
    """A picture's file, read by OpenImageIO.

    Parameters
    ----------
    oiio : module
        `OpenImageIO`.
    path : Path

    Raises
    ------
    PhotographsError
        The file is no picture that can be read, or a part of it is missing.
    """

    def __init__(self, oiio: Any, path: Path) -> None:
        self._oiio, self._path = oiio, path
        try:
            cut = is_cut_file(path)
        except OSError as e:
            raise PhotographsError(f"{path} cannot be read ({e})") from e
        if cut:
            raise PhotographsError(f"{path} is cut off: a part of the picture is missing")
        opened = self._open()
        spec = opened.spec()
        kind = str(opened.format_name())
        opened.close()
        self.shape: tuple[int, int] = (spec.height, spec.width)
        if not 0 < max(self.shape) <= LARGEST_SIDE or spec.nchannels < 1:
            raise PhotographsError(f"{path} is {spec.width} x {spec.height}: that is no photograph")
        base = str(spec.format)
        whole = {"uint8": 255, "uint16": 65535}.get(base, 0)
        bits = spec.get_int_attribute("oiio:BitsPerSample", 0)
        self.levels: int = (1 << bits) - 1 if 0 < bits < 16 and whole == 65535 else whole
        # a picture with fewer bits than its type is spread over all of it by its reader
        self.linear: bool = kind in _LINEAR or (whole == 0 and kind == "tiff")
        self._channels: int = spec.nchannels
        self.exposure = self._noted(spec, _EXPOSURE)
        self.aperture = self._noted(spec, _APERTURE)
        self.iso = self._noted(spec, _ISO)
        self.focal = self._noted(spec, _FOCAL)

    def _open(self) -> Any:
        config = self._oiio.ImageSpec()
        # raw files: light as it fell on the sensor, by the camera's colours, without brightening
        config.attribute("raw:ColorSpace", "linear")
        config.attribute("raw:auto_bright", 0)
        found = self._oiio.ImageInput.open(str(self._path), config)
        if found is None:
            why = str(self._oiio.geterror()).strip().splitlines()
            raise PhotographsError(
                f"{self._path} is no picture that can be read ({why[0] if why else 'unknown'}): "
                "convert it to TIFF or EXR"
            )
        return found

    @staticmethod
    def _noted(spec: Any, names: tuple[str, ...]) -> float | None:
        for name in names:
            found = float(spec.get_float_attribute(name, 0.0))
            if math.isfinite(found) and found > 0:
                return found
        return None

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        """Read some rows, see `Picture`.

        Parameters
        ----------
        first, last : int

        Returns
        -------
        (last - first, W, 3) float32

        Raises
        ------
        PhotographsError
            The rows cannot be read.
        """
        opened = self._open()
        try:
            spec = opened.spec()
            colours = min(self._channels, 3)
            if spec.tile_width:
                found = opened.read_image(0, 0, 0, colours, "float")
                found = None if found is None else np.asarray(found)[first:last]
            else:
                found = opened.read_scanlines(first + spec.y, last + spec.y, 0, 0, colours, "float")
            if found is None:
                raise PhotographsError(f"{self._path} cannot be read ({opened.geterror()})")
        finally:
            opened.close()
        out = np.asarray(found, np.float32).reshape(last - first, self.shape[1], colours)
        if colours < 3:
            return np.repeat(out[..., :1], 3, axis=-1)
        return out


def by_openimageio(oiio: Any) -> Reader:
    """Make a reader of pictures of a library.

    Parameters
    ----------
    oiio : module
        `OpenImageIO`.

    Returns
    -------
    callable
        From a path to a `Picture`.
    """
    return lambda path: OpenImageIoPicture(oiio, path)
