"""The file of a shot for a page: a head in words, and packed arrays. See docs/web-format.md.

Examples
--------
>>> len(MAGIC)
8
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import WebError
from .pack import pack, unpack
from .shot import FULL, STEPS, STOPS, THIN, TURNS, LobeCodes, Shot, World

MAGIC = b"ARTOWEB\x01"
# What the head says of the codes, so that a reader need not know.
CODES = {"full": FULL, "turns": TURNS, "thin": float(THIN), "steps": STEPS, "stops": STOPS}
# The longest head.
_LONGEST = 1 << 22


def to_bytes(shot: Shot) -> bytes:
    """Write a shot.

    Parameters
    ----------
    shot : Shot

    Returns
    -------
    bytes
    """
    arrays: dict[str, NDArray] = {
        name: getattr(shot, name)
        for name in ("white", "numbers", "steps", "zeros", "frames", "patches", "through")
    }
    arrays["to_light"] = shot.to_light
    arrays["rays"] = shot.rays
    if shot.view is not None:
        arrays["view"] = shot.view
    for i, lobe in enumerate(shot.lobes):
        for part in ("toward", "shape", "colour"):
            arrays[f"lobe_{i}_{part}"] = getattr(lobe, part)
    for name, light in shot.own.items():
        arrays[f"lamps_{name}"] = light
    worlds = []
    for i, world in enumerate(shot.worlds):
        arrays[f"world_{i}"] = world.map
        lights = []
        for j, light in enumerate(world.lights):
            arrays[f"world_{i}_light_{j}"] = light.map
            lights.append({"name": light.name, "floor": light.floor})
        worlds.append({"name": world.name, "floor": world.floor, "lights": lights})
    said: dict[str, Any] = {}
    data: list[bytes] = []
    at = 0
    for name, array in arrays.items():
        packed = pack(array)
        said[name] = {**packed.about, "at": at, "bytes": len(packed.data)}
        data.append(packed.data)
        at += len(packed.data)
    head = {
        "name": shot.name,
        "codes": CODES,
        "scales": shot.scales,
        "lobes": len(shot.lobes),
        "lamps": list(shot.own),
        "worlds": worlds,
        "about": shot.about,
        "arrays": said,
    }
    text = json.dumps(head, ensure_ascii=True, allow_nan=False).encode()
    return MAGIC + struct.pack("<I", len(text)) + text + b"".join(data)


def from_bytes(data: bytes) -> Shot:
    """Read a shot.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    Shot

    Raises
    ------
    WebError
        The bytes are no shot for a page, or are damaged.
    """
    if data[:8] != MAGIC or len(data) < 12:
        raise WebError("this is no shot for a page, or one of another version: make the page again")
    (length,) = struct.unpack_from("<I", data, 8)
    if length > _LONGEST:
        raise WebError("the shot for a page is damaged, its head is too long: make the page again")
    try:
        head = json.loads(data[12 : 12 + length])
        arrays = {
            name: unpack(_part(data, 12 + length, about), about)
            for name, about in head["arrays"].items()
        }
        lobes = tuple(
            LobeCodes(*(arrays[f"lobe_{i}_{part}"] for part in ("toward", "shape", "colour")))
            for i in range(int(head["lobes"]))
        )
        worlds = tuple(
            World(
                str(w["name"]),
                arrays[f"world_{i}"],
                float(w["floor"]),
                tuple(
                    World(str(t["name"]), arrays[f"world_{i}_light_{j}"], float(t["floor"]))
                    for j, t in enumerate(w["lights"])
                ),
            )
            for i, w in enumerate(head["worlds"])
        )
        plain = {
            name: arrays[name]
            for name in ("white", "numbers", "steps", "zeros", "frames", "patches", "through")
        }
        shot = Shot(
            name=str(head["name"]),
            to_light=arrays["to_light"],
            rays=arrays["rays"],
            lobes=lobes,
            scales={str(k): float(v) for k, v in head["scales"].items()},
            own={str(name): arrays[f"lamps_{name}"] for name in head["lamps"]},
            worlds=worlds,
            view=arrays.get("view"),
            about=dict(head["about"]),
            **plain,
        )
    except WebError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as e:
        raise WebError(f"this is no shot for a page ({e!r:.100}): make the page again") from None
    _check(shot)
    return shot


def _part(data: bytes, begin: int, about: dict[str, Any]) -> bytes:
    at, size = about["at"], about["bytes"]
    if type(at) is not int or type(size) is not int or min(at, size) < 0:
        raise WebError("the shot for a page is damaged: make the page again")
    return data[begin + at : begin + at + size]


def _check(shot: Shot) -> None:
    """Raise WebError where the arrays of a shot do not fit each other."""
    height, width = shot.white.shape[-2:]
    pictures = [shot.white, shot.numbers, shot.through, *shot.own.values()]
    for lobe in shot.lobes:
        pictures += [lobe.toward, lobe.shape, lobe.colour]
    r, k = len(shot.numbers), len(shot.frames)
    good = all(p.ndim == 3 and p.shape[1:] == (height, width) for p in pictures)
    good = good and shot.to_light.shape == (3 * k, 3, r) and shot.frames.shape == (k, 3, 3)
    good = good and shot.steps.shape == shot.zeros.shape == (r,)
    good = good and shot.patches.ndim == 2 and shot.patches.shape[0] == shot.patches.shape[1]
    good = good and int(shot.patches.max(initial=0)) <= k and len(shot.through) in (1, 3)
    good = good and shot.rays.ndim == 3 and shot.rays.shape[2] == 3 and min(shot.rays.shape) >= 2
    for world in shot.worlds:
        for one in (world, *world.lights):
            good = good and one.map.ndim == 3 and one.map.shape[0] == 3
            good = good and one.map.shape[1] == one.map.shape[2]
            good = good and np.log2(one.map.shape[1] / 4) % 1 == 0
    if not good:
        raise WebError("the shot for a page is damaged, its arrays do not fit: make the page again")
