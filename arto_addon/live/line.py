"""What the artist is told of a live picture, in a line: its size, and what it lacks."""

from __future__ import annotations

import bpy

from ...core.units import clock, size
from ..blender.words import tr
from .viewer import Drawn

FINISHED_LINE = "Finished: this is the plate"
# Seconds that finishing takes, until it was measured.
GUESS = 5.0


def lacking(scene: bpy.types.Scene, held: bool, behind: bool, suns: float) -> list[str]:
    """What a live picture of full size lacks and a relight adds, in words.

    held: whether its brightness is that of a render only after a relight; behind: whether it has
    the world behind the things; suns: the share of the light of suns, 0 for none.
    """
    lacks = [tr("its brightness")] if held else []
    lacks += [] if behind else [tr("the world behind")]
    if suns and scene.arto.lamps:
        lacks.append(tr("the HDRI's suns ({share:.0%} of its light)", share=suns))
    return lacks


def line(
    scene: bpy.types.Scene, shown: Drawn, lacks: list[str], took: float | None, beside: int = 0
) -> str:
    """The line.

    lacks: see `lacking`; took: how long the last finishing took, in seconds; beside: bytes that the
    resident renderer takes.
    """
    if shown.factor > 1:
        return tr("1/{factor} of the size, after {s:.2f} s", factor=shown.factor, s=shown.latency)
    if not lacks:
        said = tr("Whole, after {s:.2f} s", s=shown.latency)
        if shown.wish.clean is not None:
            said = tr("Whole and denoised")
        if not beside:
            return said
        return tr("{said}; the renderer beside takes {size}", said=said, size=size(beside))
    said = tr("Whole, without {lacks}", lacks=", ".join(lacks))
    if not scene.arto.live_finish:
        return tr("{said}: Relight adds this", said=said)
    return tr("{said}: added {time} later", said=said, time=clock(took or GUESS))


def other_shot(was: tuple, now: tuple) -> str:
    """Say that the scene shows another shot than Live, whose light Live follows all the same.

    was, now: what tells a shot from others, the frame first and its part after it.
    """
    if was[2:] == now[2:]:
        return tr("The light of frame {now}, on the shot of frame {was}", now=now[0], was=was[0])
    return tr("Live shows the shot that it was switched on for: this is another one")


def draft_line(size: tuple[int, int], progress: tuple[int, int, bool] | None) -> str:
    """Say that the picture is of a capture that is not complete.

    size: (height, width) of its draft; progress: see `source.Opened`.
    """
    h, w = size
    if progress is None:
        return tr("From a draft of {w} x {h}; the capture has begun", w=w, h=h)
    done, tiles, goes_on = progress
    if goes_on:
        text = "From a draft of {w} x {h}; the capture is at tile {at} of {tiles}"
        return tr(text, w=w, h=h, at=min(done + 1, tiles), tiles=tiles)
    text = "From a draft of {w} x {h}; the capture stopped, {done} of {tiles} tiles are there"
    return tr(text, w=w, h=h, done=done, tiles=tiles)
