"""Kits to begin with: what photographers set up for a product.

Examples
--------
>>> [light.name for light in preset("three").lights]
['Fill', 'Rim', 'Key']
>>> preset("one", facing=90.0).lights[0].azimuth
135.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..errors import KitError
from .light import Blend, Kind, Light
from .model import Base, BaseKind, Kit


def _key(stops: float = 2.5) -> Light:
    return Light(
        "Key", azimuth=45.0, elevation=42.0, width=46.0, height=46.0, softness=0.25, gradient=0.3,
        stops=stops,
    )  # fmt: skip


def _fill(stops: float = 0.5) -> Light:
    return Light(
        "Fill", azimuth=-55.0, elevation=20.0, width=64.0, height=64.0, softness=0.5, stops=stops
    )


def _strip(name: str, azimuth: float, stops: float) -> Light:
    return Light(
        name, Kind.RECTANGLE, azimuth=azimuth, elevation=22.0, width=12.0, height=70.0,
        softness=0.35, stops=stops,
    )  # fmt: skip


def _one() -> Kit:
    return Kit((_key(),))


def _two() -> Kit:
    return Kit((_fill(), _key()))


def _three() -> Kit:
    rim = Light("Rim", azimuth=205.0, elevation=48.0, width=40.0, height=20.0, softness=0.3,
                stops=3.5)  # fmt: skip
    return Kit((_fill(), rim, _key()))


def _rim() -> Kit:
    return Kit((_strip("Rim Left", -140.0, 4.0), _strip("Rim Right", 140.0, 4.0)))


def _tent() -> Kit:
    walls = Base(
        BaseKind.GRADIENT, top=(1.2, 1.2, 1.2), horizon=(0.9, 0.9, 0.9), bottom=(0.4, 0.4, 0.4)
    )
    # Dark edges give white things an outline in the tent.
    edges = tuple(
        Light(name, Kind.FLAG, Blend.MULTIPLY, azimuth=azimuth, width=10.0, height=120.0,
              softness=0.5, strength=0.05)
        for name, azimuth in (("Edge Left", -90.0), ("Edge Right", 90.0))
    )  # fmt: skip
    return Kit(edges, walls)


def _top() -> Kit:
    top = Light("Top", azimuth=180.0, elevation=84.0, width=110.0, height=70.0, softness=0.5,
                gradient=0.3, stops=1.5)  # fmt: skip
    return Kit((top,))


def _sweep() -> Kit:
    back = Light("Sweep", azimuth=180.0, elevation=46.0, width=140.0, height=70.0, softness=0.6,
                 slope=0.8, stops=1.0)  # fmt: skip
    return Kit((back, _strip("Left", -75.0, 2.0), _strip("Right", 75.0, 2.0)))


# Names for scripts and the list of presets -> (name on the button, the kit).
PRESETS: dict[str, tuple[str, Callable[[], Kit]]] = {
    "one": ("One Softbox", _one),
    "two": ("Two Softboxes", _two),
    "three": ("Three Softboxes", _three),
    "rim": ("Rim", _rim),
    "tent": ("Tent", _tent),
    "top": ("Top Light", _top),
    "sweep": ("Product Sweep", _sweep),
}


def preset(name: str, facing: float = -90.0) -> Kit:
    """Give a kit to begin with.

    Parameters
    ----------
    name : str
        One of `PRESETS`.
    facing : float
        The azimuth from the things to the camera, in degrees. The key stands to its right, seen
        from the camera.

    Returns
    -------
    Kit

    Raises
    ------
    KitError
        There is no such preset.
    """
    if name not in PRESETS:
        raise KitError(f"there is no preset '{name}': choose one of {', '.join(PRESETS)}")
    kit = PRESETS[name][1]()
    lights = tuple(replace(one, azimuth=_turned(one.azimuth + facing)) for one in kit.lights)
    return replace(kit, lights=lights)


def _turned(azimuth: float) -> float:
    """An azimuth from -180 to 180."""
    return (azimuth + 180.0) % 360.0 - 180.0
