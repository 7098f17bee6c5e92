"""The operators behind the panels Shot and Light: capture, set back, delete, looks, HDRI."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import os
from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...core.capture.head import HEADER
from ...core.errors import ArtoError, SceneError
from ...core.files import Lock
from ..capture.check import check_scene
from ..capture.more import can_have_more, more_samples
from ..relight import looks
from ..relight.looks import show_looks
from ..sheet.make import check as check_sheet
from ..sheet.make import make as make_sheet
from ..sheet.make import sheet_of
from ..shoot import shoot_and_show
from ..shot import paths, status
from ..shot.shot import layer_of
from ..stage.settings import samples_of
from ..stage.stage import picture_size
from ..stage.takes import TAKES, WHOLE
from ..work import Steps
from ..world import hdris
from . import state
from .before import before_capture, check_capture
from .long_work import LongWork
from .operators import Quick, Removes, can_capture, can_relight, free, own_place, remove_capture
from .strip import light_with


class ARTO_OT_shoot(LongWork):
    """Capture how the shot answers light from every direction, and show it in its light"""

    bl_idname = "arto.shoot"
    bl_label = "Capture"
    verb = "shoot"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        found = state.told(context.scene)
        if found.kind == "blocked":
            cls.poll_message_set(" ".join(found.lines))
            return False
        return can_capture(cls, context)

    def check(self, scene: bpy.types.Scene) -> None:
        check_capture(scene)

    def question(self, scene: bpy.types.Scene) -> str:
        return before_capture(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return shoot_and_show(scene, view_layer)


class ARTO_OT_more_samples(LongWork):
    """Add as many samples as are set to the capture that is there, in place of a new one"""

    bl_idname = "arto.more_samples"
    bl_label = "More Samples"
    verb = "more_samples"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not can_capture(cls, context):
            return False
        try:
            _can_have_more(context.scene)
        except ArtoError as e:
            cls.poll_message_set(f"{e}"[:1].upper() + f"{e}"[1:])
            return False
        return True

    def check(self, scene: bpy.types.Scene) -> None:
        check_scene(scene)
        _can_have_more(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return more_samples(scene, view_layer, samples_of(scene))


def _can_have_more(scene: bpy.types.Scene) -> None:
    """Raise an ArtoError where no samples can be added to the scene's capture."""
    place = paths.place(scene, layer_of(scene), fresh=bpy.app.background)
    there = status.capture_at(place.readable / "capture" / HEADER)
    if there is None:
        raise SceneError("capture the shot first")
    can_have_more(there)


class ARTO_OT_set_back(Quick):
    """Set camera, frame and size back to those of what was captured"""

    bl_idname = "arto.set_back"
    bl_label = "Set Back"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context: bpy.types.Context) -> str:
        scene = context.scene
        then = state.captured_shot(scene)
        if then is None:
            raise SceneError("nothing of this scene was captured yet")
        camera = scene.objects.get(then.camera or "")
        if camera is None:
            raise SceneError(f"the camera '{then.camera}' is not in the scene any more")
        scene.camera = camera
        scene.frame_set(then.frame, subframe=then.subframe or 0.0)
        render = scene.render
        if picture_size(scene) != (then.width, then.height):
            render.resolution_percentage = 100
            render.resolution_x, render.resolution_y = then.width, then.height
        left = then.difference(state.shot_of(scene, layer_of(scene)))
        if left:
            return f"set back to {then.title}; what is left is {left}"
        return f"set back to {then.title}"


class ARTO_OT_delete_capture(Removes):
    """Delete the rendered images of this capture; what relighting reads stays"""

    bl_idname = "arto.delete_capture"
    bl_label = "Delete Capture, Keep Relighting"

    def work(self, context: bpy.types.Context) -> str:
        place = own_place(context.scene)
        if not (place.folder / "field").is_dir():
            raise SceneError("nothing would be left to relight with: fit the capture first")
        with Lock(place.folder, "deleting"):
            for take in (WHOLE, *TAKES):
                folder = place.folder / take / "capture"
                if folder.is_dir():
                    remove_capture(folder, place)
        paths.forget()
        return "deleted the capture; the shot can still be relit"


class ARTO_OT_open_hdri(Quick):
    """Light the scene with an HDRI from a file"""

    bl_idname = "arto.open_hdri"
    bl_label = "Open HDRI"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(
        default=";".join(f"*{end}" for end in hdris.ENDINGS), options={"HIDDEN"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        # without a name here Blender offers the name of the .blend
        self.filepath = hdris.folder(context.scene) + os.sep
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def work(self, context: bpy.types.Context) -> str:
        name = light_with(context.scene, Path(bpy.path.abspath(self.filepath)))
        return f"the world shows {name}"


class ARTO_OT_add_look(Quick):
    """Keep the light as it is now as a look: its world, and a plate of its own. Where a look is \
shown, a copy of it is added, to go on from"""

    bl_idname = "arto.add_look"
    bl_label = "Add Look"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Name", description="What the look is called", default="")

    def work(self, context: bpy.types.Context) -> str:
        return f"added the look '{looks.add(context.scene, self.name).name}'"


class ARTO_OT_remove_look(Quick):
    """Remove the look that is shown; its plate stays on disk"""

    bl_idname = "arto.remove_look"
    bl_label = "Remove Look"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings = context.scene.arto
        if not 0 <= settings.active_look < len(settings.looks):
            cls.poll_message_set("No look is chosen")
            return False
        return True

    def work(self, context: bpy.types.Context) -> str:
        return f"removed the look '{looks.remove(context.scene)}'"


def _can_relight_looks(cls: type, context: bpy.types.Context) -> bool:
    if not context.scene.arto.looks:
        cls.poll_message_set("There are no looks yet: add one")
        return False
    return free(cls) and can_relight(cls, context)


class ARTO_OT_relight_looks(LongWork):
    """Relight the shot in each of its looks: a plate for each"""

    bl_idname = "arto.relight_looks"
    bl_label = "Relight All"
    verb = "relight_looks"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _can_relight_looks(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return show_looks(scene, view_layer)


class ARTO_OT_sheet(LongWork):
    """Put the plates of all looks onto one picture with their names, beside the plate. Plates \
that are missing or out of date are made first"""

    bl_idname = "arto.sheet"
    bl_label = "Sheet"
    verb = "sheet"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _can_relight_looks(cls, context)

    def check(self, scene: bpy.types.Scene) -> None:
        check_sheet(scene, sheet_of(scene))

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return make_sheet(scene, view_layer, sheet_of(scene))


class ARTO_OT_open_guide(Quick):
    """Ten minutes from install to a plate in comp"""

    bl_idname = "arto.open_guide"
    bl_label = "Guide"

    def work(self, context: bpy.types.Context) -> str:
        guide = Path(__file__).resolve().parents[2] / "docs" / "guide.md"
        if not guide.is_file():
            raise SceneError(f"the guide is not where it was installed: {guide}")
        bpy.ops.wm.url_open(url=guide.as_uri())
        return f"the guide is {guide}"


CLASSES = (
    ARTO_OT_shoot,
    ARTO_OT_more_samples,
    ARTO_OT_set_back,
    ARTO_OT_delete_capture,
    ARTO_OT_open_hdri,
    ARTO_OT_add_look,
    ARTO_OT_remove_look,
    ARTO_OT_relight_looks,
    ARTO_OT_sheet,
    ARTO_OT_open_guide,
)
