"""Fitting: from a capture set to a reflectance field, tile by tile (paper 5)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from . import choice as choice_of_support
from .capture_set import CaptureSet, TileData
from .field import FieldWriter, TileWriter
from .moments import Moments
from .patterns import PatternSet


def fit_tile(data: TileData, patterns: PatternSet, choice: str) -> Iterator[float | TileWriter]:
    """Fit one tile: yields the share that is done, and last the tile, ready to be written."""
    layers = {"own": data.own, "alpha": data.alpha, **data.guides}
    writer = TileWriter(data.region, layers)
    patches = len(data.basis)
    for k in range(patches):
        basis = data.basis[k].reshape(len(patterns), -1, 3)
        moments = Moments.from_basis(basis, patterns)
        codes, parameters = choice_of_support.choose(choice, moments)
        writer.add(codes, moments.coefficient, parameters)
        yield (k + 1) / patches
    yield writer


def fit(
    captured: CaptureSet, folder: Path, choice: str = "auto", **about: Any
) -> Iterator[tuple[float, str]]:
    """Fit a whole capture set and write the field: yields (share done, what is being done).

    choice: one of `choice.CHOICES`. The field replaces another in `folder` only when it is
    complete: closing the generator early leaves what was there. Raises CaptureSetError, FieldError,
    PatternError.
    """
    choice_of_support.check(choice, captured.patterns)
    begun = time.perf_counter()
    reading = 0.0
    keep = ("scene", "colour_space", "samples", "file", "frame")
    about = {key: captured.head[key] for key in keep if key in captured.head} | about
    writer = FieldWriter(folder, captured.hemicube, captured.shape, choice=choice, **about)
    try:
        tiles = len(captured.regions)
        for tile in range(tiles):
            yield tile / tiles, f"reading tile {tile + 1} of {tiles}"
            start = time.perf_counter()
            data = captured.read(tile)
            reading += time.perf_counter() - start
            for step in fit_tile(data, captured.patterns, choice):
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
