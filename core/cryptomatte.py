"""Cryptomattes of a render, handed on as they are: mattes by name, in whole numbers that no filter
may touch. What they are of stands in the header (Friedman and Jones 2015)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from . import exr
from .errors import ExrError

_KEY = "cryptomatte/"


def read(path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """The Cryptomattes in an EXR file -> its planes (H, W) by the full names of their channels, of
    all ranks, and the attributes that say what they are. Raises ExrError where there are none."""
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
    return planes, about
