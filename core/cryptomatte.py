"""Cryptomattes of a render, handed on unchanged.

Their planes hold hashes of names and coverages; no filter may touch them. The header says which
names they stand for.

Examples
--------
>>> import tempfile
>>> import numpy as np
>>> folder = tempfile.TemporaryDirectory()
>>> path = Path(folder.name) / "render.exr"
>>> about = {"cryptomatte/a1b2c3d/name": "CryptoObject"}
>>> exr.write_planes(path, {"CryptoObject00": {"R": np.zeros((2, 3))}}, about)
>>> found = read(path)
>>> list(found.planes), found.about == about, found.frame
(['CryptoObject00.R'], True, None)
>>> folder.cleanup()
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from . import exr
from .errors import ExrError

_KEY = "cryptomatte/"


@dataclass(frozen=True)
class Mattes:
    """The Cryptomattes of a render.

    Parameters
    ----------
    planes : dict of str to (H, W) float32
        The planes of all ranks by the full names of their channels.
    about : dict
        The attributes of the header that describe them.
    frame : int or None
        The frame of the render; None where the header does not say.
    camera : str
        The name of its camera; empty where the header does not say.
    """

    planes: dict[str, NDArray]
    about: dict[str, Any]
    frame: int | None = None
    camera: str = ""


def read(path: Path) -> Mattes:
    """Read the Cryptomattes of an EXR file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Mattes

    Raises
    ------
    ExrError
        The file has no Cryptomatte, or cannot be read.

    Source
    ------
    Friedman and Jones, "Fully automatic ID mattes with support for motion blur and
    transparency", 2015.
    """
    parts = exr.whole_parts(path)
    about = {k: v for head, _ in parts for k, v in head.items() if str(k).startswith(_KEY)}
    names = [str(v) for k, v in about.items() if k.endswith("/name")]
    planes: dict[str, NDArray] = {}
    for head, channels in parts:
        for channel, pixels in channels.items():
            full = channel if "." in channel else f"{head.get('name', '')}.{channel}"
            if any(full.startswith(name) for name in names):
                planes[full] = pixels
    if not planes:
        raise ExrError(
            f"{path} has no Cryptomatte: turn it on in the view layer's passes, and render again"
        )
    heads = [head for head, _ in parts]
    return Mattes(planes, about, _frame(heads), _said(heads, "Camera"))


def _said(heads: list[dict[str, Any]], name: str) -> str:
    """What a file says of its render, as Blender names it; empty where it says nothing."""
    return next((str(head[name]) for head in heads if head.get(name)), "")


def _frame(heads: list[dict[str, Any]]) -> int | None:
    text = _said(heads, "Frame").strip()
    return int(text) if text.removeprefix("-").isdecimal() and len(text) < 12 else None
