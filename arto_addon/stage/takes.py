"""Takes: a shot with shadow catchers is captured three times.

Cycles sorts the light on shadow catchers into no light groups. So three pictures in the same light
tell the things from the ground (see `core.catcher`). The first has everything, with the catchers as
ordinary things. The second has the catchers alone. The third has the things alone, which is what
the light groups show of a scene with catchers.

Flags of objects decide what is in a take. The stage shares the artist's objects, so the flags are
put back on every way out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy

from ...core.capture.kinds import Take
from ...core.errors import SceneError
from .bounds import Name, Rendered

# The names of the takes. WHOLE has everything, and is the only take of a scene without catchers.
# GROUND has the catchers alone, and THINGS the things alone.
WHOLE, GROUND, THINGS = Take.WHOLE, Take.GROUND, Take.THINGS
# The takes after the first, in the order of capturing. The name of a take is also the name of its
# folder in the shot's folder.
TAKES = (GROUND, THINGS)
# The kinds of rays by which an object may be seen.
_RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


@contextmanager
def take(seen: Rendered, name: str) -> Iterator[list[bpy.types.Object]]:
    """Set the objects' flags as a take needs them, and put the flags back at the end.

    seen: what the scene renders; name: the take's. Yields the objects whose flags the take needs to
    set. Raises SceneError where the scene has no such take, or where catchers and things cannot be
    told apart.
    """
    if not seen.catchers:
        if name != WHOLE:
            raise SceneError(
                f"nothing in the scene catches shadows, so it has no take '{name}': open the file "
                "whose catchers were captured, or capture or plan anew"
            )
        yield []
        return
    seen.check()
    wanted: list[tuple[bpy.types.bpy_struct, str, bool]] = []
    if name == THINGS:
        yield []
        return
    for thing in _originals(seen.flagged):
        _check_still(thing)
        wanted.append((thing, "is_shadow_catcher", False))
    if name == GROUND:
        for thing in _originals(seen.things):
            wanted += [(thing, f"visible_{ray}", False) for ray in _RAYS]
    were = [(thing, flag, getattr(thing, flag)) for thing, flag, _ in wanted]
    try:
        for thing, flag, value in wanted:
            setattr(thing, flag, value)
        yield list(dict.fromkeys(thing for thing, _, _ in wanted))
    finally:
        for thing, flag, value in were:
            setattr(thing, flag, value)


def _originals(names: Iterable[Name]) -> list[bpy.types.Object]:
    return [bpy.data.objects[name, library or None] for name, library in sorted(names)]


def _check_still(thing: bpy.types.Object) -> None:
    """Raise SceneError where a catcher's flags are animated, as the render would set them again."""
    animation = thing.animation_data
    if animation is None:
        return
    paths = [d.data_path for d in animation.drivers]
    if animation.action:
        for layer in animation.action.layers:
            for strip in layer.strips:
                paths += [c.data_path for bag in strip.channelbags for c in bag.fcurves]
    for path in paths:
        if path == "is_shadow_catcher" or path.startswith("visible_"):
            raise SceneError(
                f"'{thing.name}' is a shadow catcher whose {path} is animated: remove that "
                "animation to capture it"
            )


def only_things(layer: bpy.types.ViewLayer) -> None:
    """Leave the shadows out of the alpha of a take of the things alone.

    Cycles does so where the pass Shadow Catcher is on: the shadows are then in that pass.
    """
    layer.cycles.use_pass_shadow_catcher = True
