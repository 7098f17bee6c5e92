"""A look at the stage before the long renders: small pictures in the light of patches and of white.

All pictures show one scene, which Cycles prepares once: fine patches stand before a white world.
Light groups tell the light of each patch, of the world, and the scene's own light apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture.names import GROUP, combined
from ...core.capture.refine import check
from ...core.errors import CaptureSetError
from ...core.faces import FINEST
from ...core.hemicube import Hemicube
from ...core.light.environment import Environment, directions, sample_directions
from ...core.patterns import pattern_set
from ...core.region import Region
from ..stage.small import parts_of, small
from ..stage.stage import Stage, picture_region, picture_size
from ..work import Progress, Steps
from ..world.lamp_render import world_showing
from . import planes

# Of the picture in the light of the patches, and of those in the light of a white world.
SAMPLES, WHITE_SAMPLES = 32, 48
# Rows of the white world's map, which is black where the hemicube has no patch.
HEIGHT = 256
# Names the white world's light group, after the mark of the groups of patches.
WHITE = "white"


@dataclass(frozen=True)
class Looked:
    """Small pictures of a stage, scene-linear.

    own: the scene's own light (H, W, 3); patches: that and the light of all patches (H, W, 3);
    white: the same for a white world, of two seeds (2, H, W, 3); probe: the light of each of the
    finest patches (F * 16 * 16, H, W, 3).
    """

    own: NDArray
    patches: NDArray
    white: NDArray
    probe: NDArray


@dataclass
class Glance(Progress):
    """A step of a look: the first of its pictures is there.

    hemicube: with the finest patches; region: of the picture, whose size is `shape`, (height,
    width); own, probe: as in `Looked`; alpha: (H, W).
    """

    hemicube: Hemicube = field(default_factory=Hemicube)
    shape: tuple[int, int] = (0, 0)
    region: Region = field(default_factory=lambda: Region(0, 0, 0, 0))
    own: NDArray = field(default_factory=lambda: np.empty(0))
    alpha: NDArray = field(default_factory=lambda: np.empty(0))
    probe: NDArray = field(default_factory=lambda: np.empty(0))


def look(on: Stage, hemicube: Hemicube) -> Steps[Looked]:
    """Look at a prepared stage, in the light of the finest patches and of a white world -> Looked.

    The stage is left as it was. Raises CancelledError, CaptureSetError, ExrError, HemicubeError.
    """
    check(hemicube)
    fine = replace(hemicube, patches=FINEST)
    scene, layer = on.scene, on.scene.view_layers[0]
    black, seed, through = scene.world, scene.cycles.seed, scene.cycles.transparent_max_bounces
    images = [(k, "white") for k in range(len(fine))]
    with small(on, SAMPLES), planes.lit(on, fine, pattern_set("white"), images) as mark:
        group = mark + WHITE
        white_one = white_world(on, hemicube, group)
        # The film is transparent: the camera would see the world in its light group alone.
        white_one.cycles_visibility.camera = False
        try:
            # In a volume, paths of the patches go otherwise where there is a world to sample.
            if not _has_volumes():
                scene.world = white_one
            # Shadow rays are cast at the world, and tell the first 255 groups apart.
            _put_first(layer, group)
            parts = yield from parts_of(on, f"looking at the light of {len(fine)} directions")
            probe = groups_of(parts, len(fine))
            whole, lit = combined(parts), probe.sum(axis=0)
            own, alpha = whole[..., :3] - lit, whole[..., 3]
            if scene.world == white_one:
                own = own - light_of(parts, group)
            width, height = picture_size(scene)
            text, region = "a first look is there", picture_region(scene)
            yield Glance(0.0, text, fine, (height, width), region, own, alpha, probe)
            if (
                scene.world != white_one
            ):  # even the same world, set again, would have Cycles prepare the scene again
                scene.world = white_one
            scene.cycles.samples = WHITE_SAMPLES
            # Light passes as many transparent surfaces as in the artist's render, and the patches.
            scene.cycles.transparent_max_bounces = own_bounces(on) + 1
            white = []
            for i in (1, 2):
                scene.cycles.seed = seed + i
                # With other light groups, Cycles would prepare the scene again.
                parts = yield from parts_of(on, "looking at the light of a white world", only=group)
                white.append(own + light_of(parts, group))
        finally:
            scene.world, white_one.lightgroup = black, ""
            scene.cycles.seed = seed
            scene.cycles.transparent_max_bounces = through
    return Looked(own, own + lit, np.stack(white), probe)


def _put_first(layer: bpy.types.ViewLayer, group: str) -> None:
    """Add a light group to a view layer, before those that are there."""
    names = [group, *(there.name for there in layer.lightgroups)]
    while layer.lightgroups:
        layer.lightgroups.remove(layer.lightgroups[0])
    for name in names:
        layer.lightgroups.add(name=name)


def _has_volumes() -> bool:
    """Whether a material of the file has a volume."""
    return any(
        node.type == "OUTPUT_MATERIAL" and node.inputs["Volume"].is_linked
        for material in bpy.data.materials
        if material.node_tree
        for node in material.node_tree.nodes
    )


def own_bounces(on: Stage) -> int:
    """How many transparent surfaces light passes in the artist's render."""
    through = on.scene.cycles.transparent_max_bounces
    asked = on.changed.get("cycles.transparent_max_bounces", [through])[0]
    assert isinstance(asked, int)
    return asked


def groups_of(parts: dict[str, NDArray], count: int) -> NDArray:
    """The light of each patch in a render's parts, (count, H, W, 3).

    Raises CaptureSetError where Blender did not write all.
    """
    found = [(GROUP.search(name), pixels) for name, pixels in parts.items()]
    by_patch = {int(match[1]): pixels for match, pixels in found if match}
    if missing := count - len(by_patch):
        raise CaptureSetError(
            f"the probe lacks {missing} of {count} light groups: make room on the disk for "
            "temporary files, or turn Adaptive Patches off"
        )
    return np.stack([by_patch[k] for k in range(count)])


def light_of(parts: dict[str, NDArray], group: str) -> NDArray:
    """The light of a light group in a render's parts, (H, W, 3)."""
    return next(pixels for name, pixels in parts.items() if name.endswith(group))[..., :3]


def white_world(on: Stage, hemicube: Hemicube, group: str = "") -> bpy.types.World:
    """A white world, black in directions where no patch is.

    The world shows a map, though it has one colour: Cycles does not sample an even colour as a
    light, so that such a world would have the same faults as the patches.
    """
    azimuth, latitude, _ = sample_directions(HEIGHT, 2 * HEIGHT, 1)
    there = hemicube.locate(directions(azimuth, latitude))[0] >= 0
    shown = Environment(np.repeat(there[..., None], 3, axis=-1).astype(np.float32))
    return world_showing(on, shown, group)
