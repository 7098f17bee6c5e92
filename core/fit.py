"""Fitting: from a capture set to a reflectance field, tile by tile (paper 5)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from . import choice as choices
from .capture_set import CaptureSet, TileData
from .evidence import evidence
from .field_writer import FieldWriter, TileWriter
from .hemicube import Hemicube
from .moments import Moments, channel_sum
from .patterns import PatternSet
from .search import search
from .supports import BOX, WHOLE


def fit_tile(
    data: TileData,
    patterns: PatternSet,
    hemicube: Hemicube,
    choice: str,
    samples: float | None = None,
    separate: bool = False,
) -> Iterator[float | TileWriter]:
    """Fit one tile: yields the share that is done, and last the tile, ready to be written.

    samples: samples a pixel of the capture, which tell how far its noise can be believed (None: no
    noise); separate: a support for each channel.
    """
    layers = {"own": data.own, "alpha": data.alpha, **data.guides}
    writer = TileWriter(data.region, layers)
    patches = len(data.basis)
    images = data.basis.reshape(patches, len(patterns), -1, 3)
    coefficients = patterns.coefficient(np.moveaxis(images, 1, 0))
    shape = (data.region.height, data.region.width)
    known = evidence(coefficients, shape, hemicube.solid_angles, samples, data.grain)
    brightest = None
    if choice == choices.STAGE_AND_MATTE:
        brightest = channel_sum(coefficients).argmax(axis=0)
    for k in range(patches):
        extent = hemicube.extent(k)
        if choice == choices.SEARCH:
            codes, _ = choices.choose(
                "whole", images[k], coefficients[k], patterns, known, k, extent
            )
            boxes = search(images[k], patterns, extent, data.region.height)
            parameters = {BOX.code: boxes[codes == WHOLE.code]}
            codes[codes == WHOLE.code] = BOX.code
        elif brightest is not None:
            # the straightforward combination: a Light Stage, and one matte where it is brightest
            codes, _ = choices.choose(
                "whole", images[k], coefficients[k], patterns, known, k, extent
            )
            codes[(brightest == k) & (codes == WHOLE.code)] = BOX.code
            parameters = {
                s.code: s.fit(Moments.from_basis(images[k][:, codes == s.code], patterns, extent))
                for s in (WHOLE, BOX)
            }
        else:
            codes, parameters = choices.choose(
                choice, images[k], coefficients[k], patterns, known, k, extent, separate
            )
        writer.add(codes, coefficients[k], parameters)
        yield (k + 1) / patches
    yield writer


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
    samples = captured.samples
    begun = time.perf_counter()
    reading = 0.0
    keep = ("scene", "colour_space", "samples", "file", "frame", "view_layer", "far", "key")
    keep += ("fingerprint", "route")
    about = {key: captured.head[key] for key in keep if key in captured.head} | about
    writer = FieldWriter(
        folder, captured.hemicube, captured.shape, choice=choice, separate=separate, **about
    )
    try:
        tiles = len(captured.regions)
        for tile in range(tiles):
            yield tile / tiles, f"reading tile {tile + 1} of {tiles}"
            start = time.perf_counter()
            data = captured.read(tile)
            reading += time.perf_counter() - start
            for step in fit_tile(
                data, captured.patterns, captured.hemicube, choice, samples, separate
            ):
                if isinstance(step, TileWriter):
                    writer.add(step)
                else:
                    yield (tile + step) / tiles, f"fitting tile {tile + 1} of {tiles}"
        seconds = time.perf_counter() - begun
        writer.head["about"]["fit_seconds"] = round(seconds, 3)
        writer.head["about"]["read_seconds"] = round(reading, 3)
        writer.close()
    finally:
        writer.abandon()
