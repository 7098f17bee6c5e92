"""A tile's entry in the head of a capture set: what is rendered of it, and what was fitted.

Examples
--------
>>> seeds = (SeedEntry(96, ("a.exr",)), SeedEntry(32, ("b.exr",)))
>>> tile = TileEntry(Region(0, 0, 24, 18), ("a.exr", "b.exr"), done=True, seeds=seeds)
>>> tile.renders
[(0.75, ['a.exr']), (0.25, ['b.exr'])]
>>> tile.to_json()["seeds"]
[[96, ['a.exr']], [32, ['b.exr']]]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import checksum
from ..errors import CaptureSetError
from ..region import Region
from ..values import Values

# No renderer counts more samples of a pixel.
MOST_SAMPLES = 2**31 - 1
_NAMES = ("region", "files", "done", "seeds", "fitted", "sums")


@dataclass(frozen=True)
class SeedEntry:
    """A stretch of samples that a tile was rendered with.

    Parameters
    ----------
    samples : of each pixel.
    files : of the tile's files, those with the images of these samples.
    """

    samples: int
    files: tuple[str, ...]


@dataclass(frozen=True)
class TileEntry:
    """A tile of a capture set.

    Parameters
    ----------
    region : of the picture, rows from the top.
    files : the names of its EXR files, in the set's folder.
    done : whether it was rendered.
    seeds : where several stretches of samples were rendered, each of them.
    fitted : where it was fitted and its images went, its entry in `field.json`.
    sums : the checksums of its files, by their names. The version before has none.
    others : what the file says of it beside that.
    """

    region: Region
    files: tuple[str, ...] = ()
    done: bool = False
    seeds: tuple[SeedEntry, ...] = ()
    fitted: Mapping[str, Any] | None = None
    sums: Mapping[str, int] = field(default_factory=dict)
    others: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def read(region: Region, said: Values) -> TileEntry:
        """Read an entry of a head.

        Parameters
        ----------
        region : Region
            The tile's, which was read.
        said : Values
            The entry.

        Returns
        -------
        TileEntry

        Raises
        ------
        CaptureSetError
            A value is missing, or cannot be right.
        """
        files, done = said.kind("files", list), said.kind("done", bool)
        if files is None:
            raise said.wrong("files", files)
        if done is None:
            raise said.wrong("done", done)
        names = tuple(said.file_name(name, "files") for name in files)
        seeds = tuple(_seed(said, names, seed) for seed in said.kind("seeds", list, []))
        fitted = said.kind("fitted", dict)
        if fitted is not None:
            said.file_name(fitted_name(fitted), "fitted")
        sums = checked_sums(said)
        return TileEntry(region, names, done, seeds, fitted, sums, said.others(_NAMES))

    def to_json(self) -> dict[str, Any]:
        """Give what `read` reads.

        Returns
        -------
        dict
        """
        r = self.region
        out: dict[str, Any] = {
            "region": [r.x, r.y, r.width, r.height],
            "files": list(self.files),
            "done": self.done,
        }
        if self.seeds:
            out["seeds"] = [[seed.samples, list(seed.files)] for seed in self.seeds]
        if self.fitted is not None:
            out["fitted"] = dict(self.fitted)
        if self.sums:
            out["sums"] = dict(self.sums)
        return out | dict(self.others)

    @property
    def renders(self) -> list[tuple[float, list[str]]]:
        """Of each seed its share of the samples, and its files."""
        if not self.seeds:
            return [(1.0, list(self.files))]
        total = sum(seed.samples for seed in self.seeds)
        return [(seed.samples / total, list(seed.files)) for seed in self.seeds]


def sums_of(folder: Path, names: Iterable[str]) -> dict[str, int]:
    """Compute the checksums of files.

    Parameters
    ----------
    folder : Path
    names : iterable of str

    Returns
    -------
    dict of str to int
        By the names.

    Raises
    ------
    CaptureSetError
        A file cannot be read.
    """
    try:
        return {name: checksum.of_file(folder / name) for name in names}
    except OSError as e:
        raise CaptureSetError(f"{folder} lacks what was rendered ({e}): capture again") from e


def checked_sums(said: Values) -> dict[str, int]:
    """Read the checksums of files.

    Parameters
    ----------
    said : Values
        The description that may have them.

    Returns
    -------
    dict of str to int
        By the names of the files.

    Raises
    ------
    ArtoError
        One cannot be right.
    """
    found = said.kind("sums", dict, {})
    for name in found:
        said.whole(name, 0, 2**32 - 1, found)
    return found


def fitted_name(fitted: Mapping[str, Any]) -> Any:
    """Give the name of what a fitted tile is in.

    Parameters
    ----------
    fitted : dict
        The tile's entry in `field.json`.

    Returns
    -------
    object
        The name of its file, or of its folder where the version before fitted it. It is not
        checked.
    """
    return fitted.get("file", fitted.get("folder"))


def _seed(said: Values, files: tuple[str, ...], seed: Any) -> SeedEntry:
    """One of a tile's seeds, [samples, files], of the tile's files."""
    if not (isinstance(seed, list) and len(seed) == 2 and isinstance(seed[1], list)):
        raise said.wrong("seeds", seed)
    samples, names = seed
    if type(samples) is not int or not 1 <= samples <= MOST_SAMPLES:
        raise said.wrong("seeds", seed)
    if any(name not in files for name in names):
        raise said.wrong("seeds", seed)
    return SeedEntry(samples, tuple(names))
