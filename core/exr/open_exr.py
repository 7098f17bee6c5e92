"""The package OpenEXR, for Python without Blender; no other module imports it.

Examples
--------
>>> OpenExr().name
'OpenEXR'
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from .head import PartLayout
from .window import Box

# A function of every library OpenEXR of version 3.
_SYMBOL = "exr_get_library_version"


class OpenExr:
    """The package OpenEXR as a `library.Library`, imported when it is first needed."""

    name = "OpenEXR"

    def decode(self, path: Path, parts: Sequence[PartLayout]) -> list[dict[str, NDArray]]:
        """Read all pixels of a file.

        Parameters
        ----------
        path : Path
        parts : sequence of PartLayout

        Returns
        -------
        list of dict of str to (H, W) array

        Raises
        ------
        ExrError
            Pixels cannot be decoded, or the package is missing.
        """
        package = _package()
        try:
            file = package.File(str(path), separate_channels=True)
        except Exception as e:  # the package raises plain RuntimeErrors of many wordings
            raise ExrError(f"{path} cannot be read ({e}): it is truncated or no EXR file") from e
        # the package warns of a part that it cannot decode, and leaves it out
        if len(file.parts) != len(parts):
            raise ExrError(f"{path} has a damaged part: make it again")
        found = []
        for part in file.parts:
            found.append({name: channel.pixels for name, channel in part.channels.items()})
            part.channels.clear()  # otherwise the part would keep planes that are let go
        return found

    def encode(
        self, path: Path, parts: Sequence[dict[str, NDArray]], box: Box, compression: str
    ) -> None:
        """Write a file that has the pixels.

        Parameters
        ----------
        path : Path
        parts : sequence of dict of str to (H, W) array
        box : Box
        compression : str

        Raises
        ------
        OSError, RuntimeError
            The file cannot be written.
        ExrError
            The package is missing, or does not know the compression.
        """
        package = _package()
        packing = getattr(package, f"{compression}_COMPRESSION", None)
        if packing is None:
            raise ExrError(
                f"{path} cannot be written: {self.name} packs no pixels as {compression} here"
            )
        corners = np.array(box[:2], np.int32), np.array(box[2:], np.int32)
        head = {
            "compression": packing,
            "type": package.scanlineimage,
            "dataWindow": corners,
            "displayWindow": corners,
        }
        made = [package.Part(dict(head), part, f"part{n}") for n, part in enumerate(parts)]
        package.File(made).write(str(path))


def _package() -> Any:
    """The package. Raises ExrError where it is not installed, or where it could not work."""
    # Only the loader of Linux gives a library another's symbols of the same name.
    if sys.platform == "linux" and hasattr(ctypes.CDLL(None), _SYMBOL):
        raise ExrError(
            "this program has an OpenEXR of its own, beside which the package OpenEXR does not "
            "work: choose the program's OpenImageIO (arto.core.exr.choose), as ARTO does when "
            "Blender enables it"
        )
    try:
        import OpenEXR
    except ImportError as e:
        raise ExrError(
            "EXR files need the package OpenEXR for Python: install it (pip install OpenEXR). "
            "Inside Blender enable ARTO, which chooses Blender's own OpenImageIO"
        ) from e
    return OpenEXR
