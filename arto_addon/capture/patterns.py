"""Which patterns a capture shows: the artist's choice, or those that its fit is best with."""

from __future__ import annotations

import bpy

from ...core.capture.kinds import Route
from ...core.fit.choice import SEARCH, STAGE_AND_MATTE
from ...core.patterns import PatternSet, pattern_set
from ...core.supports import SUPPORTS

# The setting's value that leaves the choice to `patterns_of`.
AUTO = "auto"


def patterns_of(settings: bpy.types.ArtoSettings, route: Route | None = None) -> PatternSet:
    """Find the patterns of a capture with these settings.

    `AUTO` means the patterns by lobe wherever the fit chooses its models by itself: they alone show
    mirror images on glass and coat. Light that is brought by shadow rays alone is not told apart by
    lobes, nor are a support for each channel, nor images of several renders. There the first
    moments are shown. A model that was asked for by name gets the fewest patterns that tell it.

    settings: of the scene; route: how the light gets to the patches, if that is known already.
    """
    if settings.patterns != AUTO:
        return pattern_set(settings.patterns)
    choice, route = settings.support, Route(settings.route) if route is None else route
    if choice == AUTO:
        whole = route == Route.ALL and not settings.separate
        return pattern_set("lobes" if whole else "linear")
    if choice == SEARCH:
        return pattern_set("paper")
    needs = SUPPORTS["box" if choice == STAGE_AND_MATTE else choice].needs
    for name in ("white", "linear", "moments"):
        found = pattern_set(name)
        if all(found.identified[m] for m in needs):
            return found
    return pattern_set("moments_uv")
