"""Operators that wait for a click into a picture: a pixel of the plate, a place of the HDRI."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.errors import ArtoError
from ..blender.editors import Editor, editors, reveal
from ..blender.pictures import put
from ..job import session
from ..live import live
from ..live.image import IMAGE as LIVE
from ..plate import compare
from ..plate.plate import name_of
from ..relight import inside
from ..shot import status
from ..world import controls
from ..world.check import world_of
from .operators import Quick, can_relight, free


def under(context: bpy.types.Context, event: bpy.types.Event) -> tuple[Editor, float, float] | None:
    """The image editor under the mouse, and where the mouse is in the editor's picture.

    -> (editor, u, v), u and v from the left and the bottom, 0 to 1; None outside.
    """
    for editor in editors():
        area = editor.area
        if editor.window != context.window or editor.image is None:
            continue
        region = next(r for r in area.regions if r.type == "WINDOW")
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if 0 <= x < region.width and 0 <= y < region.height:
            covered = [r for r in area.regions if r.type in {"UI", "TOOLS", "HEADER"}]
            if any(
                r.x <= event.mouse_x < r.x + r.width and r.y <= event.mouse_y < r.y + r.height
                for r in covered
                if r.width > 1
            ):
                return None
            u, v = region.view2d.region_to_view(x, y)
            return editor, u, v
    return None


def show_relit_picture(scene: bpy.types.Scene) -> None:
    """Show the plate, where no picture of the shot is shown that could be clicked into."""
    showing = {e.image.name for e in editors() if e.image}
    if showing & {name_of(scene), LIVE, inside.FROM}:
        return
    if status.has_draft(scene):
        live.start(scene)
    else:
        bpy.ops.arto.show_plate()


def can_look(cls: type, context: bpy.types.Context) -> bool:
    """Whether there is a world, and a field to look at, or a draft, also while it is captured."""
    if world_of(context.scene) is not None and status.has_draft(context.scene):
        return True
    return free(cls) and can_relight(cls, context)


class Picking(Quick):
    """An operator that waits for a click into a picture."""

    hint = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_look(cls, context)

    def begin(self, context: bpy.types.Context) -> None:
        """Show the picture to click into. Raises ArtoError."""

    def picked(self, context: bpy.types.Context, editor: Editor, u: float, v: float) -> str:
        raise NotImplementedError

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        session.dismiss()
        try:
            self.begin(context)
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(f"{self.hint}   (ESC: leave)")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "this is a button for a mouse: it waits for a click")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self._leave(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            # zooming and panning stay possible
            return {"PASS_THROUGH"}
        there = under(context, event)
        if there is None:
            return {"RUNNING_MODAL"}
        self._leave(context)
        try:
            text = self.picked(context, *there)
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        context.window_manager.arto.seen = text
        context.window_manager.arto.seen_in = context.scene.name_full
        self.report({"INFO"}, text.splitlines()[0])
        for area in context.window.screen.areas:
            area.tag_redraw()
        return {"FINISHED"}

    def _leave(self, context: bpy.types.Context) -> None:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)

    def cancel(self, context: bpy.types.Context) -> None:
        self._leave(context)


class ARTO_OT_look_inside(Picking):
    """Click a pixel of the relit picture: shows where its light comes from, on the unfolded \
patches with the HDRI on them"""

    bl_idname = "arto.look_inside"
    bl_label = "Look Inside"
    hint = "Click a pixel of the relit picture"

    def begin(self, context: bpy.types.Context) -> None:
        show_relit_picture(context.scene)

    def picked(self, context: bpy.types.Context, editor: Editor, u: float, v: float) -> str:
        if editor.space.image.name in {inside.IMAGE, compare.IMAGE}:
            bpy.ops.arto.show_plate()
            return "That is no pixel of the relit picture: it is shown now, click again"
        width, height = editor.space.image.size
        x, y = int(np.floor(u * width)), int(np.floor((1 - v) * height))
        found = inside.look(context.scene, x, y)
        editor.show(put(inside.IMAGE, found.picture, display=True))
        return "\n".join(found.lines)


class ARTO_OT_light_from(Picking):
    """Click a place of the HDRI, or of the unfolded patches: the picture shows what the light \
from there gives to it"""

    bl_idname = "arto.light_from"
    bl_label = "Light from Here"
    hint = "Click a place of the HDRI"

    def begin(self, context: bpy.types.Context) -> None:
        scene = context.scene
        world = world_of(scene)
        hdri = controls.hdri(world) if world else None
        showing = {e.image.name for e in editors() if e.image}
        if inside.IMAGE in showing or (hdri and hdri.name in showing):
            return
        layer = inside.layer_of(scene)
        shown = inside.Shown(scene, layer, inside.newest(scene, layer))
        environment = inside.environment_of(scene)
        picture = inside.drawn(shown.field.hemicube, environment, [], inside.SIDE, show=0.0)
        reveal(put(inside.IMAGE, picture, display=True))

    def picked(self, context: bpy.types.Context, editor: Editor, u: float, v: float) -> str:
        direction = inside.direction_at(context.scene, editor.space.image.name, u, v)
        if direction is None:
            return "That is beside the patches: click on them"
        picture, text = inside.light_from(context.scene, direction)
        editor.show(put(inside.FROM, picture))
        return text


CLASSES = (ARTO_OT_look_inside, ARTO_OT_light_from)
