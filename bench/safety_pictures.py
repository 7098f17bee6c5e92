"""Pictures that are read, and names that are written: worlds, footage, what is in the way.

Blender reads the pictures, so these rows need it. Nothing is rendered.
"""

from __future__ import annotations

import struct
import unicodedata
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np
from arto.arto_addon.blender.sequences import damage
from arto.arto_addon.plate import footage_file, marks
from arto.arto_addon.plate.together import Together
from arto.arto_addon.relight.inputs import Input, Inputs
from arto.arto_addon.world.check import check_file
from arto.core import exr
from arto.core.errors import SceneError
from numpy.typing import NDArray

from .safety_others import LostError

Cases = Iterator[tuple[str, Callable[[], bool]]]
SHAPE = 32, 64
# By ending: Blender's name of the format, and the codec of a TIFF.
SAVED = {
    ".png": ("PNG", ""), ".jpg": ("JPEG", ""), ".hdr": ("HDR", ""), ".zip.tif": ("TIFF", "DEFLATE"),
    ".lzw.tif": ("TIFF", "LZW"), ".tif": ("TIFF", "NONE"),
}  # fmt: skip
# Kinds of which every flipped bit in the pixels is told, and not only what is missing.
SUMMED = (".png", ".zip.tif")


def _noise(seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random((*SHAPE, 3)).astype(np.float32)


def _saved(folder: Path) -> list[Path]:
    """Pictures of noise, as Blender saves them in each format, and an EXR."""
    paths = [folder / "noise.exr"]
    exr.write(paths[0], {"": _noise()})
    image = bpy.data.images.new("Noise", *SHAPE[::-1], float_buffer=True)
    image.pixels.foreach_set(np.dstack([_noise(), np.ones(SHAPE, np.float32)]).ravel())
    scene = bpy.context.scene
    for ending, (form, codec) in SAVED.items():
        scene.render.image_settings.file_format = form
        if codec:
            scene.render.image_settings.tiff_codec = codec
        paths.append(folder / f"noise{ending}")
        image.save_render(str(paths[-1]), scene=scene)
    bpy.data.images.remove(image)
    return paths


def _worlds(folder: Path) -> Cases:
    """Maps that are cut off, damaged, or no numbers: none may light a picture."""
    whole = _saved(folder)
    yield "undamaged", lambda: all(_lights(path) for path in whole)
    for path in whole:
        good = path.read_bytes()
        for share in (0.2, 0.5, 0.9):
            cut = _as(path, f"cut{share}", good[: int(share * len(good))])
            yield f"{path.name} cut to {share:.0%}", _refused(cut)
        if path.name.endswith(SUMMED):
            for at in range(len(good) // 4, len(good) - 100, len(good) // 4):
                flipped = bytearray(good)
                flipped[at] ^= 16
                yield f"{path.name} flipped at {at}", _refused(_as(path, f"{at}", bytes(flipped)))
    for name, value in (("nan", np.nan), ("inf", np.inf), ("-inf", -np.inf)):
        path = folder / f"{name}.exr"
        _with(path, value)
        yield f"a texel of {name}", _refused(path)
    for path in (folder / "none.exr", folder):
        yield f"no file: {path.name}", _refused(path)


def _with(path: Path, value: float) -> None:
    """An uncompressed EXR of which one pixel has a value that no writer here would write."""
    found = _noise(1)
    found[3, 5] = 1234.5
    exr.write(path, {"": found}, compression="NO")
    there, mark = path.read_bytes(), struct.pack("<f", 1234.5)
    assert there.count(mark) == 3
    path.write_bytes(there.replace(mark, struct.pack("<f", value)))


def _as(path: Path, name: str, data: bytes) -> Path:
    out = path.with_name(f"{name}_{path.name}")
    out.write_bytes(data)
    return out


def _lights(path: Path) -> bool:
    check_file(path)
    return damage(path, finite=True) == ""


def _refused(path: Path) -> Callable[[], bool]:
    """The map must not be taken."""

    def run() -> bool:
        check_file(path)
        return False

    return run


def _sequences(folder: Path) -> Cases:
    """Footage of which a file is missing, cut, swapped for one of another size, or no numbers."""
    for number in range(1, 8):
        exr.write(folder / f"foot_{number:04d}.exr", {"": _noise(number)})
    image = bpy.data.images.load(str(folder / "foot_0001.exr"))
    image.source = "SEQUENCE"

    def at(frame: int) -> Callable[[], bool]:
        return lambda: footage_file.check(image, None, frame) == ""

    def told(frame: int) -> Callable[[], bool]:
        def run() -> bool:
            footage_file.check(image, None, frame)
            return False

        return run

    yield "undamaged", at(1)
    (folder / "foot_0002.exr").unlink()
    yield "a gap", told(2)
    path = folder / "foot_0003.exr"
    path.write_bytes(path.read_bytes()[:-30])
    yield "a cut file", told(3)
    exr.write(folder / "foot_0004.exr", {"": _noise()[:16]})
    yield "another size", told(4)
    _with(folder / "foot_0005.exr", np.nan)
    yield "a pixel that is no number", told(5)
    (folder / "foot_0006.exr").unlink()
    (folder / "foot_0006.exr").mkdir()
    yield "a folder of its name", told(6)
    yield "past the end", told(8)
    yield "the last one", at(7)


def _in_the_way(folder: Path) -> Cases:
    """Files of others at the names of a plate and what is beside it: they stay as they are."""
    plate = folder / "shot.exr"
    theirs = [plate, *(folder / f"shot_{ending}.exr" for ending in marks.ENDINGS)]
    footage = folder / "Caf\u00e9_0001.exr"
    read = Inputs([Input("the footage", footage, "Caf\u00e9_\\d+\\.exr"), Input("a map", plate)])

    def stays(path: Path, work: Callable[[], bool]) -> Callable[[], bool]:
        def run() -> bool:
            before = path.read_bytes()
            try:
                return work()
            finally:
                if not path.is_file() or path.read_bytes() != before:
                    raise LostError(str(path))

        return run

    def written(path: Path, overwrite: bool = False) -> Callable[[], bool]:
        def run() -> bool:
            with Together(plate, None, overwrite) as together:
                for each in (plate, path):
                    with together.file(each) as partial:
                        exr.write(partial, {"": _noise()}, {marks.PLATE: plate.name})
            return marks.is_of(path, plate)

        return run

    yield "nothing in the way", written(theirs[1])
    for path in theirs:
        for other in theirs:
            other.unlink(missing_ok=True)
        exr.write(path, {"": _noise(2)})
        yield f"an artist's {path.name}", stays(path, written(path))
        yield f"an artist's {path.name}, to be written over", written(path, overwrite=True)
        exr.write(path, {"": _noise(3)}, {marks.PLATE: path.name})
        if path != plate:
            yield f"another plate, {path.name}", stays(path, written(path))
    for name in ("Caf\u00e9_0007.exr", "CAF\u00c9_0007.EXR", "cafe\u0301_0007.exr"):
        for form in ("NFC", "NFD"):
            path = folder / unicodedata.normalize(form, name)
            yield (
                f"a frame of the footage, {name} in {form}",
                lambda path=path: _is_over(read, path),
            )
    (folder / "link.exr").symlink_to(plate)
    yield "a link to what is read", lambda: _is_over(read, folder / "link.exr")


def _is_over(read: Inputs, path: Path) -> bool:
    if read.over(path) is None:
        return False
    raise SceneError("it would be written over")


KINDS: dict[str, Callable[[Path], Cases]] = {
    "worlds": _worlds,
    "footage": _sequences,
    "in the way": _in_the_way,
}
