"""Reading EXR files, header by header and layer by layer.

Rows run top-down, as in the file. Pixels are float32, or float16 where a layer was saved so. What
is read is the whole picture: the display window and whatever pixels lie beyond it, with 0 where
the file has no pixels (`window`).

Examples
--------
>>> import tempfile
>>> import numpy as np
>>> from arto.core.exr.writing import write
>>> folder = tempfile.TemporaryDirectory()
>>> path = Path(folder.name) / "light.exr"
>>> write(path, {"key": np.full((2, 3, 3), 0.25)})
>>> pixels = read(path)["key"]
>>> pixels.shape, pixels.dtype.name, float(pixels.max())
((2, 3, 3), 'float32', 0.25)
>>> folder.cleanup()
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .layers import Layers, layers_of
from .opening import decoded, headers
from .window import Box


def whole_parts(path: Path) -> list[tuple[dict[str, Any], dict[str, NDArray]]]:
    """Read the header and the channels of each part of a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of (dict, dict of str to (H, W) array)

    Raises
    ------
    ExrError
        The file cannot be read.
    """
    return list(zip(*decoded(path), strict=True))


def part_names(path: Path) -> list[str]:
    """Read the names of a file's layers, as `parts` has them, without its pixels.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of str

    Raises
    ------
    ExrError
        The file cannot be read.
    """
    parts, heads = headers(path)
    names = [[name for name, _ in part.channels] for part in parts]
    return list(layers_of(path, list(zip(heads, names, strict=True))))


def header(path: Path) -> dict[str, Any]:
    """Read the header of the first part.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict

    Raises
    ------
    ExrError
        The file cannot be read.
    """
    return headers(path)[1][0]


def windows(path: Path) -> tuple[Box, Box]:
    """Read the data window and the display window of the first part.

    Parameters
    ----------
    path : Path

    Returns
    -------
    tuple of Box
        (data window, display window).

    Raises
    ------
    ExrError
        The file cannot be read.
    """
    head = header(path)
    return head["dataWindow"], head["displayWindow"]


def read(path: Path) -> dict[str, NDArray]:
    """Read all layers of a file, see `parts`.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict of str to (H, W, C) array

    Raises
    ------
    ExrError
        As `parts`.
    """
    return dict(parts(path))


def parts(path: Path) -> Iterator[tuple[str, NDArray]]:
    """Read the layers of a file one by one.

    A layer may be a part of its own. Several layers may also share a part, as Blender interleaves
    them: then the name of a layer is that of its channels before the last dot.

    Parameters
    ----------
    path : Path

    Yields
    ------
    name : str
    pixels : (H, W, C) float32 or float16
        Channels in the order R, G, B, A; or one channel.

    Raises
    ------
    ExrError
        The file is missing or truncated, or a layer has channels of other names.
    """
    with Layers(path) as layers:
        for name in layers.names:
            yield name, layers.take(name)
