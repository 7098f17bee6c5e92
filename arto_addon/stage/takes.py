"""Takes: a shot with shadow catchers is captured three times.

Cycles gives the light on shadow catchers no light groups. So what is on the ground is told from the
ground by pictures of the same light: everything as ordinary things; the catchers alone; and the
things alone, which is what the light groups show of a scene with catchers. See `core.catcher`.

Flags of objects say what is in a take. They are the artist's objects, which the stage shares: they
are put back on every way out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy

from ...core.capture.kinds import Take
from ...core.errors import SceneError
from .bounds import Name, Rendered

# The names of takes: of everything, which is the only one where nothing catches shadows; of the
# catchers alone; of the things alone.
WHOLE, GROUND, THINGS = Take.WHOLE, Take.GROUND, Take.THINGS
# Those beside the first, in the order of capturing. Their names are those of their folders in the
# shot's.
TAKES = (GROUND, THINGS)
# In the description of a field of such a take: the key of the first.
PAIR = "pair"
# What rays an object is seen by.
_RAYS = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")


@contextmanager
def take(seen: Rendered, name: str) -> Iterator[list[bpy.types.Object]]:
    """The objects as a take of what is rendered has them; those that it has otherwise than the
    artist. Raises SceneError."""
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
    """Raise SceneError where a catcher's flags are animated: the render would set them anew."""
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
    """Have the alpha of a take of the things alone without the shadows, which have a pass then."""
    layer.cycles.use_pass_shadow_catcher = True
