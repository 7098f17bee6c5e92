"""Shells without light around the stage, beside the planes of the patches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np

from ...core.faces import FACE_NAMES
from ...core.hemicube import Hemicube
from ..blender.nodes import Nodes, new_material

# The property of a plane that is the number of its pattern, from 1.
PATTERN = "arto_pattern"
# The numbers of no pattern: of a clear shell, and of the lid.
NONE, LID = 1000.0, 2000.0
# The patterns of a patch stand behind each other, each farther out by this share. The gap is so
# small that a point of the patch keeps its direction, and so wide that float32 at 1,000 radii does
# not lose it.
GAP = 1e-4
# Notes a new data-block, and returns it.
Made = Callable[[bpy.types.ID], bpy.types.ID]


def _shell(
    collection: bpy.types.Collection,
    hemicube: Hemicube,
    made: Made,
    name: str,
    clear: bool,
) -> bpy.types.Object:
    """Put a shell without light around the stage, clear or black, of the shape of a hemicube."""
    material = made(new_material(name))
    material.node_tree.nodes.clear()
    nodes = Nodes(material.node_tree)
    if clear:
        shader = nodes.add("ShaderNodeBsdfTransparent").outputs[0]
        nodes.add("ShaderNodeOutputMaterial", shader)
    centre = np.array(hemicube.centre)
    corners = [centre + hemicube.size * hemicube.corners(k) for k in range(len(hemicube))]
    mesh = made(bpy.data.meshes.new(name))
    quads = [tuple(range(4 * k, 4 * k + 4)) for k in range(len(corners))]
    mesh.from_pydata(np.concatenate(corners).tolist(), [], quads)
    mesh.materials.append(material)
    shell = made(bpy.data.objects.new(name, mesh))
    shell.visible_shadow = False
    shell[PATTERN] = NONE if clear else LID
    collection.objects.link(shell)
    return shell


def threshold(collection: bpy.types.Collection, hemicube: Hemicube, made: Made) -> None:
    """A clear shell before the patterns, at which Cycles tosses its coin.

    Russian roulette ends a path, or makes it count for more, at the first surface that it meets
    after a bounce, and after that surface's emission. Were this the white pattern, it would see
    other weights than the patterns behind it, and their ratio would be off by that.
    """
    before = replace(hemicube, size=hemicube.size * (1 - GAP))
    _shell(collection, before, made, "ARTO Threshold", clear=True).visible_camera = False


def lid(
    collection: bpy.types.Collection,
    hemicube: Hemicube,
    made: Made,
    patterns: int,
) -> None:
    """A black shell on all sides, behind as many patterns, that the camera alone sees.

    So the world behind is not seen where a Ray Portal shows the patches.
    """
    size = hemicube.size * (1 + GAP * (patterns + 1))
    closed = replace(hemicube, faces=FACE_NAMES, patches=1, half_sides=False, leaves=(), size=size)
    shell = _shell(collection, closed, made, "ARTO Lid", clear=False)
    shell.visible_diffuse = shell.visible_glossy = False
    shell.visible_transmission = shell.visible_volume_scatter = False
