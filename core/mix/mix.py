"""The mix: what a plate's layers add up to, each with a gain and a tint, and how it goes into
footage.

One description is what every mixer is made from: Blender's node group and the scripts for other
compositors. Light adds up, so a mix is a sum, and what is set in it is light.

Examples
--------
>>> mix = Mix("shot_relit.exr", (2, 1), layers=(Layer("key", gain=2.0), Layer("fill")))
>>> key, fill = np.full((1, 2, 3), 0.25), np.full((1, 2, 3), 0.5)
>>> mixed(mix, {"key": key, "fill": fill}).tolist()
[[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .stamp import LINE

Rgb = tuple[float, float, float]
Shadows = Literal["MULTIPLY", "ADD"]


@dataclass(frozen=True)
class Layer:
    """One layer of a plate.

    Parameters
    ----------
    name : str
        As its channels and its socket in a mixer are called.
    gain : float
        How much of its light is seen.
    tint : tuple of 3 float
        The factor by colour, scene-linear.
    file : str, optional
        The layer's own file, beside the plate. By default the layer is in the file of all layers.
    """

    name: str
    gain: float = 1.0
    tint: Rgb = (1.0, 1.0, 1.0)
    file: str | None = None


@dataclass(frozen=True)
class Behind:
    """The footage that the things of a plate are put into.

    Parameters
    ----------
    shadows : "MULTIPLY" or "ADD"
        Whether the catcher is a factor for the footage, or the light of the ground is added to it.
    file : str
        The catcher's file, or that of the light with the things' alpha, beside the plate.
    footage : str, optional
        The path of the footage, absolute or beside the plate.
    """

    shadows: Shadows
    file: str
    footage: str | None = None


@dataclass(frozen=True)
class Mix:
    """What a mixer of one plate does. All files are beside the plate.

    Parameters
    ----------
    plate : str
        The name of the plate's file.
    size : tuple of 2 int
        Width and height of the picture as it is delivered.
    layers : tuple of Layer
        In the order in which they are added.
    together : str, optional
        The file of all layers.
    exposure : float
        Of the sum, in stops.
    behind : Behind, optional
        Of a plate with shadow catchers.
    data : str, optional
        The file of the data.
    space : str
        The name of the working space, which all colours are in.
    aspect : float
        Width of a pixel over its height.
    fps : float
        Frames a second.
    frame : int
        The frame of the plate, or the first one of a sequence.
    last : int, optional
        The last frame of a sequence. The names of its files then have a `#` for each digit of the
        frame's number.
    """

    plate: str
    size: tuple[int, int]
    layers: tuple[Layer, ...]
    together: str | None = None
    exposure: float = 0.0
    behind: Behind | None = None
    data: str | None = None
    space: str = ""
    aspect: float = 1.0
    fps: float = 24.0
    frame: int = 1
    last: int | None = None


def sequence(mix: Mix, last: int, stem: str, pattern: str) -> Mix:
    """Make the mix of a frame that of a sequence.

    Parameters
    ----------
    mix : Mix
        Of the first frame.
    last : int
        The last frame. There is a plate of every frame between.
    stem : str
        What the names of the first frame's files begin with.
    pattern : str
        The same for all frames, with a `#` for each digit of the number.

    Returns
    -------
    Mix
        Footage has its own numbers: a moving one is left out.

    Examples
    --------
    >>> one = Mix("a_0007.exr", (4, 2), (Layer("key"),), together="a_0007_layers.exr", frame=7)
    >>> many = sequence(one, 9, "a_0007", "a_####")
    >>> many.plate, many.together, many.frame, many.last
    ('a_####.exr', 'a_####_layers.exr', 7, 9)
    """

    def named(file: str | None) -> str | None:
        return pattern + file.removeprefix(stem) if file and file.startswith(stem) else file

    layers = tuple(replace(layer, file=named(layer.file)) for layer in mix.layers)
    behind = mix.behind and replace(mix.behind, file=named(mix.behind.file) or "")
    plate = named(mix.plate) or mix.plate
    together, data = named(mix.together), named(mix.data)
    return replace(
        mix, plate=plate, layers=layers, together=together, behind=behind, data=data, last=last
    )


def mixed(mix: Mix, layers: Mapping[str, NDArray]) -> NDArray[np.float64]:
    """Add up layers as a mix says.

    Parameters
    ----------
    mix : Mix
    layers : dict of str to (H, W, 3) float
        The layers by name, scene-linear.

    Returns
    -------
    (H, W, 3) float64
    """
    total = sum(layers[one.name] * (one.gain * np.array(one.tint)) for one in mix.layers)
    return np.asarray(total * 2.0**mix.exposure, np.float64)


def composed(mix: Mix, light: NDArray, caught: NDArray, footage: NDArray) -> NDArray[np.float64]:
    """Put a mix's things into footage.

    Parameters
    ----------
    mix : Mix
        With what is behind.
    light : (H, W, 3) float
        What `mixed` gives.
    caught : (H, W, 3) or (H, W, 4) float
        The catcher; or the light of the ground, with the alpha of the things.
    footage : (H, W, 3) float
        Scene-linear.

    Returns
    -------
    (H, W, 3) float64
    """
    if mix.behind is not None and mix.behind.shadows == "ADD":
        return np.maximum(light + (1 - caught[..., 3:]) * footage + caught[..., :3], 0)
    return np.asarray(light + caught * footage, np.float64)


def words(mix: Mix) -> list[str]:
    """Say what an artist must know of a mix, in a few lines, for a note in a script.

    Parameters
    ----------
    mix : Mix

    Returns
    -------
    list of str
    """
    said = [
        LINE,
        f"{mix.plate} as the sum of its layers: a gain and a tint each, then an exposure.",
        f"Scene-linear{f', {mix.space}' if mix.space else ''}, premultiplied: files are read raw.",
    ]
    if mix.behind is not None:
        by = (
            "footage * catcher + light"
            if mix.behind.shadows == "MULTIPLY"
            else ("light + (1 - the things' alpha) * footage + light of the ground")
        )
        said.append(f"Into footage: {by}. Footage must be linear, in the same space.")
        if mix.behind.footage is None:
            said.append("Put your footage in the place of the black 'Footage'.")
    return said
