"""Writing EXR files, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ExrError
from ..files import whole
from .library import openexr
from .reading import check_complete
from .window import FULL, Window

# What a colour space is called in an EXR header (colorInteropID), by Blender's name for it.
COLOUR_SPACES = {
    "Linear Rec.709": "lin_rec709_scene",
    "Linear Rec.2020": "lin_rec2020_scene",
    "ACEScg": "lin_ap1_scene",
    "Non-Color": "data",
}


def write(
    path: Path,
    layers: dict[str, NDArray],
    attributes: dict[str, Any] | None = None,
    colour_space: str = "Linear Rec.709",
    window: Window = FULL,
) -> None:
    """Write layers, (H, W, 3), (H, W, 4) or (H, W), each as a part of its own; ZIP, as they are.

    A single layer named '' makes an ordinary one-part image. The file appears whole or not at all.
    Raises ExrError if the folder cannot be written or the disk is full, or of the window.
    """
    parts = [(name, _channels(pixels)) for name, pixels in layers.items()]
    _write(path, parts, attributes, colour_space, window)


def write_planes(
    path: Path,
    parts: dict[str, dict[str, NDArray]],
    attributes: dict[str, Any],
    window: Window = FULL,
) -> None:
    """Write data, planes (H, W) by the names of their channels in parts of theirs, as 32-bit
    floats. Raises ExrError as `write`."""
    planes = {
        part: {name: np.ascontiguousarray(p, np.float32) for name, p in channels.items()}
        for part, channels in parts.items()
    }
    _write(path, list(planes.items()), attributes, "Non-Color", window)


def write_layered(
    path: Path,
    beauty: NDArray,
    layers: dict[str, NDArray],
    attributes: dict[str, Any] | None = None,
    colour_space: str = "Linear Rec.709",
    window: Window = FULL,
) -> None:
    """Write a picture (H, W, 4) and layers of it, (H, W, 3) each, into one part: the picture as
    plain R, G, B, A, the layers as `name.R` and so on, as compositing programs look for them.

    Raises ExrError as `write`.
    """
    channels = _channels(beauty)
    for name, pixels in layers.items():
        channels |= {f"{name}.{c}": plane for c, plane in _channels(pixels).items()}
    _write(path, [("", channels)], attributes, colour_space, window)


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
) -> None:
    exr = openexr()
    head = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    if colour_space in COLOUR_SPACES:
        head["colorInteropID"] = COLOUR_SPACES[colour_space]
    head["colorSpace"] = colour_space
    if window != FULL:
        parts, windows = window.put(parts)
        head |= windows
    made = [exr.Part({**head, **(attributes or {})}, channels, name) for name, channels in parts]
    try:
        with whole(path) as partial:
            exr.File(made).write(str(partial))
            # the library says nothing when the last bytes find no room
            try:
                check_complete(partial)
            except ExrError:
                raise OSError("it came out incomplete") from None
    except (OSError, RuntimeError) as e:
        raise ExrError(
            f"{path} cannot be written ({e}): make room on the disk, or choose a folder that "
            "can be written"
        ) from e
