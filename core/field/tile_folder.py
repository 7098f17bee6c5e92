"""The folder of a tile, as fields of version 2 have it: a .npy for each array.

Of captures whose basis images were not kept there is nothing to fit again, so fields of version 2
are read as they are. A capture that was stopped in that version goes on in this one, and its field
has tiles of both kinds.

>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     rewrite_folder(Path(folder), {"scales": np.array([1, 0.5], np.float32)})
...     found = TileFolder(Path(folder))
...     print(list(found.sizes), found.load("scales").tolist())
['scales'] [1.0, 0.5]
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import LONGEST_HEAD, head
from ..errors import FieldError
from ..files import whole
from ..regular import WITHHELD, check_files_left, open_regular


class TileFolder:
    """The arrays of a tile in a folder, each mapped when it is asked for. As `TileFile`.

    Parameters
    ----------
    path : Path
        The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def sizes(self) -> dict[str, int]:
        """The names of its arrays, and how many bytes each file has."""
        return {p.stem: p.stat().st_size for p in self.path.glob("*.npy") if p.is_file()}

    def load(self, name: str) -> NDArray:
        """One of its arrays.

        Parameters
        ----------
        name : str

        Returns
        -------
        array
            Mapped, and read only.

        Raises
        ------
        FieldError
            If there is none of that name, or it is damaged.
        """
        path = self.path / f"{name}.npy"
        try:
            with open_regular(path) as file:
                shape, dtype, first = head(file.read(LONGEST_HEAD))
                size = file.seek(0, 2)
            if first + math.prod(shape) * dtype.itemsize != size:
                raise ValueError(f"it has not the size of its shape {shape}")
            if not math.prod(shape):
                return np.zeros(shape, dtype)  # nothing to map
            return np.memmap(path, dtype, "r", first, shape)
        except (OSError, ValueError) as e:
            if isinstance(e, OSError):
                check_files_left(e)
                if e.errno in WITHHELD:
                    raise FieldError(
                        f"{path} cannot be read ({e}): see its permissions and disk"
                    ) from e
            raise FieldError(f"{path} is missing or damaged ({e}): fit again") from e


def rewrite_folder(path: Path, arrays: dict[str, NDArray]) -> None:
    """Put arrays into the folder of a tile, each whole or not at all.

    Parameters
    ----------
    path : Path
        The folder.
    arrays : dict of str to array
        By their names.

    Raises
    ------
    OSError
        If one cannot be written.
    """
    for name, array in arrays.items():
        with whole(path / f"{name}.npy") as partial, partial.open("wb") as file:
            np.save(file, array)
