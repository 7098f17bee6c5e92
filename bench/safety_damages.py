"""Damages to what ARTO reads: flipped bits, cuts, noise, swapped files, numbers that are none."""

from __future__ import annotations

import json
import os
import random
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from arto.core import arrays, exr
from arto.core.capture import capture_set
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.head import HEADER as CAPTURE
from arto.core.description import MOST_BYTES
from arto.core.field.field import Field
from arto.core.field.head import HEADER as FIELD
from arto.core.field.tile_file import TileFile, written
from arto.core.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.patterns import pattern_set
from arto.core.relight import relight
from arto.core.signed import parsed
from numpy.typing import NDArray

Cases = Iterator[tuple[str, Callable[[], bool]]]
CUBE, SHAPE = Hemicube(patches=1), (12, 16)


class DamagedError(Exception):
    """An array in a file is not what was written, as a caller of `arrays.read` takes it."""


def damaged(good: bytes, count: int, seed: int = 0) -> list[tuple[str, bytes]]:
    """Flipped bits, cuts and stretches of noise, the same ones each time."""
    chance, out = random.Random(seed), []
    for n in range(count):
        bad, at = bytearray(good), chance.randrange(len(good))
        if n % 3 == 0:
            bad[at] ^= 1 << chance.randrange(8)
        elif n % 3 == 1:
            del bad[at:]
        else:
            bad[at : at + 8] = chance.randbytes(8)
        out.append((f"{('bit', 'cut', 'noise')[n % 3]} at {at}", bytes(bad)))
    return out


def captured(folder: Path, seed: int = 0) -> Path:
    """A capture set of made-up light."""
    rng = np.random.default_rng(seed)
    white = rng.random((len(CUBE), 1, *SHAPE, 3), np.float32)
    white *= rng.random((len(CUBE), 1, *SHAPE, 1)) < 0.7
    means = rng.uniform(0.2, 0.8, (len(CUBE), 2, *SHAPE, 1)).astype(np.float32)
    basis = np.concatenate([white, white * means], axis=1)
    own, alpha = rng.random((*SHAPE, 3), np.float32), rng.random(SHAPE, np.float32)
    about = {"samples": 64, "key": f"capture {seed}"}
    capture_set.write(folder, CUBE, pattern_set("linear"), basis, own, alpha, **about)
    return folder


def fitted(capture: Path, folder: Path) -> Path:
    for _ in fit.fit(CaptureSet(capture), folder, "linear"):
        pass
    return folder


def picture(folder: Path) -> NDArray[np.float32]:
    """What a field shows, through the gate that every written picture passes."""
    light = PatchLight(Environment(_sky()), CUBE)
    with Field(folder) as field:
        found = relight(field, light)
    exr.write(folder.parent / "plate.exr", {"": found})
    return exr.read(folder.parent / "plate.exr")[""]


def _sky() -> NDArray[np.float32]:
    return np.random.default_rng(7).random((16, 32, 3), np.float32)


def _with(path: Path, content: bytes, good: bytes, work: Callable[[], bool]) -> Callable[[], bool]:
    """The work with other content in a file, which is put back afterwards."""

    def run() -> bool:
        path.write_bytes(content)
        try:
            return work()
        finally:
            path.write_bytes(good)

    return run


def _of_file(path: Path, work: Callable[[], bool], count: int, seed: int = 0) -> Cases:
    good = path.read_bytes()
    yield f"{path.name} as it is", work
    for case, bad in damaged(good, count, seed):
        yield f"{path.name}, {case}", _with(path, bad, good, work)


def _fields(folder: Path) -> Cases:
    field, other = (fitted(captured(folder / f"c{n}", n), folder / f"f{n}") for n in (0, 1))
    expected = picture(field)

    def same() -> bool:
        return bool(np.array_equal(picture(field), expected))

    tile, head = field / "tile_0000.arto", field / FIELD
    yield from _of_file(tile, same, 90)
    yield from _of_file(head, same, 45, 1)
    for path in (tile, head):
        swapped = (other / path.name).read_bytes()
        yield f"another field's {path.name}", _with(path, swapped, path.read_bytes(), same)
    good, there = tile.read_bytes(), TileFile(tile)
    kept = {name: np.array(there.load(name)) for name in there.index}
    del there
    for name in ("peaks", "scales", "own", "alpha"):
        for bad in (np.nan, np.inf, -np.inf):
            wrong = kept[name].copy()
            wrong.flat[-1] = bad
            with written(folder / "wrong.arto") as out:
                for key, array in kept.items():
                    out.add(key, wrong if key == name else array)
            content = (folder / "wrong.arto").read_bytes()
            yield f"{bad} in '{name}', signed", _before(tile, content, good, head, same)


def _before(
    tile: Path, content: bytes, good: bytes, head: Path, work: Callable[[], bool]
) -> Callable[[], bool]:
    """The work with a tile whose own checksums are right, in a field that has none of its tiles."""
    told = head.read_bytes()

    def run() -> bool:
        said = parsed(told.decode())
        for entry in said["tiles"]:
            entry.pop("checksum", None)
        head.write_text(json.dumps(said))
        try:
            return _with(tile, content, good, work)()
        finally:
            head.write_bytes(told)

    return run


def _images(folder: Path) -> Cases:
    capture, other = (captured(folder / f"c{n}", n) for n in (0, 1))
    expected = picture(fitted(capture, folder / "f"))

    def same() -> bool:
        return bool(np.array_equal(picture(fitted(capture, folder / "f")), expected))

    image, head = capture / "tile_0000.exr", capture / CAPTURE
    good, told = image.read_bytes(), head.read_bytes()
    yield from _of_file(image, same, 60)
    swapped = (other / image.name).read_bytes()
    yield "another capture's images", _with(image, swapped, good, same)
    yield "another capture's head", _with(head, (other / CAPTURE).read_bytes(), told, same)
    layers = exr.read(image)
    names = [name for name in layers if name.startswith("Combined")]
    for bad in (np.nan, np.inf, -1.0, 1e12):
        for name in names[:4]:
            wrong = {key: value.copy() for key, value in layers.items()}
            wrong[name][3, 5, 0] = bad
            exr.write(folder / "wrong.exr", wrong, finite=False)
            content = (folder / "wrong.exr").read_bytes()
            yield f"{bad} in '{name}'", _with(image, content, good, same)
            if name != "Combined" or not np.isfinite(bad):  # own lamps may be of any light
                yield (
                    f"{bad} in '{name}', unsigned",
                    _unsummed(head, _with(image, content, good, same)),
                )


def _unsummed(head: Path, work: Callable[[], bool]) -> Callable[[], bool]:
    """The work with a head as the version before wrote it, without checksums of images."""
    told = head.read_bytes()

    def run() -> bool:
        said = parsed(told.decode())
        for tile in said["tiles"]:
            tile.pop("sums", None)
        return _with(head, json.dumps(said).encode(), told, work)()

    return run


def _maps(folder: Path) -> Cases:
    path, image = folder / "map.npy", np.random.default_rng(0).random((8, 16, 3), np.float32)
    arrays.write(path, image)
    arrays.write(folder / "other.npy", image[::-1])

    def same() -> bool:
        try:
            return bool(np.array_equal(arrays.read(path, image.nbytes), image))
        except (OSError, ValueError) as e:
            raise DamagedError from e

    yield from _of_file(path, same, 60)
    swapped = (folder / "other.npy").read_bytes()
    yield "another map", _with(path, swapped, path.read_bytes(), same)


def _descriptions(folder: Path) -> Cases:
    """Read back, they say what they said; a name that nobody knows says nothing."""
    capture = captured(folder / "capture")
    head = CaptureSet(capture).head

    def same() -> bool:
        found = asdict(CaptureSet(capture).head)
        return {k: v for k, v in found.items() if k != "others"} == {
            k: v for k, v in asdict(head).items() if k != "others"
        }

    yield from _of_file(capture / CAPTURE, same, 90)


def _large(folder: Path) -> Cases:
    """Descriptions as large as one may be, of what takes the most memory."""
    capture = captured(folder / "capture")
    head = capture / CAPTURE
    good = head.read_bytes()

    def opened() -> bool:
        return CaptureSet(capture).shape == SHAPE

    yield "as it is", opened
    for what, many in (("lists", b"[],"), ("numbers", b"0.5,"), ("texts", b'"abcd%d",')):
        for size in (MOST_BYTES - (1 << 20), MOST_BYTES + 1):
            content = b'{"a": [' + many * (size // len(many)) + b"1]}"
            yield f"{size >> 20} MB of {what}", _with(head, content, good, opened)


def _jobs(folder: Path) -> Cases:
    """Heads of a farm's job and part, and what the window tells a second Blender."""
    from arto.arto_addon.farm import head as heads
    from arto.arto_addon.job.task import Painted, State, Task

    job = heads.JobHead(
        blend="shot.blend", scene="Scene", view_layer="View", settings={"patches": 4, "far": True},
        frames=(1, 2, 3), tiles=2, seeds=1,
    )  # fmt: skip
    part = heads.PartHead(heads.Part(1, 2, 1, 0), "key", 64, ("tile_0001_0000.exr",), 3.5)
    task = Task(
        "capture", "Scene", "View", "/a/shot.blend", None, (Painted("Wood", "", "p_1.npy"),)
    )
    state = State(0.5, "rendering", 3.0, 4.0)
    heads.write(folder, job)
    heads.write_part(folder, part)
    task.write(folder)
    state.write(folder)

    def plain(said: Any) -> dict[str, Any]:
        return {k: v for k, v in asdict(said).items() if k != "others"}

    for name, read, wrote in (
        (heads.HEADER, lambda: heads.read(folder), job),
        (heads.PART_HEADER, lambda: heads.read_part(folder), part),
        ("task.json", lambda: Task.read(folder / "task.json"), task),
        ("progress.json", lambda: State.read(folder), state),
    ):
        yield from _of_file(
            folder / name, lambda read=read, wrote=wrote: plain(read()) == plain(wrote), 24
        )


def _no_files(folder: Path) -> Cases:
    """Pipes, devices, links to them, folders, and files of a size that no file has."""
    capture = captured(folder / "capture")
    field = fitted(capture, folder / "field")
    arrays.write(folder / "map.npy", np.zeros((8, 16, 3), np.float32))
    expected = picture(field)

    def right() -> bool:
        return bool(np.array_equal(picture(field), expected))

    def again() -> bool:
        return bool(np.array_equal(picture(fitted(capture, folder / "again")), expected))

    def map_() -> bool:
        try:
            return arrays.read(folder / "map.npy", 8 * 16 * 3 * 4).shape == (8, 16, 3)
        except (OSError, ValueError) as e:
            raise DamagedError from e

    yield "all as it is", again
    for path, work in (
        (field / FIELD, right),
        (field / "tile_0000.arto", right),
        (capture / CAPTURE, again),
        (capture / "tile_0000.exr", again),
        (folder / "map.npy", map_),
    ):
        for kind, make in _KINDS_OF_NONE.items():
            yield f"{kind} as {path.name}", _instead(path, make, work)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)


_KINDS_OF_NONE: dict[str, Callable[[Path], object]] = {
    "a pipe": os.mkfifo if hasattr(os, "mkfifo") else Path.touch,
    "a link to a device": lambda path: path.symlink_to("/dev/zero"),
    "a link to nothing": lambda path: path.symlink_to(path.parent / "nowhere"),
    "a folder": Path.mkdir,
    "a terabyte": _sparse,
    "nothing": lambda path: None,
}


def _instead(
    path: Path, make: Callable[[Path], object], work: Callable[[], bool]
) -> Callable[[], bool]:
    def run() -> bool:
        good = path.read_bytes()
        path.unlink()
        make(path)
        try:
            return work()
        finally:
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
            path.write_bytes(good)

    return run


def _indices(folder: Path) -> Cases:
    """Indices of tiles that are signed, and say what cannot be."""
    field = fitted(captured(folder / "capture"), folder / "field")
    tile, expected = field / "tile_0000.arto", picture(field)
    good = tile.read_bytes()

    def same() -> bool:
        return bool(np.array_equal(picture(field), expected))

    yield "as it is", same
    head = struct.Struct("<8sIIQQI")
    _, _, _, offset, length, _ = head.unpack_from(good)
    index = json.loads(good[offset : offset + length])
    for key, value in (
        ("shape", [1 << 40, 1 << 20]), ("offset", 1 << 60), ("bytes", 1 << 61), ("type", "O8"),
        ("name", "../../a"), ("shape", [-1]), ("crc32", -1), ("offset", 3), ("shape", [[1]]),
    ):  # fmt: skip
        text = json.dumps([{**index[0], key: value}, *index[1:]]).encode()
        told = head.pack(b"ARTOTILE", 1, 0, offset, len(text), zlib.crc32(text))
        told += struct.pack("<I", zlib.crc32(told))
        content = told + good[len(told) : offset] + text
        yield f"'{key}' of {value}", _with(tile, content, good, same)


KINDS: dict[str, Callable[[Path], Cases]] = {
    "field": _fields,
    "image": _images,
    "map": _maps,
    "description": _descriptions,
    "large": _large,
    "job": _jobs,
    "index": _indices,
    "no file": _no_files,
}
