"""The folder of a tile, as fields of version 2 have it: a .npy for each array.

Of captures whose basis images were not kept there is nothing to fit again, so fields of version 2
are read as they are. A capture that was stopped in that version goes on in this one, and its field
has tiles of both kinds.
"""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FieldError
from ..files import whole


class TileFolder:
    """The arrays of a tile in a folder, each mapped when it is asked for. As `TileFile`."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def sizes(self) -> dict[str, int]:
        """The names of its arrays, and how many bytes each file has."""
        return {p.stem: p.stat().st_size for p in self.path.glob("*.npy") if p.is_file()}

    def load(self, name: str) -> NDArray:
        """One of its arrays, mapped and read only. Raises FieldError where there is none."""
        path = self.path / f"{name}.npy"
        try:
            # a pipe in its place would be waited for
            if not stat.S_ISREG(path.stat().st_mode):
                raise OSError("it is no file")
            return np.lib.format.open_memmap(path, mode="r")
        except (OSError, ValueError, EOFError) as e:
            raise FieldError(f"{path} is missing or damaged ({e}): fit again") from e


def rewrite_folder(path: Path, arrays: dict[str, NDArray]) -> None:
    """Put arrays into the folder of a tile, each whole or not at all. Raises OSError."""
    for name, array in arrays.items():
        with whole(path / f"{name}.npy") as partial, partial.open("wb") as file:
            np.save(file, array)
