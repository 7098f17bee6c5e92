"""Fitting: from a capture set to a reflectance field, tile by tile (paper 5)."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture.basis_images import BasisImages
from ..capture.capture_set import CaptureSet
from ..capture.moments import Moments
from ..capture.tile_data import TileData
from ..field.tile_writer import TileWriter
from ..field.writer import FieldWriter, write_tile
from ..hemicube import Hemicube
from ..patterns import PatternSet
from ..supports import BOX, NOTHING, WHOLE
from . import choice as choices
from .evidence import evidence
from .search import search

# How much of the work on a tile the first pass over its images is, about.
READING = 0.4


def fit_tile(
    data: BasisImages | TileData,
    patterns: PatternSet,
    hemicube: Hemicube,
    choice: str,
    samples: float | None = None,
    separate: bool = False,
) -> Iterator[float | TileWriter]:
    """Fit one tile: yields the share that is done, and last the tile, ready to be written.

    What is in memory of it at a time is one patch's images, a number for each patch and pixel, and
    what was fitted. samples: samples a pixel of the capture, which tell how far its noise can be
    believed (None: no noise); separate: a support for each channel.
    """
    patches = len(hemicube)
    shape = (data.region.height, data.region.width)
    sizes = np.empty((patches, data.region.pixels), np.float32)
    ones = np.ones(3, np.float32)

    def look(k: int, images: NDArray) -> None:
        # a product, which adds over so short an axis several times as fast as a sum
        np.matmul(patterns.coefficient(images).reshape(-1, 3), ones, out=sizes[k])

    around = data.around(look)
    yield READING
    layers = {"own": around.own, "alpha": around.alpha, **around.guides}
    writer = TileWriter(data.region, layers)
    known = evidence(sizes, shape, hemicube.solid_angles, samples, data.grain_of)
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
    """Fit a tile of a capture set as its description asks, and write it into a field's folder:
    yields the share that is done, returns the tile's entry in `field.json`.

    Raises CaptureSetError, FieldError.
    """
    choice, separate = captured.head["choice"], captured.head["separate"]
    with captured.open(tile) as data:
        for step in fit_tile(
            data, captured.patterns, captured.hemicube, choice, captured.samples, separate
        ):
            if isinstance(step, TileWriter):
                folder.mkdir(exist_ok=True)
                return write_tile(folder, tile, step, captured.hemicube)
            yield step
    raise AssertionError("a fit ends with its tile")


def about_of(captured: CaptureSet, choice: str, separate: bool, **about: Any) -> dict[str, Any]:
    """What a field of a capture set says of itself, beside its tiles."""
    keep = ("scene", "colour_space", "samples", "file", "frame", "view_layer", "far", "key")
    keep += ("fingerprint", "route", "shot", "catchers", "take", "pair")
    known = {key: captured.head[key] for key in keep if key in captured.head}
    return {"choice": choice, "separate": separate} | known | about


def fit(
    captured: CaptureSet,
    folder: Path,
    choice: str = "auto",
    separate: bool = False,
    **about: Any,
) -> Iterator[tuple[float, str]]:
    """Fit a whole capture set and write the field: yields (share done, what is being done).

    choice: one of `choice.CHOICES`; separate: a support for each channel. The field replaces
    another in `folder` only when it is complete: closing the generator early leaves what was
    there. Raises CaptureSetError, FieldError, PatternError.
    """
    choices.check(choice, captured.patterns, separate)
    begun, reading = time.perf_counter(), 0.0
    about = about_of(captured, choice, separate, **about)
    writer = FieldWriter(folder, captured.hemicube, captured.shape, **about)
    try:
        tiles = len(captured.regions)
        for tile in range(tiles):
            yield tile / tiles, f"fitting tile {tile + 1} of {tiles}"
            start = time.perf_counter()
            with captured.open(tile) as data:
                for step in fit_tile(
                    data, captured.patterns, captured.hemicube, choice, captured.samples, separate
                ):
                    if isinstance(step, TileWriter):
                        writer.add(step)
                    else:
                        if step == READING:
                            reading += time.perf_counter() - start
                        yield (tile + step) / tiles, f"fitting tile {tile + 1} of {tiles}"
        writer.head["about"]["fit_seconds"] = round(time.perf_counter() - begun, 3)
        writer.head["about"]["read_seconds"] = round(reading, 3)
        writer.close()
    finally:
        writer.abandon()
