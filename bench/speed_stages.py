"""The stages that `bench.speed` times, each run in a process of its own, whose peak is its alone.

A stage is a function of a size and a folder that the stages of a size share; it gives rows of what
it measured. `limit_seconds` is what the stage cannot be faster than: see `speed.LIMITS`.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.tile_data import Around
from arto.core.field.about import About
from arto.core.field.field import OF_A_MODEL, Field
from arto.core.field.tile_file import TileFile
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter
from arto.core.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import PatternSet, pattern_set
from arto.core.region import Region
from arto.core.relight import relight
from numpy.typing import NDArray

Row = dict[str, Any]
SCENE, WORLD = "product", "forest"
# Of a synthetic capture: about as many entries a pixel as the product has at 64 samples.
PATCHES, SHARE, STRIP = 192, 0.2, 120


@dataclass(frozen=True)
class Size:
    """Of a picture, and of a capture of it."""

    width: int
    height: int
    samples: int
    patches: int = PATCHES
    turns: int = 72


def timed(work: Callable[[], Any], repeat: int = 1) -> tuple[float, Any]:
    """Seconds, the least of some, and what it gave."""
    best, found = np.inf, None
    for _ in range(repeat):
        begun = time.perf_counter()
        found = work()
        best = min(best, time.perf_counter() - begun)
    return best, found


def bytes_of(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size if path.is_file() else 0
        except OSError:
            continue  # gone since
    return total


@contextmanager
def watched(folder: Path) -> Iterator[list[int]]:
    """The most bytes that a folder has had, while it is looked at."""
    most, ended = [0], threading.Event()

    def look() -> None:
        while not ended.wait(0.2):
            most[0] = max(most[0], bytes_of(folder))

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield most
    finally:
        ended.set()
        thread.join()


# --- with Cycles ---------------------------------------------------------------------------------


def _scene(size: Size, folder: Path) -> Any:
    """The scene, saved once for all stages of a size: so they find what was captured of it."""
    import bpy
    from arto.arto_addon.shot import scene_id

    from . import reference, worlds

    scene = reference.new_scene(SCENE, size.width, size.height)  # which registers the add-on too
    blend = folder / "scene.blend"
    if blend.is_file():
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        scene = bpy.context.scene
    else:
        worlds.set_world_hdri(scene, WORLD)
    settings = scene.arto
    settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
    settings.samples, settings.keep = size.samples, "never"
    scene_id.give(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return scene


def plain(size: Size, folder: Path) -> list[Row]:
    """The artist's own render: the limit of a capture, and what a relight saves."""
    from . import reference

    seconds = reference.render_passes(_scene(size, folder), size.samples, 0)[1]
    return [{"stage": "plain render", "seconds": seconds}]


def plain_denoised(size: Size, folder: Path) -> list[Row]:
    from . import reference

    seconds = reference.render_passes(_scene(size, folder), size.samples, 0, denoise=True)[1]
    return [{"stage": "plain render, denoised", "seconds": seconds}]


def snapshot(size: Size, folder: Path) -> list[Row]:
    """What a button costs the window, beside saving the file."""
    import bpy
    from arto.arto_addon.job import snapshot as snapshots

    scene = _scene(size, folder)
    path, there = folder / "saved.blend", folder / "snapshot"
    there.mkdir(exist_ok=True)
    limit, _ = timed(lambda: bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True), 3)
    layer = scene.view_layers[0].name
    seconds, _ = timed(lambda: snapshots.take(there, "capture", scene, layer), 3)
    return [{"stage": "snapshot", "seconds": seconds, "limit_seconds": limit}]


def probe(size: Size, folder: Path) -> list[Row]:
    """All that comes before the first long render; it does not hang on the size."""
    from arto.arto_addon import work
    from arto.arto_addon.capture.capture import estimate

    scene = _scene(size, folder)
    steps = estimate(scene, scene.view_layers[0].name)
    seconds, found = timed(lambda: work.run(steps))
    return [{"stage": "probe", "seconds": seconds, "estimate": found.to_json()}]


def capture_and_fit(size: Size, folder: Path) -> list[Row]:
    """The capture that is fitted as it comes."""
    from arto.arto_addon import work
    from arto.arto_addon.capture.capture import capture
    from arto.arto_addon.shot import paths

    scene = _scene(size, folder)
    with watched(folder / "arto") as most:
        steps = capture(scene, scene.view_layers[0].name)
        seconds, _ = timed(lambda: work.run(steps))
    field = Field(paths.field_folder(scene))
    (folder / "field.txt").write_text(str(field.folder))
    found: dict[str, float] = {"patches": len(field.hemicube), "tiles": len(field.tiles)}
    found["field_bytes"] = bytes_of(field.folder)
    found["bytes_a_pixel"] = field.bytes_per_pixel()
    row = {"stage": "capture and fit", "seconds": seconds, "disk_bytes": most[0], **found}
    return [row]


def relights(size: Size, folder: Path) -> list[Row]:
    """Relights of what was captured: each part, the whole, and a turntable."""
    from arto.arto_addon import work
    from arto.arto_addon.blender import denoise
    from arto.arto_addon.fit.guides import clean as is_clean
    from arto.arto_addon.fit.guides import guides_of
    from arto.arto_addon.relight.many import relight_many
    from arto.arto_addon.relight.relight import compute

    scene = _scene(size, folder)
    layer = scene.view_layers[0].name
    field = Field(Path((folder / "field.txt").read_text()))
    rows = sums(field)
    guides, picture = guides_of(field), field.layer("own") + 1
    clean = is_clean(field)
    once = timed(lambda: denoise.denoise(guides, picture, clean=clean, like=scene), 2)[0]
    scene.arto.lamps = False
    first, _ = timed(lambda: work.run(compute(scene)))
    again, (_, parts) = timed(lambda: work.run(compute(scene)), 2)
    rows += [
        {"stage": "denoise", "seconds": parts["denoise"], "limit_seconds": once},
        {"stage": "relight, of a new world", "seconds": first, "limit_seconds": once},
        {"stage": "relight", "seconds": again, "limit_seconds": once, "parts": parts},
    ]
    scene.arto.lamps = True
    lamps, _ = timed(lambda: work.run(compute(scene)))
    rows.append({"stage": "relight with lamps", "seconds": lamps, "limit_seconds": once})
    scene.arto.lamps = scene.arto.denoise = False
    alone, _ = timed(lambda: work.run(compute(scene)), 2)
    turning = relight_many(scene, layer, turns=size.turns)
    seconds, _ = timed(lambda: work.run(turning))
    limit = size.turns * alone
    rows.append({"stage": f"turntable of {size.turns}", "seconds": seconds, "limit_seconds": limit})
    return rows


def fits(size: Size, folder: Path) -> list[Row]:
    """The fit of a kept capture, beside the reading of its images."""
    from arto.arto_addon import work
    from arto.arto_addon.capture.capture import capture

    scene = _scene(size, folder)
    scene.arto.folder, scene.arto.keep = str(folder / "kept"), "always"
    captured = CaptureSet(work.run(capture(scene, scene.view_layers[0].name)))

    def read() -> None:
        for tile in range(len(captured.regions)):
            with captured.open(tile) as data:
                for k in range(len(captured.hemicube)):
                    data.images(k)

    limit = timed(read, 2)[0]
    seconds, _ = timed(lambda: list(fit.fit(captured, folder / "fitted")), 2)
    return [{"stage": "fit", "seconds": seconds, "limit_seconds": limit}]


# --- without Blender ------------------------------------------------------------------------------


class Made:
    """A tile of a capture that is nowhere: each patch lights some pixels, smoothly, with noise."""

    def __init__(self, region: Region, patches: int, patterns: PatternSet, seed: int) -> None:
        self.region, self.patterns, self.patches = region, patterns, patches
        rng = np.random.default_rng(seed)
        shape = (len(patterns), region.height, region.width, 3)
        # a few pools of noise, taken in turn: making it anew would be all that is timed
        self.pools = [rng.random(shape, np.float32) for _ in range(3)]
        self.lit = [
            (rng.random((region.height, region.width, 1)) < SHARE).astype(np.float32)
            for _ in range(5)
        ]

    def images(self, k: int) -> NDArray[np.float32]:
        images = self.pools[k % 3] * self.lit[k % 5]
        # the others are shares of the white one
        images[1:] *= images[:1]
        return images

    def coefficient(self, k: int, patterns: PatternSet) -> NDArray[np.float32]:
        return patterns.coefficient(self.images(k))

    def images_at(self, k: int, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        return self.images(k).reshape(len(self.patterns), -1, 3)[:, pixels]

    def grain_of(self, k: int) -> None:
        return None

    def around(self, look: Callable[[int, NDArray], None]) -> Around:
        for k in range(self.patches):
            look(k, self.images(k))
        shape = (self.region.height, self.region.width)
        own, alpha = np.zeros((*shape, 3), np.float32), np.ones(shape, np.float32)
        return Around(own, alpha, {})


def sums(field: Field) -> list[Row]:
    """The sum of a field, beside a streaming read of it; and its light's bins."""
    rng = np.random.default_rng(0)
    environment = Environment(rng.random((512, 1024, 3), np.float32))
    bins, light = timed(lambda: PatchLight(environment, field.hemicube))
    wanted = ("peaks", "scales", "rest", "rest_patches", "rest_weights", "own", "alpha")

    def read() -> None:
        for tile in field.tiles:
            with tile.path.open("rb") as f:
                for name, stored in TileFile(tile.path).index.items():
                    if name in wanted or name.endswith(OF_A_MODEL):
                        f.seek(stored.offset)
                        f.read(stored.bytes)

    limit = timed(read, 3)[0]
    seconds, _ = timed(lambda: relight(field, light), 3)
    return [
        {"stage": "bins of a 1k map", "seconds": bins},
        {"stage": "relight sum", "seconds": seconds, "limit_seconds": limit},
    ]


def synthetic(size: Size, folder: Path) -> list[Row]:
    """Fit, field write and sum of images that were never on disk, strip by strip."""
    cube, patterns = _cube(size.patches), pattern_set("linear")
    writer = FieldWriter(
        folder / "made", cube, (size.height, size.width), About(samples=size.samples)
    )
    edges = [*range(0, size.height, STRIP), size.height]
    read = fitted = written = 0.0
    for number, (top, bottom) in enumerate(itertools.pairwise(edges)):
        made = Made(Region(0, top, size.width, bottom - top), len(cube), patterns, number)
        read += timed(lambda m=made: [m.images(k) for k in range(len(cube))])[0]
        begun = time.perf_counter()
        *_, tile = fit.fit_tile(made, patterns, cube, "auto", size.samples)  # type: ignore
        fitted += time.perf_counter() - begun
        assert isinstance(tile, TileWriter)
        written += timed(lambda t=tile: writer.add(t))[0]
    writer.close()
    field = Field(folder / "made")
    # what writing its bytes takes
    blob, size_there = os.urandom(1 << 24), bytes_of(field.folder)

    def write() -> None:
        with (folder / "blob").open("wb") as f:
            for _ in range(size_there >> 24):
                f.write(blob)

    limit = timed(write)[0]
    (folder / "blob").unlink()
    found: dict[str, float] = {"patches": len(cube), "bytes_a_pixel": field.bytes_per_pixel()}
    fit_row = {"stage": "synthetic fit", "seconds": fitted, "limit_seconds": read}
    write_row = {"stage": "field write", "seconds": written, "limit_seconds": limit}
    rows = [fit_row, write_row | {"disk_bytes": size_there}, *sums(field)]
    threads = os.cpu_count
    light = PatchLight(Environment.uniform(1.0), cube)
    for count in (1, 2):
        os.cpu_count = lambda n=count: n  # type: ignore
        seconds = timed(lambda: relight(field, light), 2)[0]
        rows.append({"stage": "relight sum", "seconds": seconds, "threads": count})
    os.cpu_count = threads
    return [row | found for row in rows]


def _cube(patches: int) -> Hemicube:
    """One of about so many patches: as many on each of six faces."""
    return Hemicube(patches=max(1, round((patches / 6) ** 0.5)))


STAGES: dict[str, Callable[[Size, Path], list[Row]]] = {
    f.__name__: f
    for f in (
        plain,
        plain_denoised,
        snapshot,
        probe,
        capture_and_fit,
        relights,
        fits,
        synthetic,
    )
}
