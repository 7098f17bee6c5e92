"""Fitting: from a capture set to a reflectance field, tile by tile (paper 5).

Examples
--------
>>> import tempfile
>>> from arto.core.capture import capture_set
>>> from arto.core.field.field import Field
>>> from arto.core.patterns import pattern_set
>>> folder = tempfile.TemporaryDirectory()
>>> here, cube, white = Path(folder.name), Hemicube(patches=1), pattern_set("white")
>>> capture_set.write(here / "captured", cube, white, np.full((6, 1, 2, 4, 3), 0.1))
>>> for step in fit(CaptureSet(here / "captured"), here / "field", choice="whole"):
...     pass
>>> Field(here / "field").shares()["whole"]
1.0
>>> folder.cleanup()
"""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture.basis_images import BasisImages
from ..capture.capture_set import CaptureSet
from ..capture.head import CaptureHead
from ..capture.moments import Moments
from ..capture.tile_data import TileData
from ..field.about import About
from ..field.through import tells_more
from ..field.tile_writer import TileWriter
from ..field.writer import FieldWriter, write_tile
from ..hemicube import Hemicube
from ..patterns import LobedSet, PatternSet
from ..supports import BOX, NOTHING, WHOLE
from . import choice as choices
from .evidence import evidence
from .lobes import choose_lobes, write_lobes
from .search import search

# The approximate share of the first pass over the images in the work on a tile.
READING = 0.4


def fit_tile(
    data: BasisImages | TileData,
    patterns: PatternSet,
    hemicube: Hemicube,
    choice: str,
    samples: float | None = None,
    separate: bool = False,
    noise: tuple[float, float] | None = None,
) -> Iterator[float | TileWriter]:
    """Fit one tile.

    In memory at a time are the images of one patch, one number for each patch and pixel, and what
    was fitted so far.

    Parameters
    ----------
    data : BasisImages or TileData
    patterns : PatternSet
    hemicube : Hemicube
    choice : str
        One of `choice.CHOICES`.
    samples : float, optional
        Samples a pixel of the capture, which determine its noise; None for no noise.
    separate : bool
        Whether each channel gets a support of its own.
    noise : tuple of 2 float, optional
        Of photographs, see `CaptureHead.noise`.

    Yields
    ------
    float or TileWriter
        The share that is done; at last the tile, ready to be written.

    Raises
    ------
    CaptureSetError
        A basis image cannot be read.
    """
    patches = len(hemicube)
    shape = (data.region.height, data.region.width)
    sizes = np.empty((patches, data.region.pixels), np.float32)
    ones = np.ones(3, np.float32)
    lobed = patterns if isinstance(patterns, LobedSet) and choice == "auto" else None
    sharp = np.zeros(data.region.pixels, np.float32)

    def look(k: int, images: NDArray) -> None:
        if lobed:
            sharp[...] += np.matmul(images[lobed.base].reshape(-1, 3), ones)
        # a product, which adds over so short an axis several times as fast as a sum
        np.matmul(patterns.coefficient(images).reshape(-1, 3), ones, out=sizes[k])

    around = data.around(look)
    yield READING
    layers = {"own": around.own, "alpha": around.alpha, **around.guides}
    if around.behind is not None and tells_more(around.behind, around.alpha):
        layers["through"] = around.behind
    writer = TileWriter(data.region, layers)
    uncertain, grain = None, data.grain_of
    if noise is not None:
        # of the sum over three channels; no camera resolves grains
        uncertain = 3 * patterns.noise_gain * noise[0], patterns.noise_gain * noise[1]
        grain = None
    known = evidence(sizes, shape, hemicube.solid_angles, samples, grain, uncertain)
    brightest = None
    if choice == choices.STAGE_AND_MATTE:
        brightest = sizes.argmax(axis=0)
    plain = choice not in (choices.SEARCH, choices.STAGE_AND_MATTE)
    for k in range(patches):
        extent = hemicube.extent(k)
        if plain:
            # of most pixels a patch only has the coefficient looked at
            coefficient = data.coefficient(k, patterns).reshape(-1, 3)
            lit = choices.entries(choice, coefficient, known, k)
            if lobed:
                images, share = data.images_at(k, lit), sharp / np.maximum(known.total, 1e-30)
                found = choose_lobes(images, lobed, known, k, lit, extent, data.together, share)
                write_lobes(writer, coefficient, lit, found)
                yield READING + (1 - READING) * (k + 1) / patches
                continue
            codes = np.full(len(coefficient), NOTHING, np.uint8)
            codes[lit], parameters = choices.choose_lit(
                choice, data.images_at(k, lit), patterns, known, k, lit, extent, separate
            )
            writer.add(codes, coefficient, parameters)
            yield READING + (1 - READING) * (k + 1) / patches
            continue
        images = data.images(k).reshape(len(patterns), -1, 3)
        coefficient = patterns.coefficient(images)
        if choice == choices.SEARCH:
            codes, _ = choices.choose("whole", images, coefficient, patterns, known, k, extent)
            boxes = search(images, patterns, extent, data.region.height)
            parameters = {BOX.code: boxes[codes == WHOLE.code]}
            codes[codes == WHOLE.code] = BOX.code
        else:
            # the straightforward combination: a Light Stage, and one matte where it is brightest
            assert brightest is not None
            codes, _ = choices.choose("whole", images, coefficient, patterns, known, k, extent)
            codes[(brightest == k) & (codes == WHOLE.code)] = BOX.code
            parameters = {
                s.code: s.fit(Moments.from_basis(images[:, codes == s.code], patterns, extent))
                for s in (WHOLE, BOX)
            }
        writer.add(codes, coefficient, parameters)
        yield READING + (1 - READING) * (k + 1) / patches
    yield writer


def fit_into(
    captured: CaptureSet, tile: int, folder: Path
) -> Generator[float, None, dict[str, Any]]:
    """Fit a tile of a capture set as its description asks, and write it into a field's folder.

    Parameters
    ----------
    captured : CaptureSet
    tile : int
        The number of the tile.
    folder : Path
        The folder of the field.

    Yields
    ------
    float
        The share that is done.

    Returns
    -------
    dict
        The tile's entry in `field.json`.

    Raises
    ------
    CaptureSetError
        A basis image cannot be read, or the set does not say what to fit it with.
    FieldError
        The folder cannot be written.
    PatternError
        The patterns cannot identify what the set is to be fitted with.
    """
    choice, separate = captured.head.told_choice
    choices.check(choice, captured.patterns, separate)
    with captured.open(tile) as data:
        for step in fit_tile(
            data, captured.patterns, captured.hemicube, choice, captured.samples, separate,
            captured.head.noise,
        ):  # fmt: skip
            if isinstance(step, TileWriter):
                folder.mkdir(exist_ok=True)
                return write_tile(folder, tile, step, captured.hemicube).to_json()
            yield step
    raise AssertionError("a fit ends with its tile")


def about_of(head: CaptureHead, choice: str, separate: bool) -> About:
    """Collect what the description of a field says beside its tiles.

    Parameters
    ----------
    head : CaptureHead
        Of the capture set.
    choice : str
    separate : bool

    Returns
    -------
    About
    """
    return About(
        choice=choice,
        separate=separate,
        scene=head.scene,
        colour_space=head.colour_space,
        samples=head.samples,
        file=head.file,
        frame=head.frame,
        view_layer=head.view_layer,
        far=head.far,
        key=head.key,
        fingerprint=head.fingerprint,
        route=head.route,
        shot=head.shot,
        catchers=head.catchers,
        take=head.take,
        pair=head.pair,
        behind=head.behind,
        portals=head.portals,
    )


def fit(
    captured: CaptureSet,
    folder: Path,
    choice: str = "auto",
    separate: bool = False,
    draft: bool = False,
) -> Iterator[tuple[float, str]]:
    """Fit a whole capture set and write the field.

    The field takes the place of an older one only when it is complete. If the generator is closed
    early, the older one stays.

    Parameters
    ----------
    captured : CaptureSet
    folder : Path
        The folder of the field.
    choice : str
        One of `choice.CHOICES`.
    separate : bool
        Whether each channel gets a support of its own.
    draft : bool
        Whether it is a small picture of a capture that is not complete, see `About`.

    Yields
    ------
    share : float
        How much is done, 0 to 1.
    text : str
        What is being done.

    Raises
    ------
    CaptureSetError
        A basis image cannot be read.
    FieldError
        The choice is unknown, or the folder cannot be written.
    PatternError
        The patterns do not identify the moments of the choice.
    """
    choices.check(choice, captured.patterns, separate)
    begun, reading = time.perf_counter(), 0.0
    about = replace(about_of(captured.head, choice, separate), draft=draft or None)
    if draft:  # it has no takes beside it
        about = replace(about, catchers=None, take=None)
    writer = FieldWriter(folder, captured.hemicube, captured.shape, about)
    try:
        tiles = len(captured.regions)
        for tile in range(tiles):
            yield tile / tiles, f"fitting tile {tile + 1} of {tiles}"
            start = time.perf_counter()
            with captured.open(tile) as data:
                for step in fit_tile(
                    data, captured.patterns, captured.hemicube, choice, captured.samples, separate,
                    captured.head.noise,
                ):  # fmt: skip
                    if isinstance(step, TileWriter):
                        writer.add(step)
                    else:
                        if step == READING:
                            reading += time.perf_counter() - start
                        yield (tile + step) / tiles, f"fitting tile {tile + 1} of {tiles}"
        took = round(time.perf_counter() - begun, 3)
        writer.close(replace(about, fit_seconds=took, read_seconds=round(reading, 3)))
    finally:
        writer.abandon()
