"""The stage: a copy of the artist's scene in which everything may be changed.

Capturing switches off whatever bends the light, and hangs a few hundred patches around the scene.
All this happens to a copy of the artist's scene. The copy shares the scene's objects and owns its
settings. It is thrown away on every way out, so there is nothing to put back.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.region import Region
from ..blender.output import float_exr

# Passes of a view layer that stay on. A stage needs no other pass, and each would cost memory.
_KEEP_PASSES = {"use_pass_combined", "use_pass_z"}


@dataclass(frozen=True)
class Pace:
    """How fast a stage renders.

    ready: seconds until the first path, where Cycles has to prepare the scene; again: the same
    where Cycles kept the scene; path: seconds for a path on a machine that does nothing else; busy:
    how many times longer that takes on this machine.
    """

    ready: float
    again: float
    path: float
    busy: float = 1.0


_Block = TypeVar("_Block", bound=bpy.types.ID)


class Stage:
    """The copied scene, and the data-blocks that are removed with the scene."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        self.changed: dict[str, list[object]] = {}
        self.pace: Pace | None = None  # How fast the small renders were.
        # Whether Ray Portals show the patches to the camera; see `capture.behind`.
        self.portals: bool | None = None
        self.own_groups: list[str] = []  # The artist's light groups that have objects.
        self._made: list[bpy.types.ID] = []
        # Seconds in which small renders traced paths, and seconds of all threads.
        self.traced: tuple[float, ...] = (0.0, 0.0)
        self.scene_bytes = 0  # What Cycles says that the scene takes which it has prepared.
        # Whether it matters that renders of the same samples have the same noise.
        self.same_noise = True
        self._longest = 0  # The most samples that the scene which Cycles keeps was rendered with.

    def made(self, block: _Block) -> _Block:
        """Note a new data-block, so that it goes when the stage goes."""
        self._made.append(block)
        return block

    def remove(self, blocks: list[bpy.types.ID]) -> None:
        """Remove some of the stage's data-blocks before the stage goes."""
        gone = {b.as_pointer() for b in blocks}
        self._made = [b for b in self._made if b.as_pointer() not in gone]
        bpy.data.batch_remove(blocks)

    def change(self, path: str, value: object) -> None:
        """Set `scene.<path>`, and note old and new value for the capture set's description."""
        *owners, name = path.split(".")
        target: bpy.types.bpy_struct = self.scene
        for owner in owners:
            target = getattr(target, owner)
        before = getattr(target, name)
        if before != value:
            setattr(target, name, value)
            self.changed[path] = [before, value]

    def keep_prepared(self) -> None:
        """Let Cycles keep the scene that it has prepared, from one render of the stage to the next.

        Cycles then reads only what has changed since. It builds its tree of all triangles again
        where an object was added, removed or changed. The memory is free again when the stage goes.
        """
        self.scene.render.use_persistent_data = True

    def about_to_render(self, most: int = 0) -> None:
        """Note that a render begins. most: the samples of a longer render that follows it.

        A scene that Cycles kept goes on with the sequence of its longest render. Where a render has
        fewer samples, Cycles prepares the scene again: its noise is then that of such a render.
        """
        samples = self.scene.cycles.samples
        if self.same_noise and self.is_kept and max(samples, most) < self._longest:
            self.renew()
        self._longest = max(self._longest, samples)

    def renew(self) -> None:
        """Have Cycles prepare the scene again, and keep it from then on if it did before."""
        kept, self._longest = self.is_kept, 0
        self.let_go()
        if kept:
            self.keep_prepared()

    def let_go(self) -> None:
        """Free the scene that Cycles has prepared. The next render prepares it again."""
        self.scene.render.use_persistent_data = False

    @property
    def is_kept(self) -> bool:
        """Whether Cycles keeps the scene that it has prepared."""
        return bool(self.scene.render.use_persistent_data)

    def clear(self) -> None:
        self.let_go()
        bpy.data.batch_remove([*self._made, self.scene])


def _hold_still(out: Stage) -> None:
    """Take the animation off the scene's settings, so that they stay as they are at this frame.

    Blender evaluates keys and drivers again when the render begins, which would undo what is set on
    the stage. The scene's custom properties stay animated, because drivers of objects read them.
    """
    animation = out.scene.animation_data
    if animation is None:
        return
    while animation.nla_tracks:
        animation.nla_tracks.remove(animation.nla_tracks[0])
    for driver in list(animation.drivers):
        if not driver.data_path.startswith('["'):
            animation.drivers.remove(driver)
    if animation.action is None:
        return
    animation.action = out.made(animation.action.copy())
    for layer in animation.action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                for curve in list(bag.fcurves):
                    if not curve.data_path.startswith('["'):
                        bag.fcurves.remove(curve)


def free_mark() -> str:
    """Find a beginning for the names of ARTO's light groups that no group of the artist's has.

    It is `ARTO_`, or `ARTO-2_` and so on where that is taken. The stage has no light groups of the
    artist's, but objects keep the names of theirs. An object must not fall into a group of ARTO's.
    """
    taken = {block.lightgroup for kind in (bpy.data.objects, bpy.data.worlds) for block in kind}
    marks = itertools.chain(["ARTO_"], (f"ARTO-{i}_" for i in itertools.count(2)))
    return next(m for m in marks if not any(group.startswith(m) for group in taken))


@contextmanager
def stage(scene: bpy.types.Scene, view_layer: str) -> Iterator[Stage]:
    """Copy `scene` with only `view_layer`, without compositing and extra passes.

    The copy is removed at the end. Raises SceneError where the scene has no such view layer.
    """
    if not scene.view_layers.get(view_layer):
        raise SceneError(f"the scene has no view layer '{view_layer}'")
    copy = scene.copy()
    out = Stage(copy)
    try:
        _hold_still(out)
        copy.frame_set(scene.frame_current, subframe=scene.frame_subframe)
        for layer in list(copy.view_layers):
            if layer.name != view_layer:
                copy.view_layers.remove(layer)
        layer = copy.view_layers[0]
        layer.use = True  # The caller wants this layer, even where F12 does not render it.
        for prop in layer.bl_rna.properties:
            if prop.identifier.startswith("use_pass_"):
                setattr(layer, prop.identifier, prop.identifier in _KEEP_PASSES)
        for prop in layer.cycles.bl_rna.properties:
            if prop.identifier.startswith("use_pass_") or prop.identifier.startswith("pass_debug"):
                setattr(layer.cycles, prop.identifier, False)
        while layer.aovs:
            layer.aovs.remove(layer.aovs[0])
        # Only some renders need the artist's own light groups, and each group costs memory.
        used = {thing.lightgroup for thing in copy.objects}
        out.own_groups = [g.name for g in layer.lightgroups if g.name in used]
        while layer.lightgroups:
            layer.lightgroups.remove(layer.lightgroups[0])
        copy.render.use_compositing = False
        out.let_go()
        float_exr(copy.render)
        yield out
    finally:
        out.clear()


def picture_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """The width and height of a render of the scene, in pixels."""
    r = scene.render
    share = r.resolution_percentage
    return r.resolution_x * share // 100, r.resolution_y * share // 100


def picture_region(scene: bpy.types.Scene) -> Region:
    """The part of its picture that the scene renders: all of it, or the artist's render region.

    Raises SceneError where the render region is empty.
    """
    width, height = picture_size(scene)
    r = scene.render
    if not r.use_border:
        return Region(0, 0, width, height)

    def edge(share: float, size: int) -> int:
        # As in Blender: rounded down, and in single precision (0.7 of 10 pixels is 7).
        return int(np.float32(share) * np.float32(size))

    x0, x1 = edge(r.border_min_x, width), edge(r.border_max_x, width)
    y0, y1 = edge(r.border_min_y, height), edge(r.border_max_y, height)
    if x1 <= x0 or y1 <= y0:
        raise SceneError("the render region is empty: draw it again, or turn it off")
    return Region(x0, height - y1, x1 - x0, y1 - y0)


def set_region(scene: bpy.types.Scene, region: Region) -> None:
    """Make the scene render only this region, and crop the picture to the region."""
    width, height = picture_size(scene)
    r = scene.render
    r.use_border = r.use_crop_to_border = (region.width, region.height) != (width, height)
    # A hundredth of a pixel inside, so that rounding cannot lose a row.
    r.border_min_x = (region.x + 0.01) / width
    r.border_max_x = (region.x + region.width + 0.01) / width
    r.border_min_y = (height - region.y - region.height + 0.01) / height
    r.border_max_y = (height - region.y + 0.01) / height
