"""The scene in the light of monitors or of a dome's lamps: one render for all of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...core.capture.names import GROUP, combined
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
from ...core.patterns import MONOMIALS, pattern_set
from ...core.photographs.description import Monitors
from ...core.photographs.screens import hemicube_of
from ..blender.markers import camera_of
from ..blender.nodes import Nodes
from ..capture import planes
from ..stage.bounds import rendered
from ..stage.settings import prepare
from ..stage.small import parts_of
from ..stage.stage import Stage, free_mark, stage
from ..work import Steps

# What every other pattern is a sum of.
MOMENTS = "moments_uv"
# Lamps of one render: Cycles tells no more light groups of sampled lights apart.
MOST_LAMPS = 200
# Degrees across a lamp of a dome, as its thing sees it.
LAMP_DEGREES = 4.0


@dataclass(frozen=True)
class Lit:
    """A scene in each of some lights, scene-linear.

    light: of each light (N, H, W, 3), or of each patch and monomial (K, 6, H, W, 3); own: the
    scene's own light (H, W, 3); alpha: (H, W).
    """

    light: NDArray[np.float32]
    own: NDArray[np.float32]
    alpha: NDArray[np.float32]


def heading(scene: bpy.types.Scene) -> tuple[tuple[float, ...], ...]:
    """The rotation about the vertical that turns the hemicube's frame to where the camera looks."""
    camera = camera_of(scene)
    if camera is None:
        raise SceneError("the scene has no camera: add one, to photograph with")
    look = -camera.matrix_world.col[2].to_3d()
    angle = math.atan2(-look.x, look.y) if math.hypot(look.x, look.y) > 1e-4 else 0.0
    c, s = math.cos(angle), math.sin(angle)
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


def by_monitors(
    scene: bpy.types.Scene,
    view_layer: str,
    monitors: Monitors,
    distance: float,
    samples: int,
    falls: float = 0.0,
) -> Steps[Lit]:
    """Render the scene in the light of each patch of monitors, under each monomial.

    distance: of the cube's sides from the middle of the scene, in radii of the scene; 0 for
    monitors at infinity. falls: the power of the cosine by which their light falls off; the
    pictures that they show make up for it as the middle of the scene sees them. Raises SceneError,
    CancelledError.
    """
    turned = heading(scene)
    with stage(scene, view_layer) as on:
        centre, radius = rendered(on).bounds()
        size = (distance or planes.FAR) * radius
        cube = replace(hemicube_of(monitors), orientation=turned, centre=centre, size=size)
        patterns = pattern_set(MOMENTS)
        prepare(on, layers=len(patterns))
        on.change("cycles.samples", samples)
        images = [(k, name) for k in range(len(cube)) for name in patterns.patterns]
        with planes.lit(on, cube, patterns, images, radiance=planes.FAINT):
            if falls:
                _fall_off(on, cube, falls)
            parts = yield from parts_of(on, f"photographing {len(cube)} patches")
        whole = combined(parts)
        light = np.empty((len(cube), len(MONOMIALS), *whole.shape[:2], 3), np.float32)
        numbers = {name: p for p, name in enumerate(patterns.patterns)}
        found = 0
        for name in list(parts):
            if match := GROUP.search(name):
                light[int(match[1]), numbers[match[2]]] = parts.pop(name)[..., :3]
                found += 1
        if found < len(images):
            raise SceneError("Blender did not write all patches: make room for temporary files")
        own = np.maximum(whole[..., :3] - light.sum(axis=(0, 1), dtype=np.float64), 0)
        # what is left of a sum is rounding
        own[own < 1e-5 * whole[..., :3]] = 0
        return Lit(light / np.float32(planes.FAINT), own.astype(np.float32), whole[..., 3])


def _fall_off(on: Stage, cube: Hemicube, falls: float) -> None:
    """Make the planes darker from the side than they are as the middle of the scene sees them."""
    done = set()
    for thing in on.scene.objects:
        if not thing.lightgroup or thing.type != "MESH" or not thing.data.materials:
            continue
        material = thing.data.materials[0]
        if material is None or not GROUP.search(f"Combined_{thing.lightgroup}"):
            continue
        if material.name in done:
            continue
        done.add(material.name)
        nodes = Nodes(material.node_tree)
        emission = next(n for n in nodes.tree.nodes if n.bl_idname == "ShaderNodeEmission")
        strength = emission.inputs["Strength"]
        before = strength.links[0].from_socket if strength.is_linked else strength.default_value
        shape = nodes.tree.nodes.new("ShaderNodeNewGeometry").outputs
        to_middle = nodes.add(
            "ShaderNodeVectorMath", tuple(cube.centre), shape["Position"], operation="SUBTRACT"
        )
        straight = nodes.add("ShaderNodeVectorMath", to_middle.outputs[0], operation="NORMALIZE")
        cosines = []
        for direction in (shape["Incoming"], straight.outputs[0]):
            dot = nodes.add(
                "ShaderNodeVectorMath", direction, shape["True Normal"], operation="DOT_PRODUCT"
            )
            cosines.append(nodes.math("ABSOLUTE", dot.outputs["Value"]))
        ratio = nodes.math("DIVIDE", *cosines)
        darker = nodes.math("MULTIPLY", before, nodes.math("POWER", ratio, falls))
        nodes.tree.links.new(darker, strength)


def by_lamps(
    scene: bpy.types.Scene, view_layer: str, directions: NDArray, samples: int
) -> Steps[Lit]:
    """Render the scene in the light of each lamp of a dome, of an irradiance of 1 across its beam.

    directions: (N, 3) in the hemicube's frame. Raises SceneError, CancelledError.
    """
    if len(directions) > MOST_LAMPS:
        raise SceneError(f"{len(directions)} lamps: a dome has at most {MOST_LAMPS} here")
    turned = np.array(heading(scene))
    with stage(scene, view_layer) as on:
        rendered(on).bounds()
        prepare(on, layers=1)
        on.change("cycles.samples", samples)
        on.change("cycles.use_light_tree", False)
        with _dome(on, directions @ turned.T) as mark:
            parts = yield from parts_of(on, f"photographing {len(directions)} lamps")
        whole = combined(parts)
        light = np.empty((len(directions), *whole.shape[:2], 3), np.float32)
        for name, pixels in parts.items():
            _, found, number = name.rpartition(f"Combined_{mark}lamp_")
            if found:
                light[int(number)] = pixels[..., :3]
        own = np.maximum(whole[..., :3] - light.sum(axis=0, dtype=np.float64), 0)
        own[own < 1e-5 * whole[..., :3]] = 0
        return Lit(light, own.astype(np.float32), whole[..., 3])


@contextmanager
def _dome(on: Stage, directions: NDArray) -> Iterator[str]:
    """Put lamps around the stage -> how the names of their light groups begin."""
    made: list[bpy.types.ID] = []
    mark, layer = free_mark(), on.scene.view_layers[0]
    try:
        for number, direction in enumerate(directions):
            lamp = on.made(bpy.data.lights.new("ARTO Lamp", "SUN"))
            lamp.energy, lamp.angle = 1.0, math.radians(LAMP_DEGREES)
            thing = on.made(bpy.data.objects.new("ARTO Lamp", lamp))
            made += [lamp, thing]
            thing.matrix_world = Vector(direction).to_track_quat("Z", "Y").to_matrix().to_4x4()
            thing.lightgroup = f"{mark}lamp_{number:03d}"
            on.scene.collection.objects.link(thing)
            layer.lightgroups.add(name=thing.lightgroup)
        yield mark
    finally:
        while layer.lightgroups:
            layer.lightgroups.remove(layer.lightgroups[0])
        on.remove(made)
