"""The capture set: the basis images on disk, and what made them (paper 4).

A capture set is a folder with `capture.json` and EXR files, see docs/capture-format.md. A basis
image is the part of a file whose name ends in `Combined_ARTO_<patch>_<pattern>`, as Blender names a
light group's pass. Other parts are the whole picture (`Combined`, with alpha) and its albedo,
normal and depth.

Examples
--------
>>> import tempfile
>>> from arto.core.patterns import pattern_set
>>> cube = Hemicube(patches=1)
>>> with tempfile.TemporaryDirectory() as folder:
...     write(Path(folder), cube, pattern_set("white"), np.full((6, 1, 4, 8, 3), 0.5))
...     there = CaptureSet(Path(folder))
...     tile = there.read(0)
>>> there.shape, tile.basis.shape, float(tile.basis.max()), float(tile.own.max())
((4, 8), (6, 1, 4, 8, 3), 0.5, 0.0)
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import exr
from ..errors import CaptureSetError
from ..hemicube import Hemicube
from ..patterns import PatternSet
from ..region import Region
from . import head as heads
from .basis_images import BasisImages
from .head import CaptureHead
from .kinds import Route
from .names import BEHIND, BEHIND_LIGHT, COMBINED, group_name
from .tile_data import TileData
from .tile_entry import TileEntry, sums_of


class CaptureSet:
    """A capture set, opened: its head is read, the images are not.

    Parameters
    ----------
    folder : Path
        The set's.
    unfinished : bool
        Whether tiles may be missing that are not rendered yet.
    head : CaptureHead, optional
        The set's head, where it is not to be read from the folder.

    Raises
    ------
    CaptureSetError
        The set is missing, damaged, unfinished, or of another version.
    """

    def __init__(
        self, folder: Path, unfinished: bool = False, head: CaptureHead | None = None
    ) -> None:
        self.folder = folder
        self.head = head or heads.read(folder)
        done, tiles = self.head.done, len(self.head.tiles)
        if not unfinished and done < tiles:
            raise CaptureSetError(
                f"{folder} is unfinished ({done} of {tiles} tiles): run Capture again, "
                "it goes on from there"
            )

    @property
    def hemicube(self) -> Hemicube:
        """The patches that were lit."""
        return self.head.hemicube

    @property
    def patterns(self) -> PatternSet:
        """The patterns that the patches showed."""
        return self.head.patterns

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the whole picture."""
        return self.head.height, self.head.width

    @property
    def regions(self) -> tuple[Region, ...]:
        """The places of the tiles in the picture."""
        return tuple(tile.region for tile in self.head.tiles)

    @property
    def files(self) -> tuple[tuple[str, ...], ...]:
        """The names of the files of each tile."""
        return tuple(tile.files for tile in self.head.tiles)

    @property
    def samples(self) -> float | None:
        """Samples of each pixel; None where the set was rendered without noise."""
        return self.head.samples or None

    @property
    def pixels(self) -> int:
        """The number of pixels of all tiles."""
        return sum(r.pixels for r in self.regions)

    @property
    def kept(self) -> bool:
        """Whether the basis images stay once they were fitted."""
        return self.head.kept is not False

    def open(self, tile: int) -> BasisImages:
        """Open the basis images of a tile, to be read patch by patch.

        Parameters
        ----------
        tile : int
            The tile's number.

        Returns
        -------
        BasisImages
            The caller closes them.

        Raises
        ------
        CaptureSetError
            The images were not kept, are missing, or hold what is no light. Some of this is found
            only when the images are read.
        """
        entry = self.head.tiles[tile]
        if not self.kept and not entry.files:
            raise CaptureSetError(
                f"the basis images of {self.folder} were not kept: capture again, with Keep Basis "
                "Images on Always"
            )
        return BasisImages(
            self.folder,
            entry.renders,
            entry.region,
            self.hemicube,
            self.patterns,
            bool(self.head.grain),
            # the paths of two renders differ: the grain of one is not that of the other
            self.head.route in (None, Route.ALL),
            entry.sums,
            self.head.radiance or 1.0,
        )

    def read(self, tile: int) -> TileData:
        """Read all of a tile at once.

        Parameters
        ----------
        tile : int
            The tile's number.

        Returns
        -------
        TileData

        Raises
        ------
        CaptureSetError
            As `open`.
        """
        with self.open(tile) as images:
            return images.read()


def write(
    folder: Path,
    hemicube: Hemicube,
    patterns: PatternSet,
    basis: NDArray,
    own: NDArray | None = None,
    alpha: NDArray | None = None,
    behind: NDArray | None = None,
    **about: Any,
) -> None:
    """Write basis images, for example photographs, as a capture set of one tile.

    Parameters
    ----------
    folder : Path
    hemicube : Hemicube
        K patches.
    patterns : PatternSet
        P patterns.
    basis : (K, P, H, W, 3) float
        Scene-linear: the picture when one patch shows one pattern.
    own : (H, W, 3) float, optional
        The light that is always there; by default none.
    alpha : (H, W) float, optional
        By default 1.
    behind : (H, W, 3) float, optional
        How much of the world behind is seen, by channel; by default 1 - alpha.
    **about : object
        What else `capture.json` says, by its names there.

    Raises
    ------
    CaptureSetError
        The folder cannot be written, or `about` has a value that cannot be right.
    ExrError
        The images cannot be written.
    """
    shape = basis.shape[2:4]
    combined = np.ones((*shape, 4), np.float32)
    # summed as it is subtracted when read
    combined[..., :3] = basis.sum(axis=(0, 1), dtype=np.float64)
    if own is not None:
        combined[..., :3] += own
    if alpha is not None:
        combined[..., 3] = alpha
    layers = {COMBINED: combined}
    if behind is not None:
        layers[BEHIND[0]] = (behind * BEHIND_LIGHT).astype(np.float32)
    for k in range(len(hemicube)):
        for p, name in enumerate(patterns.patterns):
            layers[f"Combined_{group_name(k, name)}"] = basis[k, p].astype(np.float32)
    exr.write(folder / "tile_0000.exr", layers)
    region = Region(0, 0, shape[1], shape[0])
    name = "tile_0000.exr"
    tile = TileEntry(region, (name,), done=True, sums=sums_of(folder, [name]))
    plain = CaptureHead(hemicube, patterns, shape[0], shape[1], (tile,))
    heads.write(folder, heads.from_json(plain.to_json() | about, folder))
