"""The hemicube as emissive planes in a Blender scene."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import bpy
import numpy as np

from ...core.capture.names import GRAIN, GROUP, group_name
from ...core.faces import FACE_NAMES
from ...core.hemicube import Hemicube
from ...core.patterns import BASE, SHARP, PatternSet, pattern_set
from ..blender.markers import camera_of
from ..blender.nodes import Input, Nodes, made_of_nodes, new_material
from ..stage.stage import Stage, free_mark
from .behind import beyond_clip
from .shells import GAP, LID, PATTERN, Made, lid, threshold

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


# Grains along a patch's side: far finer than the part of a patch that a pixel reflects.
GRAINS = 2.0**14


def _polynomial(nodes: Nodes, coefficients: Iterable[float]) -> bpy.types.NodeSocket:
    """The value of a polynomial over `patterns.MONOMIALS` of the UV map."""
    split = nodes.add("ShaderNodeSeparateXYZ", nodes.add("ShaderNodeUVMap").outputs[0])
    u, v = split.outputs[0], split.outputs[1]
    terms = (
        1.0,
        u,
        nodes.math("MULTIPLY", u, u),
        v,
        nodes.math("MULTIPLY", v, v),
        nodes.math("MULTIPLY", u, v),
    )
    total: Input = 0.0
    for coefficient, term in zip(coefficients, terms, strict=True):
        if coefficient:
            total = nodes.math("MULTIPLY_ADD", term, float(coefficient), total)
    # at a patch's rim rounding may put u or v below 0, and light must not be negative
    return nodes.math("MAXIMUM", total, 0.0)


def _grain(nodes: Nodes) -> bpy.types.NodeSocket:
    """A random value for each grain: 1 on half of the grains, 0 on the others."""
    scaled = nodes.add(
        "ShaderNodeVectorMath",
        nodes.add("ShaderNodeUVMap").outputs[0],
        (GRAINS,) * 3,
        operation="MULTIPLY",
    )
    cell = nodes.add("ShaderNodeVectorMath", scaled.outputs[0], operation="FLOOR")
    noise = nodes.tree.nodes.new("ShaderNodeTexWhiteNoise")
    noise.noise_dimensions = "3D"
    nodes.tree.links.new(cell.outputs[0], noise.inputs["Vector"])
    return nodes.math("GREATER_THAN", noise.outputs["Value"], 0.5)


def _radiance(nodes: Nodes, name: str, patterns: PatternSet) -> list[Input]:
    """What a pattern of the set, or `GRAIN`, emits: sockets or values, one for all channels or one
    for each."""
    if name == GRAIN:
        return [_grain(nodes)]
    return [
        _grain(nodes) if row is None else _polynomial(nodes, row) for row in patterns.emission(name)
    ]


def _shader(
    nodes: Nodes, shown: list[Input], radiance: float, hidden: Input = 0.0
) -> bpy.types.NodeSocket:
    """Emission, plus what lies behind; shown: see `_radiance`; radiance: what 1 of it is.

    hidden: 1 where nothing lies behind.

    The background lies behind the last pattern. There Cycles adds the scene's sun lamps to
    scattered rays. An opaque patch would hide the suns' mirror images.
    """
    if len(shown) == 1:
        colour: Input = (radiance, radiance, radiance, 1)
        light = nodes.add("ShaderNodeEmission", colour, shown[0]).outputs[0]
    else:
        colour = nodes.add("ShaderNodeCombineColor", *shown).outputs[0]
        light = nodes.add("ShaderNodeEmission", colour, radiance).outputs[0]
    behind = nodes.add("ShaderNodeBsdfTransparent")
    if hidden:
        nodes.tree.links.new(nodes.math("SUBTRACT", 1.0, hidden), behind.inputs[0])
    return nodes.add("ShaderNodeAddShader", light, behind.outputs[0]).outputs[0]


def pattern_material(
    name: str, patterns: PatternSet, sampled: bool = False, radiance: float = 1.0
) -> bpy.types.Material:
    """Emission of a pattern of the set (or of `GRAIN`), plus what lies behind."""
    material = new_material(f"ARTO {name}")
    # paths find the patches, and no shadow ray is cast at them: Cycles' limit of 255 light groups
    # for sampled lights does not apply
    material.cycles.emission_sampling = "FRONT_BACK" if sampled else "NONE"
    tree = material.node_tree
    tree.nodes.clear()
    nodes = Nodes(tree)
    nodes.add(
        "ShaderNodeOutputMaterial", _shader(nodes, _radiance(nodes, name, patterns), radiance)
    )
    return material


def overriding_material(
    override: bpy.types.Material,
    names: list[str],
    patterns: PatternSet,
    sampled: bool = False,
    radiance: float = 1.0,
) -> bpy.types.Material:
    """A view layer's material override, on the artist's objects; on a plane, its pattern.

    Blender puts the override on every object, whatever the object's slots hold. So one material
    must serve all, and look at the object: a plane has the number of its pattern, from 1, as
    property `PATTERN`.
    """
    material = override.copy()
    material.cycles.emission_sampling = (
        "FRONT_BACK" if sampled else "NONE"
    )  # as in `pattern_material`
    tree = made_of_nodes(material)
    nodes = Nodes(tree)
    number = tree.nodes.new("ShaderNodeAttribute")
    number.attribute_type, number.attribute_name = "OBJECT", PATTERN
    shown = [_radiance(nodes, name, patterns) for name in names]
    total: list[Input] = [0.0] * max(map(len, shown))
    for i, channels in enumerate(shown, 1):
        mine = nodes.math("COMPARE", number.outputs["Fac"], float(i), 0.5)
        for c in range(len(total)):
            value = channels[c if len(channels) > 1 else 0]
            total[c] = nodes.math("MULTIPLY_ADD", mine, value, total[c])
    plane = nodes.math("GREATER_THAN", number.outputs["Fac"], 0.5)
    hidden = nodes.math("COMPARE", number.outputs["Fac"], LID, 0.5)
    output = tree.get_output_node("CYCLES") or tree.nodes.new("ShaderNodeOutputMaterial")
    surface = _shader(nodes, total, radiance, hidden)
    for socket, pattern in (("Surface", surface), ("Volume", None)):
        links = output.inputs[socket].links
        if not links and pattern is None:
            continue
        mix = tree.nodes.new("ShaderNodeMixShader")
        tree.links.new(plane, mix.inputs[0])
        if links:
            tree.links.new(links[0].from_socket, mix.inputs[1])
        if pattern:
            tree.links.new(pattern, mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs[socket])
    if links := output.inputs["Displacement"].links:
        others = nodes.math("SUBTRACT", 1.0, plane)
        scaled = nodes.add("ShaderNodeVectorMath", links[0].from_socket, operation="SCALE")
        tree.links.new(others, scaled.inputs["Scale"])
        tree.links.new(scaled.outputs[0], output.inputs["Displacement"])
    return material


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
) -> None:
    """Fill `collection` with a plane for each (patch, pattern name) of `images`.

    mark: part of the names of light groups (`stage.free_mark`); without a mark the planes get no
    light group. made: called with every new data-block, which it returns. portals: see `lit`.
    """
    images = list(images)
    used = list(dict.fromkeys(name for _, name in images))
    materials = {name: made(pattern_material(name, patterns, sampled, radiance)) for name in used}
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
) -> Iterator[None]:
    """Put the planes of some images around the stage, with light groups, for as long as it is open.

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
    try:
        if override:
            names = list(dict.fromkeys(name for _, name in images))
            shown = overriding_material(override, names, patterns, sampled, radiance)
            layer.material_override = note(shown)
        collection = note(bpy.data.collections.new("ARTO Capture"))
        on.scene.collection.children.link(collection)
        mark = free_mark()
        build(collection, hemicube, patterns, images, note, mark, sampled, radiance, portals)
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
        yield
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
