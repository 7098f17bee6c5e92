"""The hemicube as emissive planes in a Blender scene."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import bpy
import numpy as np

from ...core.capture.names import GRAIN, GROUP, group_name
from ...core.faces import FACE_NAMES
from ...core.hemicube import Hemicube
from ...core.patterns import BASE, SHARP, PatternSet, pattern_set
from ..blender.markers import camera_of
from ..blender.version import FIVE
from ..stage.stage import Stage, free_mark
from .behind import beyond_clip, passes
from .emission import most_passed, overriding_material, pattern_material
from .shells import GAP, PATTERN, Made, lid, threshold

COLLECTION = "ARTO Hemicube"
# Distance of the patches that an artist looks at, in radii of the scene.
VISIBLE = 2.0
FAR = 1000.0
# What the patches of a capture emit where a pattern is 1. Cycles adds the emission that a mirror or
# glass shows to the albedo that guides the denoiser, and there it must not be seen. A power of two
# changes no bit of what the light is.
FAINT = 2.0**-14
# Most light groups that shadow rays can tell apart: Cycles has 8 bits for them. With more groups,
# some would lose their light without a message.
MOST_SAMPLED = 255


def wanted(scene: bpy.types.Scene, centre: Iterable[float], radius: float) -> Hemicube:
    """The hemicube that the settings ask for, around a scene with this centre and radius."""
    s = scene.arto
    angle = s.rotation
    if s.align == "camera" and (camera := camera_of(scene)):
        # a camera looks along its -Z axis; only the heading about the vertical counts
        look = -camera.matrix_world.col[2].to_3d()
        angle += math.atan2(-look.x, look.y)
    x, y, z = (float(along) for along in centre)
    c, sn = math.cos(angle), math.sin(angle)
    return Hemicube(
        faces=tuple(f for f in FACE_NAMES if f in s.faces),
        patches=s.patches,
        half_sides=s.half_sides,
        orientation=((c, -sn, 0.0), (sn, c, 0.0), (0.0, 0.0, 1.0)),
        centre=(x, y, z),
        size=FAR * radius if s.far else s.size,
    )


def _plane(
    name: str, corners: np.ndarray, material: bpy.types.Material, made: Made
) -> bpy.types.Object:
    mesh = made(bpy.data.meshes.new(name))
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
    uv = mesh.uv_layers.new(name="UVMap")
    uv.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    mesh.materials.append(material)
    plane = made(bpy.data.objects.new(name, mesh))
    # the scene's own sun must reach the scene through the patches
    plane.visible_shadow = False
    plane.display_type = "WIRE"
    plane.hide_select = True
    return plane


def _seen_by(plane: bpy.types.Object, paths: str, portals: bool) -> None:
    """Hide a plane from the light paths that are not to see it; see `patterns.PATHS`.

    A path sees either all planes of the base or all of the sharp ones: what it left last is either
    a diffuse surface or a volume, or it is one that reflects or refracts. portals: whether a path
    that left the camera sees planes too, the sharp ones.
    """
    plane.visible_diffuse = plane.visible_volume_scatter = paths != SHARP
    plane.visible_glossy = plane.visible_transmission = paths != BASE
    plane.visible_camera = portals and paths != BASE


def build(
    collection: bpy.types.Collection,
    hemicube: Hemicube,
    patterns: PatternSet,
    images: Iterable[tuple[int, str]],
    made: Made,
    mark: str = "",
    sampled: bool = False,
    radiance: float = 1.0,
    portals: bool = False,
    most: Mapping[str, int] | None = None,
) -> None:
    """Fill `collection` with a plane for each (patch, pattern name) of `images`.

    mark: part of the names of light groups (`stage.free_mark`); without a mark the planes get no
    light group. made: called with every new data-block, which it returns. portals: see `lit`;
    most: for each pattern, see `emission.most_passed`.
    """
    images = list(images)
    used = list(dict.fromkeys(name for _, name in images))
    materials = {
        name: made(pattern_material(name, patterns, sampled, radiance, (most or {}).get(name)))
        for name in used
    }
    centre = np.array(hemicube.centre)
    for k, pattern in images:
        name = group_name(k, pattern)
        group = name.replace("ARTO_", mark, 1) if mark else ""
        distance = hemicube.size * (1 + GAP * used.index(pattern))
        plane = _plane(name, centre + distance * hemicube.corners(k), materials[pattern], made)
        plane.lightgroup = group
        _seen_by(plane, patterns.paths(pattern) if pattern != GRAIN else "", portals)
        plane[PATTERN] = float(used.index(pattern) + 1)
        collection.objects.link(plane)


@contextmanager
def lit(
    on: Stage,
    hemicube: Hemicube,
    patterns: PatternSet,
    images: Iterable[tuple[int, str]],
    sampled: bool = False,
    own: bool = False,
    radiance: float = 1.0,
    portals: bool = False,
) -> Iterator[str]:
    """Put the planes of some images around the stage, with light groups, for as long as it is open.

    Yields how the names of the light groups begin.

    sampled: whether Cycles also casts shadow rays at the patches, as it does at a world; it can do
    so for at most `MOST_SAMPLED` images. own: whether the artist's light groups are written too.
    radiance: what the patches emit where a pattern is 1, see `FAINT`. portals: whether rays of the
    camera see the patches where Ray Portals have turned them.
    """
    made: list[bpy.types.ID] = []
    images = list(images)
    if sampled and len(images) > MOST_SAMPLED:
        raise ValueError(f"{len(images)} sampled patches; Cycles tells {MOST_SAMPLED} apart")

    def note(block: bpy.types.ID) -> bpy.types.ID:
        made.append(block)
        return on.made(block)

    layer = on.scene.view_layers[0]
    override = layer.material_override
    if portals:
        hemicube = beyond_clip(on.scene, hemicube)
    names, most = list(dict.fromkeys(name for _, name in images)), None
    # at patches that are sampled most paths end by a shadow ray, which does not meet the patterns
    if (through := passes(on)) is not None and not sampled:
        # in 4.5 shadow rays pass one surface fewer than others, and bring most of the light
        through -= 0 if FIVE else 1
        most = most_passed(patterns, names, through)
    try:
        if override:
            shown = overriding_material(override, names, patterns, sampled, radiance, most)
            layer.material_override = note(shown)
        collection = note(bpy.data.collections.new("ARTO Capture"))
        on.scene.collection.children.link(collection)
        mark = free_mark()
        build(collection, hemicube, patterns, images, note, mark, sampled, radiance, portals, most)
        planes = list(collection.objects)
        if len(patterns) > 1:
            # One pattern alone has no ratios to keep, and the coin after it costs it no noise.
            threshold(collection, hemicube, note)
        if portals:
            lid(collection, hemicube, note, len(patterns) + 1)
        # the artist's groups come first: their lamps are sampled, and of the groups of sampled
        # lights Cycles can only tell the first apart
        for name in on.own_groups if own else ():
            if not GROUP.search(f"Combined_{name}"):  # a group named as ours stays in `own`
                layer.lightgroups.add(name=name)
        for plane in planes:
            layer.lightgroups.add(name=plane.lightgroup)
        yield mark
    finally:
        layer.material_override = override
        while layer.lightgroups:
            layer.lightgroups.remove(layer.lightgroups[0])
        on.remove(made)


def build_for_artist(
    scene: bpy.types.Scene, hemicube: Hemicube, radius: float
) -> bpy.types.Collection:
    """Put the hemicube into the artist's scene, to look at -> its collection.

    It is not rendered there, because it would hide the world. A capture builds another hemicube
    from the same geometry.
    """
    remove_for_artist(scene)
    collection = bpy.data.collections.new(COLLECTION)
    collection.hide_render = True
    scene.collection.children.link(collection)
    images = [(k, "white") for k in range(len(hemicube))]
    # drawn near, where they can be seen; far patches of a capture have the same directions
    drawn = replace(hemicube, size=min(hemicube.size, VISIBLE * radius))
    build(collection, drawn, pattern_set("white"), images, lambda block: block)
    collection["arto_hemicube"] = json.dumps(hemicube.to_json())
    collection["arto_radius"] = radius
    return collection


def of_artist(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    """The collection that `build_for_artist` made in this scene, or None."""
    return next((c for c in scene.collection.children if "arto_hemicube" in c), None)


def built(scene: bpy.types.Scene) -> tuple[Hemicube, float] | None:
    """The geometry of the artist's hemicube and the scene's radius when it was built, or None."""
    collection = of_artist(scene)
    if collection is None:
        return None
    return Hemicube.from_json(json.loads(collection["arto_hemicube"])), collection["arto_radius"]


def remove_for_artist(scene: bpy.types.Scene) -> bool:
    """Remove the artist's hemicube and its data -> whether there was a hemicube."""
    collection = of_artist(scene)
    if collection is None:
        return False
    planes = list(collection.objects)
    meshes = [p.data for p in planes]
    materials = {m for mesh in meshes for m in mesh.materials if m}
    bpy.data.batch_remove([*planes, *meshes, *materials, collection])
    return True
