"""What the camera sees of the world behind all things, as a capture measures it.

The film of a capture is transparent: the world behind a picture is added to it later, as the camera
sees it, and is as sharp as the world. How much of it is seen in a pixel, by channel, is what the
pass Environment shows of a white world that only the camera sees. A ray of the camera that goes
through clear things stays one, so tints, fog and holdouts are all in it.

A Ray Portal may turn such a ray, and then the world is not seen where the camera looks. So a turned
ray sees the patches, and the world behind is hidden from it. Over a transparent film Cycles shows
nothing there, and neither does a capture.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
from mathutils import Vector

from ...core.capture.names import BEHIND_LIGHT
from ...core.errors import SceneError
from ...core.hemicube import Hemicube
from ..blender.front import set_on_world
from ..blender.markers import camera_of
from ..blender.nodes import Input, Nodes
from ..blender.reached import reached
from ..blender.version import FIVE
from ..stage.bounds import Rendered
from ..stage.stage import Stage


def see_behind(on: Stage) -> None:
    """Have the stage's renders show how much of the world behind is seen, in a pass of its own."""
    world, layer = on.scene.world, on.scene.view_layers[0]
    nodes = Nodes(world.node_tree)
    # the film's exposure is in the pass
    strength = BEHIND_LIGHT / (on.scene.cycles.film_exposure or 1.0)
    shown: Input = strength
    if (through := passes(on)) is not None:
        # A render shows nothing behind more transparent surfaces; a capture lets a path pass more.
        passed = world.node_tree.nodes.new("ShaderNodeLightPath").outputs["Transparent Depth"]
        shown = nodes.math("MULTIPLY", nodes.math("LESS_THAN", passed, through + 0.5), strength)
    light = nodes.add("ShaderNodeBackground", (1, 1, 1, 1), shown).outputs[0]
    nodes.add("ShaderNodeOutputWorld", light)
    rays = world.cycles_visibility
    for prop in rays.bl_rna.properties:
        if prop.type == "BOOLEAN" and not prop.is_readonly:
            setattr(rays, prop.identifier, prop.identifier == "camera")
    # it lights nothing, and is no lamp among others
    set_on_world(world, on.scene, sampling_method="NONE")
    layer.use_pass_environment = True


def passes(on: Stage) -> int | None:
    """How many transparent surfaces the artist's render lets a path pass; None if not prepared."""
    found = on.changed.get("cycles.transparent_max_bounces", [None])[0]
    if not isinstance(found, int):
        return None
    # Blender 5 ends a path after the surface at which it counts this many, and so after one at
    # least; 4.5 lets it pass that one
    return max(found, 1) if FIVE else found + 1


def portals_seen(on: Stage, seen: Rendered) -> bool | None:
    """Whether a capture puts what Ray Portals show of the world into the light of the patches.

    None where no material has a Ray Portal that turns rays: through others the world is seen where
    the camera looks. on: a prepared stage. Raises SceneError where the patches are near.
    """
    materials = [bpy.data.materials[name, library or None] for name, library in seen.materials]
    if override := on.scene.view_layers[0].material_override:
        materials = [override]
    if not any(
        node.bl_idname == "ShaderNodeBsdfRayPortal" and node.inputs["Direction"].is_linked
        for material in materials
        for node in reached(material)
    ):
        return None
    # `prepare` notes what the artist's film is
    if "render.film_transparent" not in on.changed:
        return False
    if not on.scene.arto.far:
        raise SceneError(
            "a Ray Portal turns what the camera sees, and shows the world only from far away: turn "
            "Far Away on (Method), or make the film transparent"
        )
    return True


def beyond_clip(scene: bpy.types.Scene, hemicube: Hemicube) -> Hemicube:
    """The hemicube, so far away that the camera's clipping hides it.

    Cycles clips a ray that comes from the camera, and does not clip one that a portal sends on. So
    the camera sees patches behind the clipping by portals alone.
    """
    camera = camera_of(scene)
    if camera is None or not isinstance(camera.data, bpy.types.Camera):
        return hemicube
    away = (camera.matrix_world.translation - Vector(hemicube.centre)).length
    return replace(hemicube, size=max(hemicube.size, 1.1 * (camera.data.clip_end + away)))
