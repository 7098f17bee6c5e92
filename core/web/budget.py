"""A shot that fits into so many bytes: its numbers get coarser steps.

Examples
--------
>>> bytes_for(540, 960) // 1_000_000
8
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .file import to_bytes
from .shot import Shot

# The most bytes of a shot of 960x540 pixels, without its worlds; of others in proportion.
MOST, PIXELS = 8_000_000, 960 * 540
# By how much steps become coarser. From the last on contours would be seen.
COARSER = (2, 3, 4, 5, 6, 8)


def bytes_for(height: int, width: int) -> int:
    """Give the most bytes of a shot.

    Parameters
    ----------
    height, width : int

    Returns
    -------
    int
    """
    return max(round(MOST * height * width / PIXELS), MOST // 8)


def bare(shot: Shot) -> int:
    """Count the bytes of a shot without its worlds.

    Parameters
    ----------
    shot : Shot

    Returns
    -------
    int
    """
    return len(to_bytes(replace(shot, worlds=())))


def within(shot: Shot, most: int) -> Shot:
    """Make a shot small enough, as far as its steps can become coarser.

    Parameters
    ----------
    shot : Shot
    most : int
        Bytes, without the worlds.

    Returns
    -------
    Shot
        The shot itself where it is small enough.
    """
    found = shot
    for factor in COARSER:
        if bare(found) <= most:
            break
        codes = np.rint(shot.numbers / np.float32(factor)).astype(np.uint16)
        steps = (shot.steps * factor).astype(np.float32)
        found = replace(shot, numbers=codes, steps=steps)
    return found
