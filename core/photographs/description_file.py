"""`photographs.json`: the description of a folder of photographs as a file, checked.

Examples
--------
>>> from arto.core.photographs.description import Kind
>>> pictures = (Photograph("one.jpg", Kind.LIGHT, lamp=0),)
>>> said = Description(pictures, lamps=(Lamp(direction=(0.0, 0.0, 1.0)),))
>>> from_json(said.to_json(), Path("photographs.json")) == said
True
>>> from_json(said.to_json() | {"lamps": []}, Path("photographs.json"))
Traceback (most recent call last):
...
arto.core.errors.PhotographsError: photographs.json: 'one.jpg' has lamp 0, and there are 0 lamps
"""

from __future__ import annotations

import math
from dataclasses import fields
from itertools import pairwise
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from .. import signed
from ..description import LARGEST_SIDE, is_finite
from ..errors import ArtoError, FilesError, PhotographsError
from ..faces import FACES
from ..file_names import is_text
from ..values import MOST_TEXT, Values
from .description import (
    FILE,
    FORMAT,
    LINEAR,
    SRGB,
    VERSION,
    Description,
    Kind,
    Lamp,
    Monitors,
    Photograph,
    Point,
)

# The most photographs of one folder, and the most values of a curve.
MOST, MOST_CURVE = 65536, 65536
# Seconds, f-numbers, film speeds and strengths of lamps lie in between.
SMALLEST, LARGEST = 1e-9, 1e9


def from_json(data: dict[str, Any], path: Path) -> Description:
    """Read an object in memory.

    Parameters
    ----------
    data : dict
    path : Path
        That it is from. Messages name it.

    Returns
    -------
    Description

    Raises
    ------
    PhotographsError
        A value is missing, of the wrong kind, or cannot be right. The message names it.
    """
    return _read(Values.of(data, path, PhotographsError))


def read(path: Path) -> Description:
    """Read a `photographs.json`.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Description

    Raises
    ------
    PhotographsError
        It cannot be read, or a value cannot be right.
    """
    return _read(Values(path, PhotographsError))


def write(folder: Path, said: Description) -> None:
    """Write `photographs.json` into a folder, whole or not at all.

    Parameters
    ----------
    folder : Path
    said : Description

    Raises
    ------
    FilesError
        It cannot be written.
    """
    try:
        signed.write(folder / FILE, said.to_json())
    except OSError as e:
        raise FilesError(
            f"{folder / FILE} cannot be written ({e}): make room on the disk, or choose a folder "
            "that can be written"
        ) from e


def _read(said: Values) -> Description:
    if said.data.get("format") != FORMAT:
        raise said.error(f"{said.path} does not say that it is of photographs ('format')")
    said.whole("version", VERSION, VERSION)
    said.only("format", "version", *(f.name for f in fields(Description)))
    monitors = said.kind("monitors", dict)
    white = said.data.get("white")
    if white is not None:
        whole = isinstance(white, list | tuple) and all(type(x) is int and x >= 0 for x in white)
        if not whole or len(white) != 4 or 0 in white[2:]:
            raise said.wrong("white", white)
        white = tuple(white)
    curve = said.data.get("curve")
    if isinstance(curve, str):
        curve = said.choice("curve", (LINEAR, SRGB))
    out = Description(
        photographs=tuple(_photograph(e, said) for e in _entries(said, "photographs")),
        lamps=tuple(_lamp(e, said) for e in _entries(said, "lamps")),
        monitors=_monitors(said.inside(monitors, "monitors", "monitors.")) if monitors else None,
        width=said.count("width", 1, LARGEST_SIDE),
        height=said.count("height", 1, LARGEST_SIDE),
        curve=curve if isinstance(curve, str) else _curve(said, "curve"),
        span=said.real("span", SMALLEST, LARGEST),
        focal=said.real("focal", 1e-3, LARGEST),
        white=white,
        ball=_point(said, "ball"),
        reach=said.real("reach", 0.01, 180),
        view=said.choice("view", ("ahead", "down")) if "view" in said.data else "ahead",
    )
    check(out, said.path)
    return out


def check(said: Description, path: Path) -> None:
    """Check that what a description says of its pictures fits together.

    Parameters
    ----------
    said : Description
    path : Path
        That messages name.

    Raises
    ------
    PhotographsError
        Two photographs have one name; a lamp, a patch or a direction cannot be. The message says
        which.
    """

    def wrong(text: str) -> ArtoError:
        return PhotographsError(f"{path}: {text}")

    seen: set[str] = set()
    for photo in said.photographs:
        where = f"'{photo.file:.80}'"
        if photo.file in seen:
            raise wrong(f"{where} is there twice: give each photograph one line")
        seen.add(photo.file)
        if photo.kind is Kind.LIGHT and not 0 <= (-1 if photo.lamp is None else photo.lamp) < len(
            said.lamps
        ):
            raise wrong(f"{where} has lamp {photo.lamp}, and there are {len(said.lamps)} lamps")
        if photo.kind is Kind.PATTERN and None in (photo.patch, photo.pattern, said.monitors):
            raise wrong(f"{where} is of a pattern: say its patch, its pattern, and the monitors")
        if photo.kind is Kind.STEP and photo.step is None:
            raise wrong(f"{where} is a grey step: say the step, 0 to 1")
    for k, lamp in enumerate(said.lamps):
        for name in ("direction", "place"):
            there = getattr(lamp, name)
            if there is not None and math.hypot(*there) < 1e-12:
                raise wrong(f"the {name} of lamp {k} has length 0: say where the lamp is")


def is_inside(name: str) -> bool:
    """Say whether a name leads to a file in the folder or in a folder of it, and nowhere else.

    Parameters
    ----------
    name : str

    Returns
    -------
    bool
    """
    posix, windows = PurePosixPath(name), PureWindowsPath(name)
    return bool(
        name
        and len(name) < MOST_TEXT
        and is_text(Path(name))
        and not (windows.drive or windows.root or posix.root or "\\" in name)
        and not {"..", "."} & set(name.split("/"))
    )


def _entries(said: Values, name: str) -> list[Values]:
    found = said.kind(name, list, [])
    if len(found) > MOST:
        raise said.wrong(name, f"{len(found)} entries")
    return [said.inside(e, name, f"{name}[{i}].") for i, e in enumerate(found)]


def _photograph(said: Values, whole: Values) -> Photograph:
    said.only(*(f.name for f in fields(Photograph)))
    file = said.text("file")
    if not is_inside(file):
        raise said.wrong("file", file)
    kind = said.one_of("kind", Kind)
    if kind is None:
        raise whole.error(f"{said.path}: '{file:.80}' does not say its kind")
    side = said.some_text("side")
    if side is not None and side not in FACES:
        raise said.wrong("side", side)
    return Photograph(
        file,
        kind,
        lamp=said.count("lamp", 0, MOST),
        patch=said.count("patch", 0, MOST),
        pattern=said.count("pattern", 0, MOST),
        step=said.real("step", 0, 1),
        side=side,
        angle=said.real("angle", 0, 89),
        take=said.count("take", 0, MOST) or 0,
        exposure=said.real("exposure", SMALLEST, LARGEST),
        aperture=said.real("aperture", SMALLEST, LARGEST),
        iso=said.real("iso", SMALLEST, LARGEST),
    )


def _lamp(said: Values, whole: Values) -> Lamp:
    said.only(*(f.name for f in fields(Lamp)))
    strength = _point(said, "strength") or (1.0, 1.0, 1.0)
    if not all(SMALLEST <= x <= LARGEST for x in strength):
        raise said.wrong("strength", strength)
    return Lamp(_point(said, "direction"), _point(said, "place"), strength)


def _monitors(said: Values) -> Monitors:
    said.only(*(f.name for f in fields(Monitors)))
    sides = said.data.get("sides")
    sides = tuple(sides) if isinstance(sides, list | tuple) else ()
    if not sides or len(set(map(str, sides))) < len(sides) or any(s not in FACES for s in sides):
        raise said.wrong("sides", sides)
    corners = said.data.get("corners")
    if corners is not None:
        if not isinstance(corners, list | tuple) or len(corners) != len(sides):
            raise said.wrong("corners", corners)
        corners = tuple(_rows(said, "corners", side, 4, 3) for side in corners)
    return Monitors(
        sides,
        patches=said.whole("patches", 1, 16),
        patterns=said.text("patterns"),
        width=said.whole("width", 1, LARGEST_SIDE),
        height=said.whole("height", 1, LARGEST_SIDE),
        corners=corners,
        curve=_curve(said, "curve"),
        falls=said.real("falls", 0, 100) or 0.0,
    )


def _rows(said: Values, name: str, value: Any, rows: int, length: int | None) -> Any:
    """Rows of numbers, checked."""
    if not isinstance(value, list | tuple) or len(value) != rows:
        raise said.wrong(name, value)
    for row in value:
        if not isinstance(row, list | tuple) or not 2 <= len(row) <= MOST_CURVE:
            raise said.wrong(name, row)
        if len(row) != (length or len(value[0])) or not all(map(is_finite, row)):
            raise said.wrong(name, row)
    return tuple(tuple(float(x) for x in row) for row in value)


def _curve(said: Values, name: str) -> tuple[tuple[float, ...], ...] | None:
    if said.data.get(name) is None:
        return None
    rows = _rows(said, name, said.data[name], 3, None)
    for row in rows:
        if any(b < a for a, b in pairwise(row)) or row[-1] <= row[0]:
            raise said.damaged(name, "a curve rises from black to white")
    return rows


def _point(said: Values, name: str) -> Point | None:
    value = said.data.get(name)
    if value is None:
        return None
    if not isinstance(value, list | tuple) or len(value) != 3 or not all(map(is_finite, value)):
        raise said.wrong(name, value)
    x, y, z = (float(v) for v in value)
    return x, y, z
