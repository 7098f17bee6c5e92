"""The operators of photographs: opened as a shot, and read again."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...core.errors import ArtoError, SceneError
from ..job import session
from ..photographs.opening import of_scene, open_scene
from ..photographs.read import read_and_relight
from ..plate.present import present
from ..shot import home
from ..shot.shot import layer_of
from ..work import Steps
from ..world.check import world_of
from .long_work import LongWork
from .operators import free


class ARTO_OT_open_photographs(bpy.types.Operator):
    """Open a folder of photographs, in the light of one lamp or one monitor's patch each, as a \
shot in a scene of its own: they can be shown in any light"""

    bl_idname = "arto.open_photographs"
    bl_label = "Open Photographs"

    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    filter_image: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not home.file():
            cls.poll_message_set("This file was never saved: save it first")
            return False
        return free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.dismiss()
        try:
            if not self.directory:
                raise SceneError("no folder of photographs is chosen")
            folder = Path(bpy.path.abspath(self.directory))
            scene, photos = open_scene(folder, world_of(context.scene))
            if context.window is not None:
                context.window.scene = scene
            if not bpy.app.background:
                session.start("photographs", scene, layer_of(scene))
                bpy.ops.ed.undo_push(message="ARTO Photographs")
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{len(photos.pictures)} photographs are in the scene '{scene.name}'")
        return {"FINISHED"}


class ARTO_OT_read_photographs(LongWork):
    """Read this scene's photographs again, and show the thing in its light"""

    bl_idname = "arto.read_photographs"
    bl_label = "Read Again"
    verb = "photographs"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.arto.photographs:
            cls.poll_message_set("This scene is of no photographs: press Open Photographs")
            return False
        return free(cls)

    def check(self, scene: bpy.types.Scene) -> None:
        of_scene(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return shown(scene, view_layer)


def shown(scene: bpy.types.Scene, view_layer: str) -> Steps[Path | None]:
    """Read photographs, and put the plate into the compositor."""
    path = yield from read_and_relight(scene, view_layer)
    if path is not None:
        present(scene, path)
    return path


CLASSES = (ARTO_OT_open_photographs, ARTO_OT_read_photographs)
