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
>>> planes, found = read(path)
>>> list(planes), found == about
(['CryptoObject00.R'], True)
>>> folder.cleanup()
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from . import exr
from .errors import ExrError

_KEY = "cryptomatte/"


def read(path: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    """Read the Cryptomattes of an EXR file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    planes : dict of str to (H, W) float32
        The planes of all ranks by the full names of their channels.
    about : dict
        The attributes of the header that describe them.

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
    return planes, about
