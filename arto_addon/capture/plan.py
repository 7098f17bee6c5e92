"""The plan of a capture: its region, cut into tiles that fit the memory, and their renders."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from ...core.capture.kinds import Route
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
from ...core.region import Region
from .planes import MOST_SAMPLED

# Tiles that are not too thin begin at a row that is a multiple of this: there a row of every proxy
# begins.
ALIGNED = 8
# Seconds of rendering after which work is kept; more where Cycles needs long to get ready, so that
# getting ready takes at most a sixth of the time. Each strip is a file that relighting opens, and a
# process may open a few hundred.
KEPT, AT_MOST, MOST_STRIPS = 45.0, 6.0, 60


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


def kept_often(tiles: list[Region], region: Region, seconds: float, ready: float) -> list[Region]:
    """Cut a region into more strips where the work would be kept too seldom.

    tiles: the strips that fit the memory; seconds: that rendering all of them takes; ready: seconds
    that Cycles needs before the first path of each strip. Work is kept at the end of each strip.
    """
    share = max(KEPT, AT_MOST * ready) / max(seconds, 1e-9)
    rows = max(int(region.height * share) // ALIGNED, 1) * ALIGNED
    rows = max(rows, -(-region.height // MOST_STRIPS // ALIGNED) * ALIGNED)
    if share >= 1 or -(-region.height // rows) <= len(tiles):
        return tiles
    # all but the first begin at a row where a row of every proxy begins
    edges = [*range(-(region.y % ALIGNED), region.height, rows), region.height]
    edges[0] = 0
    return [
        Region(region.x, region.y + a, region.width, b - a) for a, b in itertools.pairwise(edges)
    ]


def finer(tiles: list[Region], seconds_a_pixel: float, ready: float, others: int) -> list[Region]:
    """Cut the tiles that are left where each would take longer than planned.

    The machine may have become busier since the plan. seconds_a_pixel: as the last tile took them;
    ready: see `kept_often`; others: how many tiles there are beside these.
    """
    most = 4 / 3 * max(KEPT, AT_MOST * ready)
    out: list[Region] = []
    for tile in tiles:
        count = math.ceil(tile.pixels * seconds_a_pixel / most)
        count = min(count, tile.height // (3 * ALIGNED))
        out += strips_of(tile, count) if count > 1 else [tile]
    return out if len(out) + others <= MOST_STRIPS else tiles


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
