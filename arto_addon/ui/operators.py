"""The operators: hemicube, capture, fit, relight, and those that keep a shot's files."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import textwrap
from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...core import marked
from ...core.capture.head import HEADER as CAPTURE_HEADER
from ...core.errors import ArtoError, SceneError
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.files import Lock
from ..blender.markers import camera_of
from ..capture import planes
from ..capture.capture import capture
from ..capture.planned import guess
from ..capture.sequence import capture_frames, frame_kept
from ..fit.fit import fit
from ..job import session
from ..plate.names import relit_file
from ..relight.back import mix_to_scene
from ..relight.many import frames_of, relight_frames
from ..relight.relight import relight
from ..shot import paths, watch
from ..shot.adopting import adopt, adopt_from
from ..shot.shot import layer_of
from ..stage.bounds import scene_bounds
from ..stage.stage import stage
from ..work import Steps
from ..world.check import check_world, world_of
from .before import before_capture, check_capture
from .long_work import LongWork


def free(cls: type) -> bool:
    """Whether no work of ARTO runs. A greyed button says what it waits for."""
    if text := session.busy():
        cls.poll_message_set(text)
    return not text


class Quick(bpy.types.Operator):
    """An operator that ends at once: `work` returns its report, a typed error becomes one."""

    def work(self, context: bpy.types.Context) -> str:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.dismiss()  # a guest makes way for whatever is pressed
        try:
            self.report({"INFO"}, self.work(context))
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}


class Removes(Quick):
    """An operator that removes files of a shot: the artist is asked first."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)


class ARTO_OT_build_hemicube(Quick):
    """Build the hemicube of light patches around the scene, to look at. It is not rendered; \
capturing uses its geometry"""

    bl_idname = "arto.build_hemicube"
    bl_label = "Build Hemicube"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if bpy.app.is_job_running("RENDER"):
            cls.poll_message_set("Blender is rendering: wait until it is done")
            return False
        return free(cls)

    def work(self, context: bpy.types.Context) -> str:
        scene = context.scene
        with stage(scene, context.view_layer.name) as on:
            centre, radius = scene_bounds(on)
        hemicube = planes.wanted(scene, centre, radius)
        planes.build_for_artist(scene, hemicube, radius)
        if not bpy.app.background:
            context.window_manager.arto.overlay = True
        return (
            f"{len(hemicube)} patches at {hemicube.size:.4g} around a scene of radius "
            f"{radius:.4g}: parallax {hemicube.parallax_degrees(radius):.2g} degrees"
        )


class ARTO_OT_remove_hemicube(Quick):
    """Remove the hemicube from the scene"""

    bl_idname = "arto.remove_hemicube"
    bl_label = "Remove Hemicube"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if planes.of_artist(context.scene) is None:
            cls.poll_message_set("There is no hemicube in this scene")
            return False
        return free(cls)

    def work(self, context: bpy.types.Context) -> str:
        planes.remove_for_artist(context.scene)
        return "removed the hemicube"


def can_capture(cls: type, context: bpy.types.Context) -> bool:
    if context.scene.arto.photographs:
        cls.poll_message_set("This scene is of photographs: Read Again reads them")
        return False
    if context.scene.render.engine != "CYCLES":
        cls.poll_message_set("ARTO captures with Cycles: choose it as the render engine")
        return False
    if camera_of(context.scene) is None:
        cls.poll_message_set("The scene has no camera")
        return False
    return free(cls)


class ARTO_OT_capture(LongWork):
    """Render how the scene answers light from every patch, with Cycles"""

    bl_idname = "arto.capture"
    bl_label = "Capture"
    verb = "capture"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_capture(cls, context)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: object) -> str:
        text = "Render how the scene answers light from every patch, with Cycles"
        return f"{text}. It takes {guess(context.scene)}"

    def check(self, scene: bpy.types.Scene) -> None:
        check_capture(scene)

    def question(self, scene: bpy.types.Scene) -> str:
        return before_capture(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return capture(scene, view_layer)


class ARTO_OT_fit(LongWork):
    """Fit the captured images as a reflectance field"""

    bl_idname = "arto.fit"
    bl_label = "Fit"
    verb = "fit"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and there(
            cls, context, "capture", CAPTURE_HEADER, "Capture the scene first"
        )

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return fit(scene, view_layer)


class ARTO_OT_relight(LongWork):
    """Show the captured scene in the light of its world, as an image in the compositor"""

    bl_idname = "arto.relight"
    bl_label = "Relight"
    verb = "relight"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and can_relight(cls, context)

    def check(self, scene: bpy.types.Scene) -> None:
        check_world(scene)
        relit_file(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return relight(scene, view_layer)


class ARTO_OT_capture_frames(LongWork):
    """Capture every frame that the scene renders, a field for each, by the same patches"""

    bl_idname = "arto.capture_frames"
    bl_label = "Capture Frames"
    verb = "capture_frames"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_capture(cls, context)

    def check(self, scene: bpy.types.Scene) -> None:
        check_capture(scene)

    def question(self, scene: bpy.types.Scene) -> str:
        return before_capture(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return capture_frames(scene, view_layer, frames_of(scene))


class ARTO_OT_relight_frames(LongWork):
    """Relight every frame that the scene renders, as a sequence in the compositor: of a shot \
whose frames were captured, or of an animated world over a still"""

    bl_idname = "arto.relight_frames"
    bl_label = "Relight Frames"
    verb = "relight_frames"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if world_of(context.scene) is None:
            cls.poll_message_set("The scene has no world to relight with: add one with an HDRI")
            return False
        return free(cls)

    def check(self, scene: bpy.types.Scene) -> None:
        check_world(scene)
        relit_file(scene)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return relight_frames(scene, view_layer, frames_of(scene))


def can_relight(cls: type, context: bpy.types.Context) -> bool:
    """Whether there is a world, and a capture to show in its light."""
    if world_of(context.scene) is None:
        cls.poll_message_set("The scene has no world to relight with: add one with an HDRI")
        return False
    return there(cls, context, "field", FIELD_HEADER, "Capture the shot first")


def there(cls: type, context: bpy.types.Context, folder: str, name: str, say: str) -> bool:
    """Whether a file of the shot is on disk; if not, the button says what to do first."""
    scene = context.scene
    try:
        place = paths.place(scene, layer_of(scene), fresh=bpy.app.background)
        there = (place.readable / folder / name).is_file()
    except (ArtoError, OSError) as e:
        there, say = False, str(e)
    if not there:
        cls.poll_message_set(say[0].upper() + say[1:])
    return there


class ARTO_OT_cancel(Quick):
    """End what ARTO is doing; parts of a capture that are finished are kept"""

    bl_idname = "arto.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return session.asked_for() is not None

    def work(self, context: bpy.types.Context) -> str:
        session.cancel()
        return "ARTO is stopping"


class ARTO_OT_read_message(bpy.types.Operator):
    """Read all of this message; it then goes away"""

    bl_idname = "arto.read_message"
    bl_label = "Message"

    text: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def description(cls, context: bpy.types.Context, properties: object) -> str:
        return str(getattr(properties, "text", ""))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        session.forget_outcome()
        watch.redraw()
        return context.window_manager.invoke_popup(self, width=400)

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        for line in textwrap.wrap(self.text, 64):
            column.label(text=line, translate=False)

    def execute(self, context: bpy.types.Context) -> set[str]:
        session.forget_outcome()
        return {"FINISHED"}


class ARTO_OT_adopt(Quick):
    """Work with what was captured for another file or scene; it is kept for that one too"""

    bl_idname = "arto.adopt"
    bl_label = "Use It Here"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls)

    def work(self, context: bpy.types.Context) -> str:
        scene, layer = context.scene, layer_of(context.scene)
        place = paths.place(scene, layer)
        if not place.owner:
            return self._alike(scene, layer)
        folder = adopt(scene, layer, place.source)
        return f"what was captured for {place.owner} is used here too, in {folder}"

    @staticmethod
    def _alike(scene: bpy.types.Scene, layer: str) -> str:
        """Use what was captured of a scene of this name in another file."""
        other = paths.alike(scene, layer)
        if other is None:
            raise SceneError("there is nothing of another file or scene to use here")
        with frame_kept(scene):
            frames = [frame for frame, _ in adopt_from(scene, layer, other)]
        return f"what is in {other} is used here too, of {len(frames)} frames"


def own_place(scene: bpy.types.Scene) -> paths.Place:
    """Where the shot's files are. Raises SceneError where they are another's."""
    place = paths.place(scene, layer_of(scene))
    if place.owner:
        raise SceneError(f"what is there is of {place.owner}")
    return place


def remove_capture(folder: Path, place: paths.Place) -> None:
    """Remove a capture set of a shot. Raises FilesError where ARTO has not made it, SceneError."""
    try:
        marked.remove(folder, "capture", place.folder)
    except OSError as e:
        raise SceneError(f"{folder} cannot be removed ({e})") from e


class ARTO_OT_discard_unfinished(Removes):
    """Remove the captures of this shot that were stopped, with what is finished of them"""

    bl_idname = "arto.discard_unfinished"
    bl_label = "Discard Unfinished"

    def work(self, context: bpy.types.Context) -> str:
        place = own_place(context.scene)
        gone = 0
        with Lock(place.folder, "discarding"):
            for folder in [
                *place.folder.glob("unfinished-*"),
                *place.folder.glob("*/unfinished-*"),
            ]:
                remove_capture(folder, place)
                gone += 1
            paths.remove_draft(place.folder)
        paths.forget()
        return f"removed {gone} unfinished captures" if gone else "there is none unfinished"


class ARTO_OT_mix_to_scene(Quick):
    """Give the scene a world and lamps that render as the mix of layers in its compositor looks"""

    bl_idname = "arto.mix_to_scene"
    bl_label = "Mix to Scene"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls)

    def work(self, context: bpy.types.Context) -> str:
        return f"wrote {mix_to_scene(context.scene)}, and the scene has it as its world"


CLASSES = (
    ARTO_OT_build_hemicube,
    ARTO_OT_remove_hemicube,
    ARTO_OT_capture,
    ARTO_OT_fit,
    ARTO_OT_relight,
    ARTO_OT_capture_frames,
    ARTO_OT_relight_frames,
    ARTO_OT_cancel,
    ARTO_OT_read_message,
    ARTO_OT_adopt,
    ARTO_OT_discard_unfinished,
    ARTO_OT_mix_to_scene,
)
