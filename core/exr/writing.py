"""Writing EXR files, whole or not at all.

No file with an infinite pixel, or with one that is not a number, is written unless the caller says
so: one such pixel spoils whatever a compositor filters or adds up.

Examples
--------
>>> import tempfile
>>> from arto.core.exr.reading import part_names
>>> folder = tempfile.TemporaryDirectory()
>>> path = Path(folder.name) / "plate.exr"
>>> write_layered(path, np.zeros((2, 2, 4)), {"sky": np.zeros((2, 2, 3))})
>>> sorted(part_names(path))
['', 'sky']
>>> folder.cleanup()
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from ..files import whole
from .attributes import encoded_head
from .head import LINES, LayoutError
from .layout import put_heads
from .library import chosen
from .opening import check_name, headers
from .window import FULL, Window

# Gives a path to write to, and puts the file in its place when it is complete.
Opener = Callable[[Path], AbstractContextManager[Path]]
# What a colour space is called in an EXR header (colorInteropID), by Blender's name for it.
COLOUR_SPACES = {
    "Linear Rec.709": "lin_rec709_scene",
    "Linear Rec.2020": "lin_rec2020_scene",
    "ACEScg": "lin_ap1_scene",
    "Non-Color": "data",
}


# The compressions of a plate, by the names that other programs have for them. ZIPS has a line of
# pixels in a chunk, which compositing reads fastest; DWAA is not exact.
COMPRESSIONS = ("ZIPS", "ZIP", "DWAA")
# The largest number that a half float holds.
HALF = 65504.0


def as_half(*pictures: NDArray) -> list[NDArray]:
    """Bring pictures to half floats, where all of their light fits.

    Parameters
    ----------
    *pictures : array

    Returns
    -------
    list of array
        float16, or the pictures as they are where one has more than half floats hold.
    """
    fit = all(np.abs(picture).max(initial=0) <= HALF for picture in pictures)
    return [picture.astype(np.float16) if fit else picture for picture in pictures]


def write(
    path: Path,
    layers: dict[str, NDArray],
    attributes: dict[str, Any] | None = None,
    colour_space: str = "Linear Rec.709",
    window: Window = FULL,
    finite: bool = True,
    opener: Opener = whole,
    compression: str = "ZIP",
) -> None:
    """Write layers, each as a part of its own.

    A single layer of the name '' makes an ordinary file of one part.

    Parameters
    ----------
    path : Path
    layers : dict of str to (H, W), (H, W, 3) or (H, W, 4) array
        float16 is written as half, all else as float32.
    attributes : dict, optional
        For the header.
    colour_space : str
        Blender's name of the space of the pixels.
    window : Window
    finite : bool
        Whether pixels that are infinite or not a number are refused.
    opener : Opener, optional
        How the file is put in its place; by default as soon as it is complete.
    compression : str
        One of `COMPRESSIONS`.

    Raises
    ------
    ExrError
        The folder cannot be written, the disk is full, the window does not fit the picture, or a
        pixel is infinite or not a number: the message names the layer and the pixel.
    """
    parts = [(name, _channels(pixels)) for name, pixels in layers.items()]
    if finite:
        _check_finite(path, parts)
    _write(path, parts, attributes, colour_space, window, opener, compression)


def write_planes(
    path: Path,
    parts: dict[str, dict[str, NDArray]],
    attributes: dict[str, Any],
    window: Window = FULL,
    handed_on: Collection[str] = (),
    opener: Opener = whole,
    compression: str = "ZIP",
    colours: Mapping[str, str] | None = None,
) -> None:
    """Write data that is no colour, as planes of 32-bit floats in parts.

    Parameters
    ----------
    path : Path
    parts : dict of str to dict of str to (H, W) array
        The planes by the names of their channels, by the names of their parts.
    attributes : dict
        For the header.
    window : Window
    handed_on : collection of str
        The parts that are another program's, whatever is in them.
    opener : Opener, optional
        How the file is put in its place; by default as soon as it is complete.
    compression : str
        One of `COMPRESSIONS`.
    colours : dict of str to str, optional
        Of parts that are colours all the same, Blender's name of their space.

    Raises
    ------
    ExrError
        As `write`.
    """
    planes = {
        part: {name: np.ascontiguousarray(p, np.float32) for name, p in channels.items()}
        for part, channels in parts.items()
    }
    _check_finite(path, [part for part in planes.items() if part[0] not in handed_on])
    named = list(planes.items())
    _write(path, named, attributes, "Non-Color", window, opener, compression, colours or {})


def write_layered(
    path: Path,
    beauty: NDArray,
    layers: dict[str, NDArray],
    attributes: dict[str, Any] | None = None,
    colour_space: str = "Linear Rec.709",
    window: Window = FULL,
    opener: Opener = whole,
    compression: str = "ZIP",
) -> None:
    """Write a picture and layers of it into one part, as compositing programs expect.

    The channels of the picture are R, G, B, A, those of a layer `name.R` and so on.

    Parameters
    ----------
    path : Path
    beauty : (H, W, 4) array
        The picture, scene-linear, premultiplied.
    layers : dict of str to (H, W, 3) array
    attributes : dict, optional
        For the header.
    colour_space : str
        Blender's name of the space of the pixels.
    window : Window
    opener : Opener, optional
        How the file is put in its place; by default as soon as it is complete.
    compression : str
        One of `COMPRESSIONS`.

    Raises
    ------
    ExrError
        As `write`.
    """
    channels = _channels(beauty)
    for name, pixels in layers.items():
        channels |= {f"{name}.{c}": plane for c, plane in _channels(pixels).items()}
    _check_finite(path, [("", channels)])
    _write(path, [("", channels)], attributes, colour_space, window, opener, compression)


def _check_finite(path: Path, parts: Iterable[tuple[str, dict[str, NDArray]]]) -> None:
    """Raise ExrError where a pixel is infinite or not a number."""
    for part, channels in parts:
        for name, plane in channels.items():
            good = np.isfinite(plane)
            if good.all():
                continue
            y, x = np.argwhere(~good)[0]
            raise ExrError(
                f"{path} was not written: '{f'{part}.{name}'.lstrip('.')}' is infinite or not a "
                f"number in {int((~good).sum())} pixels, the first at row {y}, column {x}. Find "
                "what is so bright there, or what is no number in the file that it comes from"
            )


def _channels(pixels: NDArray) -> dict[str, NDArray]:
    """An image's planes by the names of its channels."""
    pixels = np.asarray(pixels)
    if pixels.dtype != np.float16:
        pixels = pixels.astype(np.float32, copy=False)
    planes = pixels[..., None] if pixels.ndim == 2 else pixels
    names = {1: "Y", 3: "RGB", 4: "RGBA"}[planes.shape[-1]]
    return {c: np.ascontiguousarray(planes[..., i]) for i, c in enumerate(names)}


def _write(
    path: Path,
    parts: list[tuple[str, dict[str, NDArray]]],
    attributes: dict[str, Any] | None,
    colour_space: str,
    window: Window,
    opener: Opener,
    compression: str,
    colours: Mapping[str, str] | None = None,
) -> None:
    if len({plane.shape for _, planes in parts for plane in planes.values()}) > 1:
        raise ExrError(f"{path} was not written: its layers have different sizes")
    if compression not in LINES:
        raise ExrError(f"{path} was not written: {compression!r} is no compression of EXR files")
    check_name(path)
    parts, windows = window.put(parts)
    height, width = next(iter(parts[0][1].values())).shape
    whole_box = 0, 0, width - 1, height - 1
    common = {"displayWindow": whole_box, **windows, **(attributes or {})}
    heads = []
    for number, (name, _) in enumerate(parts):
        space = (colours or {}).get(name, colour_space)
        head = {"colorSpace": space}
        if space in COLOUR_SPACES:
            head["colorInteropID"] = COLOUR_SPACES[space]
        # the parts of a file of several have names
        named = name or (f"Part{number}" if len(parts) > 1 else "")
        heads.append(encoded_head(head | common, named))
    try:
        with opener(path) as partial:
            chosen().encode(
                partial, [p for _, p in parts], windows.get("dataWindow", whole_box), compression
            )
            # a library says nothing when the last bytes find no room
            try:
                put_heads(partial, heads)
                stored, _ = headers(partial)
            except (ExrError, LayoutError):
                raise OSError("it came out incomplete") from None
            # and may take another compression for one that it does not know
            if any(part.packing != compression for part in stored):
                raise ExrError(
                    f"{path} cannot be written: {chosen().name} packs no pixels as {compression} "
                    f"here; choose one of {', '.join(COMPRESSIONS)}"
                )
    except (OSError, RuntimeError) as e:
        raise ExrError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that "
            "can be written"
        ) from e
