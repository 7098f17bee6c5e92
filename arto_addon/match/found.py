"""What a match has found, in a file beside the plate: read by the window, which shows it.

The picture in the file is what no light makes: the target less the picture in the light that was
found. Its header has the rest.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import TargetError
from ..blender.colour import working_space
from ..plate.marks import PLATE
from ..relight.outputs import check_beside
from .asked import named_in

HEADER = "arto.match"


@dataclass(frozen=True)
class Found:
    """What a match has found, as the header says it.

    what: which things were free (the setting `match_change`); error, before: see
    `core.match.Matched`; words: all of it in sentences; look: the name of the look to make; world:
    the file of the light, "" where only gains were looked for; gains: by name of the light, a
    factor for each colour; turn: radians; scale: of the target.
    """

    what: str
    error: float
    before: float
    words: str
    look: str
    world: str = ""
    gains: dict[str, list[float]] = field(default_factory=dict)
    turn: float = 0.0
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


def match_file(plate: Path) -> Path:
    """The path of what a match has found, beside a plate."""
    return plate.with_name(f"{plate.stem}_match.exr")


def write(
    scene: bpy.types.Scene, plate: Path, found: Found, difference: NDArray[np.floating]
) -> Path:
    """Write what was found -> the path of the file. Raises SceneError, ExrError.

    difference: (h, w, 3).
    """
    path = match_file(plate)
    check_beside(scene, path, plate, named_in(scene))
    about = {PLATE: plate.name, HEADER: json.dumps(asdict(found))}
    exr.write(path, {"": difference.astype(np.float32)}, about, working_space())
    return path


def read(path: Path) -> Found:
    """Read what a match has found. Raises TargetError where a file does not say it, ExrError."""
    try:
        said = json.loads(str(exr.header(path)[HEADER]))
        found = Found(**said)
        numbers = [found.error, found.before, found.turn, *found.scale]
        numbers += [x for gain in found.gains.values() for x in gain]
        if not all(math.isfinite(x) for x in numbers):
            raise ValueError("a number is not finite")
        if any(len(gain) != 3 for gain in found.gains.values()):
            raise ValueError("a gain is three numbers")
    except (KeyError, TypeError, ValueError) as e:
        raise TargetError(f"{path} does not say what a match has found ({e}): match again") from e
    return found
