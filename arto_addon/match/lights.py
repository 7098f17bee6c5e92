"""The lights of a scene, each with its picture: the kit's, the base, and the scene's own lamps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.kit.light import Blend
from ...core.kit.model import BaseKind, Kit
from ...core.light.environment import Environment
from ...core.match.answers import Answers
from ..kit import kit as kits
from ..world import kept
from ..world.own import gains_of

# What the light below the kit's lights is called, and a world without a kit; what the scene's own
# lamps are called that are in no light group, and what the names of light groups begin with.
BASE, WORLD, OWN, GROUP = "base", "world", "scene lamps", "lamps "


@dataclass(frozen=True)
class Lights:
    """The pictures of lights at the pixels of a matrix; they sum to the picture.

    parts: by name, (n, 3), of lights that a gain can scale; fixed: (n, 3), of those that stay;
    base: the environment of the base; grey: the names of parts whose colour cannot change.
    """

    parts: dict[str, NDArray[np.float64]]
    fixed: NDArray[np.float64]
    base: Environment
    grey: frozenset[str]


def lights_of(
    scene: bpy.types.Scene, layer: str, world: bpy.types.World, answers: Answers, own: bool
) -> Lights:
    """Work out the picture of each light. own: whether the scene's own lamps may change.

    A light of the kit that filters what is behind it is no part: it stays as it is in all others.
    Raises what `kept.environment` raises.
    """
    width = scene.arto.environment_width
    whole = kept.environment(scene, width, layer, world)
    parts: dict[str, NDArray[np.float64]] = {}
    base = whole
    fixed = np.zeros_like(answers.layer("own"))
    if kits.has(world):
        kit = kits.read(world)
        can = [one.name for one in kit.lit if one.blend is not Blend.MULTIPLY and not one.lock]
        every = answers.under(whole)
        for name in can:
            with _showing(world, without(kit, {name})) as other:
                less = kept.environment(scene, width, layer, other)
            parts[name] = every - answers.under(less)
        with _showing(world, without(kit, set(can))) as other:
            base = kept.environment(scene, width, layer, other)
        if kit.base.kind in (BaseKind.HDRI, BaseKind.GRADIENT):
            parts[BASE] = answers.under(base)
        else:
            fixed = fixed + answers.under(base)
    else:
        parts[WORLD] = answers.under(whole)
    grey = {BASE} & set(parts)
    for name, picture in own_parts(scene, answers).items():
        if own and picture.any():
            parts[name] = picture
            grey.add(name)
        else:
            fixed = fixed + picture
    return Lights(parts, fixed, base, frozenset(grey))


def own_parts(scene: bpy.types.Scene, answers: Answers) -> dict[str, NDArray[np.float64]]:
    """The pictures of the scene's own lamps, by light group, with the settings' gains."""
    gains, most = gains_of(scene), scene.arto.own_lamps
    out, rest = {}, answers.layer("own")
    for name in answers.small.own_layers:
        group = name.removeprefix("own_")
        picture = answers.layer(name)
        rest = rest - picture
        out[GROUP + group] = most * gains.get(group, 1.0) * picture
    # what all groups leave is rounding where each lamp is in a group
    if np.abs(rest).sum() > 1e-4 * np.abs(answers.layer("own")).sum():
        out[OWN] = most * rest
    return out


def without(kit: Kit, names: set[str]) -> Kit:
    """A kit in which some lights do not shine, and stand before others as they did."""
    return replace(
        kit,
        lights=tuple(
            replace(one, strength=0.0) if one.name in names else one for one in kit.lights
        ),
    )


@contextmanager
def _showing(world: bpy.types.World, kit: Kit) -> Iterator[bpy.types.World]:
    """A copy of a world whose kit is another, as long as the block."""
    other = world.copy()
    try:
        kits.write(other, kit)
        yield other
    finally:
        bpy.data.worlds.remove(other)
