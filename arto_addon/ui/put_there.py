"""Put It There: a tool by which a light is put where it shines in the picture."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty
from bpy_extras.view3d_utils import location_3d_to_region_2d

from ...core.errors import ArtoError
from ...core.place.place import What
from ..blender.markers import camera_of
from ..blender.words import tr
from ..job import session
from ..live import live
from ..live.image import IMAGE as LIVE
from ..live.placing import Gesture
from ..plate.plate import name_of
from .kit_operators import choose, chosen, world_to_change
from .look_inside import can_look, under

WHATS = (
    ("REFLECT", "Reflect", "The mirror image of the light stands under the cursor"),
    ("LIGHT", "Light", "The place under the cursor faces the light"),
    ("RIM", "Rim", "The light grazes the place under the cursor from behind"),
    ("SHADE", "Shade", "A flag stands between the place under the cursor and its light"),
)
HINT = (
    "Drag: move   Wheel: size   Shift: turn   Ctrl: strength   Enter: keep   ESC, right click: back"
)
# By how much a step of the wheel sizes, degrees a pixel turns, and pixels to a stop.
SIZE, TURN, STOP = 1.1, 0.5, 60.0


def pixel_under(
    context: bpy.types.Context, event: bpy.types.Event, shape: tuple[int, int]
) -> tuple[int, int] | None:
    """The pixel of the shot under the mouse, in an image editor or in a camera's view.

    shape: (height, width) of the shot. None beside the picture.
    """
    there = under(context, event)
    if there is not None:
        editor, u, v = there
        if editor.image is None or editor.image.name not in {LIVE, name_of(context.scene)}:
            return None
    else:
        found = _in_camera_view(context, event)
        if found is None:
            return None
        u, v = found
    height, width = shape
    x, y = int(u * width // 1), int((1 - v) * height // 1)
    return (x, y) if 0 <= x < width and 0 <= y < height else None


def _in_camera_view(
    context: bpy.types.Context, event: bpy.types.Event
) -> tuple[float, float] | None:
    """Where the mouse is in a camera's frame in a 3D viewport, from the left and the bottom."""
    scene = context.scene
    for area in context.window.screen.areas:
        if area.type != "VIEW_3D":
            continue
        view = area.spaces.active.region_3d
        region = next(r for r in area.regions if r.type == "WINDOW")
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        camera = area.spaces.active.camera if area.spaces.active.use_local_camera else None
        camera = camera or camera_of(scene)
        inside = 0 <= x < region.width and 0 <= y < region.height
        if not inside or view.view_perspective != "CAMERA" or camera != camera_of(scene):
            continue
        assert camera is not None
        corners = [camera.matrix_world @ c for c in camera.data.view_frame(scene=scene)]
        seen = [location_3d_to_region_2d(region, view, corner) for corner in corners]
        if any(corner is None for corner in seen):
            return None
        low = [min(corner[i] for corner in seen) for i in (0, 1)]
        high = [max(corner[i] for corner in seen) for i in (0, 1)]
        return (x - low[0]) / (high[0] - low[0]), (y - low[1]) / (high[1] - low[1])
    return None


class ARTO_OT_put_there(bpy.types.Operator):
    """Put a light where it shines: click into the live picture or the plate, or into the camera's \
view. Drag moves it, the wheel sizes it, Shift turns it, Ctrl changes its strength"""

    bl_idname = "arto.put_there"
    bl_label = "Put It There"
    bl_options = {"REGISTER", "UNDO"}

    what: EnumProperty(name="What", items=WHATS)
    chosen: BoolProperty(
        name="Chosen Light",
        description="Move the light that is chosen in the list, in place of a new one",
        default=False,
    )

    _gesture: Gesture | None = None
    _pressed = False
    _at = (0, 0)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_look(cls, context)

    def execute(self, _context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "this is a button for a mouse: it waits for a click")
        return {"CANCELLED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        session.dismiss()
        scene = context.scene
        try:
            node = chosen(world_to_change(scene)) if self.chosen else None
            self._gesture = Gesture(scene, What(self.what), node.label if node else "")
            if live.current is None:
                live.start(scene)
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        self._pressed, self._at = False, (event.mouse_x, event.mouse_y)
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(tr(HINT))
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        gesture = self._gesture
        assert gesture is not None
        try:
            return self._step(context, event, gesture)
        except ArtoError as e:
            # a place without light is no reason to end: the artist goes on to the next
            context.workspace.status_text_set(str(e))
            return {"RUNNING_MODAL"}

    def _step(
        self, context: bpy.types.Context, event: bpy.types.Event, gesture: Gesture
    ) -> set[str]:
        kind, begins = event.type, event.value == "PRESS"
        if kind in {"ESC", "RIGHTMOUSE"} and begins:
            gesture.back()
            self._leave(context)
            return {"CANCELLED"}
        if kind in {"RET", "NUMPAD_ENTER", "SPACE"} and begins:
            self._leave(context)
            return {"FINISHED"} if gesture.light else {"CANCELLED"}
        if kind in {"WHEELUPMOUSE", "WHEELDOWNMOUSE"} and begins and gesture.light:
            gesture.change(size=SIZE if kind == "WHEELUPMOUSE" else 1 / SIZE)
            return {"RUNNING_MODAL"}
        if kind == "LEFTMOUSE":
            place = pixel_under(context, event, gesture.placer.shape)
            if begins and place is None:
                # a button beside the picture: what was put stays, and the button is pressed
                self._leave(context)
                return {"FINISHED", "PASS_THROUGH"} if gesture.light else {"CANCELLED"}
            self._pressed = begins
            self._at = (event.mouse_x, event.mouse_y)
            if begins and place is not None and not (event.shift or event.ctrl):
                gesture.move(*place)
                choose(world_to_change(context.scene), gesture.light)
            return {"RUNNING_MODAL"}
        if kind == "MOUSEMOVE" and self._pressed:
            self._drag(context, event, gesture)
            return {"RUNNING_MODAL"}
        # zooming and panning stay possible
        return {"PASS_THROUGH"}

    def _drag(self, context: bpy.types.Context, event: bpy.types.Event, gesture: Gesture) -> None:
        across, up = event.mouse_x - self._at[0], event.mouse_y - self._at[1]
        self._at = (event.mouse_x, event.mouse_y)
        if event.shift:
            gesture.change(roll=TURN * across)
        elif event.ctrl:
            gesture.change(stops=up / STOP)
        else:
            place = pixel_under(context, event, gesture.placer.shape)
            if place is not None:
                gesture.move(*place)

    def _leave(self, context: bpy.types.Context) -> None:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        if self._gesture is not None:
            self._gesture.close()
        self._gesture = None

    def cancel(self, context: bpy.types.Context) -> None:
        self._leave(context)


CLASSES = (ARTO_OT_put_there,)
