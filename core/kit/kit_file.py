"""The kit as a file: a JSON object that scripts can write, read without trusting it.

Examples
--------
>>> from arto.core.kit.light import Light
>>> kit = Kit((Light("Key", azimuth=30.0, stops=2.0),))
>>> from_json(to_json(kit)) == kit
True
>>> from_json({"arto kit": 1, "lights": [{"name": "Key", "azimut": 30.0}]})
Traceback (most recent call last):
...
arto.core.errors.KitError: the kit says 'azimut', which no light has: it has name, kind, ...
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from ..description import Description, is_finite
from ..errors import KitError
from ..files import write_text
from ..values import Values
from .light import BOUNDS, WHITE, Blend, Colour, Kind, Light
from .model import Base, BaseKind, Kit

# The version of the description that `to_json` makes.
VERSION = 1
# How many lights a description may have.
MOST = 500
_ENUMS = {"Kind": Kind, "Blend": Blend, "BaseKind": BaseKind}


def save(kit: Kit, path: Path) -> None:
    """Write a kit into a file.

    Parameters
    ----------
    kit : Kit
    path : Path

    Raises
    ------
    FilesError
        The file cannot be written.
    """
    write_text(path, json.dumps(to_json(kit), indent=2) + "\n")


def load(path: Path) -> Kit:
    """Read a kit from a file, without trusting it.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Kit

    Raises
    ------
    KitError
        The file cannot be read, or is no description of a kit.
    FilesError
        The file is withheld.
    """
    return from_json(Description(path, KitError).data, path)


def to_json(kit: Kit) -> dict[str, Any]:
    """Describe a kit as a JSON object.

    Parameters
    ----------
    kit : Kit

    Returns
    -------
    dict
    """
    return {"arto kit": VERSION, **json.loads(json.dumps(asdict(kit)))}


def from_json(data: Any, path: Path = Path("the kit")) -> Kit:
    """Read a kit from a description, without trusting it. Values that lack have defaults.

    Parameters
    ----------
    data : object
        What `to_json` made.
    path : Path
        Where it is from, for messages.

    Returns
    -------
    Kit

    Raises
    ------
    KitError
        The object is no description of a kit, or of a newer version.
    """
    if not isinstance(data, dict) or "arto kit" not in data:
        raise KitError(f'{path} is no light kit: a kit says "arto kit": {VERSION}')
    said = Values.of(data, path, KitError)
    if said.whole("arto kit", 1, 1 << 30) > VERSION:
        raise KitError(f"{path} is a light kit of a newer ARTO: update the extension")
    _refuse_unknown(said, ["arto kit", *(field.name for field in fields(Kit))], "kit")
    lights = said.kind("lights", list, [])
    if len(lights) > MOST:
        raise KitError(f"{path} has {len(lights)} lights: at most {MOST} can be read")
    backdrop = data.get("backdrop")
    return Kit(
        tuple(_read(Light, said.inside(one, "lights", "light.")) for one in lights),
        _read(Base, said.inside(data.get("base", {}), "base", "base.")),
        None if backdrop is None else _read(Base, said.inside(backdrop, "backdrop", "base.")),
        float(_number(said, "turn", 0.0)),
        float(_number(said, "strength", 1.0)),
        _colour(said, "tint") or WHITE,
    )


def _number(said: Values, name: str, default: float) -> float:
    value = said.real(name, *BOUNDS[name])
    return default if value is None else value


def _refuse_unknown(said: Values, known: list[str], what: str) -> None:
    """Refuse names that are not known, so that no slip of the pen is lost."""
    if unknown := sorted(said.others(known)):
        has = ", ".join(name for name in known if name != "arto kit")
        raise KitError(f"{said.path} says '{unknown[0]}', which no {what} has: it has {has}")


def _colour(said: Values, name: str) -> Colour | None:
    value = said.kind(name, list)
    if value is None:
        return None
    if len(value) != 3 or not all(is_finite(x) for x in value):
        raise said.wrong(name, value)
    return float(value[0]), float(value[1]), float(value[2])


def _read(kind: type, said: Values) -> Any:
    """Read a light or a base."""
    known = {field.name: str(field.type) for field in fields(kind)}
    _refuse_unknown(said, list(known), kind.__name__.lower())
    found: dict[str, Any] = {}
    for name, text in known.items():
        if text in _ENUMS:
            value: Any = said.one_of(name, _ENUMS[text])
        elif text == "bool":
            value = said.kind(name, bool)
        elif text == "str":
            value = said.some_text(name)
        elif text == "Colour":
            value = _colour(said, name)
        else:
            value = said.real(name, *BOUNDS[name])
            value = None if value is None else float(value)
        if value is not None:
            found[name] = value
    if kind is Light and not found.get("name"):
        raise KitError(f"{said.path} has a light without a name: name each light")
    return kind(**found)
