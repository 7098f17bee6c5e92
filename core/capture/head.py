"""The head of a capture set: what `capture.json` says, checked (docs/capture-format.md).

A head is read by `read` and written by `write` alone. Everybody else sees a `CaptureHead`, whose
values are of the kinds and within the bounds that they must have. Heads do not change: what is
rendered or fitted makes another one, by `dataclasses.replace`.

Examples
--------
>>> from arto.core.region import Region
>>> tiles = (TileEntry(Region(0, 0, 24, 9)), TileEntry(Region(0, 9, 24, 9)))
>>> head = CaptureHead(Hemicube(patches=2), pattern_set("linear"), 18, 24, tiles, samples=64)
>>> after = head.with_tile(0, done=True, files=("tile_0000.exr",))
>>> head.done, after.done, after.traced
(0, 1, 13824)
>>> from_json(after.to_json() | {"route": "none"}, Path("capture"))
Traceback (most recent call last):
...
arto.core.errors.CaptureSetError: ... is damaged ('route' cannot be 'none'): capture again
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import marked, signed
from ..description import MOST_TILES
from ..errors import CaptureSetError, HemicubeError, PatternError, ShotError
from ..hemicube import Hemicube
from ..patterns import PatternSet, pattern_set
from ..shot import Shot
from ..values import Values
from .agreement import Caution
from .kinds import Route, Take
from .tile_entry import MOST_SAMPLES, TileEntry

FORMAT = "ARTO capture set"
VERSION = 2
READABLE = (1, VERSION)
HEADER = "capture.json"
# What Blender takes for a seed, and for a frame.
LARGEST_SEED = LARGEST_FRAME = 2**31 - 1
# A hundred years.
LONGEST = 3.2e9
# Fainter patches would come near the smallest of 32-bit floats.
LEAST_RADIANCE = 2.0**-60


@dataclass(frozen=True)
class CaptureHead:
    """What a capture set is of, and what made it. What its file does not say is None.

    Parameters
    ----------
    hemicube, patterns : what was lit, with what.
    height, width : of the whole picture, in pixels.
    tiles : what is rendered of it.
    key, asked : digests of all that decides the images, and of the artist's settings alone.
    samples : of each pixel, all seeds together. 0 where the set was rendered without noise.
    seed, route : of the noise; how patches and patterns were told apart.
    radiance : of the patches where a pattern is 1, in the files; 1 where it is not said.
    grain : whether each patch has an image more that shows its noise.
    adaptive : whether the patches are as fine as the scene needs them.
    far : whether the light comes from far away, as a world's.
    blender : the version that rendered.
    colour_space : in which light is scene-linear.
    film_transparent : whether the artist's film is.
    changed : each setting that was changed on the stage, [before, while].
    catchers : the names of the shadow catchers.
    take : which take of a shot with shadow catchers it is.
    kept : whether the basis images stay once they were fitted.
    choice, separate : what they are fitted with; `separate`: a support for each channel.
    scene, file, view_layer, shot, frame : what was captured.
    fingerprint : a digest of everything in the picture, by its name.
    caution : what the check of the light said.
    seconds : that rendering took, so far.
    pair : of a take beside the first, the key of the first.
    behind : whether the images have a layer of what the camera sees of the world behind.
    noise : of photographs: the variance of a channel of an image without light, and its rise with
        the light.
    portals : whether the light of the patches has what Ray Portals show; None for none.
    others : what the file says beside that; it is written again.
    """

    hemicube: Hemicube
    patterns: PatternSet
    height: int
    width: int
    tiles: tuple[TileEntry, ...] = ()
    key: str | None = None
    asked: str | None = None
    samples: float | None = None
    seed: int | None = None
    route: Route | None = None
    radiance: float | None = None
    grain: bool | None = None
    adaptive: bool | None = None
    far: bool | None = None
    blender: str | None = None
    colour_space: str | None = None
    film_transparent: bool | None = None
    portals: bool | None = None
    changed: Mapping[str, list[Any]] | None = None
    catchers: tuple[str, ...] | None = None
    take: Take | None = None
    kept: bool | None = None
    choice: str | None = None
    separate: bool | None = None
    scene: str | None = None
    file: str | None = None
    view_layer: str | None = None
    shot: Shot | None = None
    frame: int | None = None
    fingerprint: Mapping[str, str] | None = None
    caution: Caution | None = None
    seconds: float | None = None
    pair: str | None = None
    behind: bool | None = None
    noise: tuple[float, float] | None = None
    others: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def read(said: Values) -> CaptureHead:
        """Read a `capture.json`.

        Parameters
        ----------
        said : Values
            What the file says.

        Returns
        -------
        CaptureHead

        Raises
        ------
        CaptureSetError
            A value is missing, of the wrong kind or out of bounds: the message names it. Or the
            set is of another version.
        """
        _check_version(said)
        try:
            hemicube = Hemicube.from_json(said.kind("hemicube", dict, {}))
        except HemicubeError as e:
            raise said.damaged("hemicube", e) from e
        try:
            patterns = pattern_set(said.kind("patterns", str, ""))
        except PatternError as e:
            raise said.damaged("patterns", e) from e
        try:
            there = said.kind("shot", dict)
            shot = Shot.from_json(there) if there else None
        except ShotError as e:
            raise said.damaged("shot", e) from e
        height, width = said.shape()
        tiles = [TileEntry.read(r, said.inside(entry, "tiles")) for r, entry in said.tiles()]
        caution = said.kind("caution", dict)
        fingerprint = said.kind("fingerprint", dict) and said.texts("fingerprint")
        changed = said.kind("changed", dict)
        for name, pair in (changed or {}).items():
            if not isinstance(pair, list) or len(pair) != 2:
                raise said.wrong("changed", {name: pair})
        head = CaptureHead(
            hemicube=hemicube,
            patterns=patterns,
            height=height,
            width=width,
            tiles=tuple(tiles),
            key=said.some_text("key"),
            asked=said.some_text("asked"),
            samples=said.real("samples", 0, MOST_SAMPLES),
            seed=said.count("seed", 0, LARGEST_SEED),
            route=said.one_of("route", Route),
            radiance=said.real("radiance", LEAST_RADIANCE, 1),
            grain=said.kind("grain", bool),
            adaptive=said.kind("adaptive", bool),
            far=said.kind("far", bool),
            blender=said.some_text("blender"),
            colour_space=said.some_text("colour_space"),
            film_transparent=said.kind("film_transparent", bool),
            portals=said.kind("portals", bool),
            changed=changed,
            catchers=said.names("catchers", MOST_TILES),
            take=said.one_of("take", Take),
            kept=said.kind("kept", bool),
            choice=said.some_text("choice"),
            separate=said.kind("separate", bool),
            scene=said.some_text("scene"),
            file=said.some_text("file"),
            view_layer=said.some_text("view_layer"),
            shot=shot,
            frame=said.count("frame", -LARGEST_FRAME, LARGEST_FRAME),
            fingerprint=fingerprint,
            caution=Caution.read(said.inside(caution, "caution", "caution.")) if caution else None,
            seconds=said.real("seconds", 0, LONGEST),
            pair=said.some_text("pair"),
            behind=said.kind("behind", bool),
            noise=said.pair("noise"),
            others=said.others([*_WRITTEN, *(f.name for f in fields(CaptureHead))]),
        )
        head._check(said)
        return head

    def _check(self, said: Values) -> None:
        """Raise CaptureSetError where what is written for other programs is not what the rest of
        the description says."""
        for name, value in self._written().items():
            if said.data.get(name, value) != value:
                raise said.wrong(name, said.data[name])
        if all(tile.done for tile in self.tiles):
            said.check_apart([tile.region for tile in self.tiles])

    def _written(self) -> dict[str, Any]:
        """What follows from the rest, for other programs."""
        polynomials = zip(self.patterns.patterns, self.patterns.coefficients, strict=True)
        return {
            "format": FORMAT,
            "patches": len(self.hemicube),
            "pattern_polynomials": {name: np.array(row).tolist() for name, row in polynomials},
        }

    def to_json(self) -> dict[str, Any]:
        """Give what `read` reads, in the order in which files have it.

        Returns
        -------
        dict
        """
        written = self._written()
        out: dict[str, Any] = {
            "format": written["format"],
            "version": VERSION if self.radiance else READABLE[0],
            "height": self.height,
            "width": self.width,
            "hemicube": self.hemicube.to_json(),
            "patches": written["patches"],
            "patterns": self.patterns.name,
            "pattern_polynomials": written["pattern_polynomials"],
        }
        for name in (f.name for f in fields(self) if f.name not in _APART):
            value = getattr(self, name)
            if isinstance(value, Shot):
                value = value.to_json()
            if value is not None:
                out[name] = list(value) if isinstance(value, tuple) else value
        if self.caution is not None:
            out["caution"] = self.caution.to_json()
        elif self.fingerprint is not None:
            out["caution"] = None  # the light was checked, and nothing was found
        out |= dict(self.others)
        out["tiles"] = [tile.to_json() for tile in self.tiles]
        if self.seconds is not None:
            out["seconds"] = self.seconds
        if self.pair is not None:
            out["pair"] = self.pair
        return out

    def with_tile(self, number: int, **changes: Any) -> CaptureHead:
        """Change some values of one tile's entry.

        Parameters
        ----------
        number : int
            Of the tile.
        **changes : object
            The values, by their names in `TileEntry`.

        Returns
        -------
        CaptureHead
            Another head; this one stays as it is.
        """
        tile = replace(self.tiles[number], **changes)
        return replace(self, tiles=(*self.tiles[:number], tile, *self.tiles[number + 1 :]))

    @property
    def done(self) -> int:
        """How many tiles were rendered."""
        return sum(tile.done for tile in self.tiles)

    @property
    def traced(self) -> float:
        """Paths that were traced so far: pixels times samples."""
        pixels = sum(tile.region.pixels for tile in self.tiles if tile.done)
        return pixels * (self.samples or 0)

    @property
    def told_route(self) -> Route:
        """The route. Raises CaptureSetError for a set that Blender did not render."""
        if self.route is None:
            raise CaptureSetError("this capture set does not say how it was rendered: capture anew")
        return self.route

    @property
    def told_choice(self) -> tuple[str, bool]:
        """What it is fitted with, and whether each channel apart. Raises CaptureSetError for a set
        that does not say."""
        if self.choice is None or self.separate is None:
            raise CaptureSetError("this capture set does not say what to fit it with: capture anew")
        return self.choice, self.separate


# What `read` checks and `to_json` writes that is no value of its own.
_WRITTEN = ("format", "version", "patches", "pattern_polynomials")
# Values that `to_json` writes in places of their own; the others are written where they are known.
_APART = {
    *("hemicube", "patterns", "height", "width"),
    *("caution", "others", "tiles", "seconds", "pair"),
}


def _check_version(said: Values) -> None:
    if "version" not in said.data:
        raise said.error(f"{said.path} cannot be read (it has no version)")
    version = said.data["version"]
    if type(version) is not int or version not in READABLE:
        raise CaptureSetError(
            f"{said.path.parent} is a capture set of version {version!s:.20}; this ARTO reads "
            f"versions {READABLE[0]} and {VERSION}: capture again, or use the ARTO that made it"
        )


def _damaged(text: str) -> CaptureSetError:
    return CaptureSetError(f"{text}: capture again")


def read(folder: Path) -> CaptureHead:
    """Read the head of the capture set in a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    CaptureHead

    Raises
    ------
    CaptureSetError
        There is none, or it is damaged, or of another version.
    """
    path = folder / HEADER
    if not path.is_file():
        raise CaptureSetError(f"there is no capture set in {folder}: run Capture first")
    return CaptureHead.read(Values(path, _damaged))


def from_json(data: dict[str, Any], folder: Path) -> CaptureHead:
    """Read the head that an object in memory is.

    Parameters
    ----------
    data : dict
    folder : Path
        That the capture set goes into. Messages name it.

    Returns
    -------
    CaptureHead

    Raises
    ------
    CaptureSetError
        A value is missing, or cannot be right.
    """
    return CaptureHead.read(Values.of(data, folder / HEADER, _damaged))


def write(folder: Path, head: CaptureHead) -> None:
    """Write `capture.json` into a folder, whole or not at all.

    Parameters
    ----------
    folder : Path
        Made and marked as ARTO's, where it is new.
    head : CaptureHead

    Raises
    ------
    CaptureSetError
        The file cannot be written.
    """
    path = folder / HEADER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        marked.mark(folder, "capture")
        signed.write(path, head.to_json())
    except OSError as e:
        raise CaptureSetError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that can "
            "be written"
        ) from e
