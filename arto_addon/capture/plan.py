"""The plan of a capture: its region, cut into tiles that fit the memory, and their renders."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from ...core.capture.kinds import Route
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
from ...core.region import Region
from .planes import MOST_SAMPLED

# Tiles that are not too thin begin at a row that is a multiple of this: there a row of every proxy
# begins.
ALIGNED = 8


def tiles_of(region: Region, bytes_a_pixel: int, budget: int) -> list[Region]:
    """Cut a region into strips that fit a budget, in bytes."""
    row = region.width * bytes_a_pixel
    rows = budget // row
    if rows < 1:
        raise SceneError(
            f"a single row of the picture takes {row / 2**20:.0f} MB: raise the memory budget, or "
            "capture fewer patches or patterns"
        )
    count = -(-region.height // rows)
    if count > 1 and rows >= 4 * ALIGNED:
        # aligning moves an edge by less than `ALIGNED` rows: leave room for that
        count = -(-region.height // (rows - ALIGNED))
    return strips_of(region, count)


def strips_of(region: Region, count: int) -> list[Region]:
    """Cut a region into `count` strips, or into as many as it has rows.

    Strips that are not too thin are aligned: no pixel of a proxy is in two of them.
    """
    count = min(count, region.height)
    edges = [region.height * i // count for i in range(count + 1)]
    if region.height >= 3 * ALIGNED * count:
        edges[1:-1] = [e + -(region.y + e) % ALIGNED for e in edges[1:-1]]
    return [
        Region(region.x, region.y + a, region.width, b - a) for a, b in itertools.pairwise(edges)
    ]


def render_plan(
    route: Route, hemicube: Hemicube, names: Sequence[str]
) -> list[list[tuple[int, str]]]:
    """The (patch, pattern name) images of each render."""
    k = range(len(hemicube))
    if route == Route.SAMPLED:
        # each pattern has its own renders; all trace the same paths, since they have the same seed
        # and their lights stand in the same places
        some = [k[i : i + MOST_SAMPLED] for i in range(0, len(k), MOST_SAMPLED)]
        return [[(i, name) for i in part] for name in names for part in some]
    if route == Route.ALL:
        return [[(i, name) for i in k for name in names]]
    if route == Route.PATTERN:
        return [[(i, name) for i in k] for name in names]
    return [[(i, name)] for i in k for name in names]
