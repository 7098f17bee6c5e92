"""The operators: build and remove the hemicube, capture, fit, relight."""

from __future__ import annotations

import time

import bpy

from ...core.errors import ArtoError, CancelledError
from ..capture import planes
from ..capture.capture import capture
from ..fit import fit
from ..relight.relight import relight
from ..shot import paths
from ..stage.bounds import scene_bounds
from ..stage.stage import stage
from ..work import Progress, ProgressLines, Render, Steps, run

# Steps are taken for this long before the window is drawn again.
SECONDS_A_TICK = 0.1


class _Quick(bpy.types.Operator):
    """An operator that ends at once; typed errors become reports."""

    def work(self, context: bpy.types.Context) -> str:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self.report({"INFO"}, self.work(context))
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}


class ARTO_OT_build_hemicube(_Quick):
    """Build the hemicube of light patches around the scene, to look at. It is not rendered; \
capturing uses its geometry"""

    bl_idname = "arto.build_hemicube"
    bl_label = "Build Hemicube"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context: bpy.types.Context) -> str:
        scene = context.scene
        with stage(scene, context.view_layer.name) as on:
            centre, radius = scene_bounds(on)
        hemicube = planes.wanted(scene, centre, radius)
        planes.build_for_artist(scene, hemicube, radius)
        return (
            f"{len(hemicube)} patches at {hemicube.size:.4g} around a scene of radius "
            f"{radius:.4g}: parallax {hemicube.parallax_degrees(radius):.2g} degrees"
        )


class ARTO_OT_remove_hemicube(_Quick):
    """Remove the hemicube from the scene"""

    bl_idname = "arto.remove_hemicube"
    bl_label = "Remove Hemicube"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if planes.of_artist(context.scene) is None:
            cls.poll_message_set("There is no hemicube in this scene")
            return False
        return True

    def work(self, context: bpy.types.Context) -> str:
        planes.remove_for_artist(context.scene)
        return "removed the hemicube"


class _Work(bpy.types.Operator):
    """An operator over long work: blocking from Python and in batch, by steps behind a button."""

    _timer = None
    _steps: Steps | None = None
    _waiting: Render | None = None
    _display = ""

    def steps(self, context: bpy.types.Context) -> Steps:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        lines = ProgressLines(self.bl_label.lower())
        try:
            run(self.steps(context), lines)
        except CancelledError as e:
            # from Python that is an error too: whoever waits for the result must not go on
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        self._steps = self.steps(context)
        self._waiting = None
        view = context.preferences.view
        # no window of its own for each tile
        self._display, view.render_display_type = view.render_display_type, "NONE"
        bpy.app.handlers.render_complete.append(self._on_complete)
        bpy.app.handlers.render_cancel.append(self._on_cancel)
        self._timer = context.window_manager.event_timer_add(0.05, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _on_complete(self, *_: object) -> None:
        if self._waiting:
            self._waiting.state = "done"

    def _on_cancel(self, *_: object) -> None:
        if self._waiting:
            self._waiting.state = "cancelled"

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and not bpy.app.is_job_running("RENDER"):
            return self._quit(context, "WARNING", "cancelled")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._waiting and (self._waiting.state == "waiting" or bpy.app.is_job_running("RENDER")):
            return {"PASS_THROUGH"}
        self._waiting = None
        until = time.perf_counter() + SECONDS_A_TICK
        try:
            step = next(self._steps)
            while not isinstance(step, Render) and time.perf_counter() < until:
                self._last = step.text
                step = next(self._steps)
        except StopIteration:
            return self._quit(context, "INFO", self._last)
        except CancelledError as e:
            return self._quit(context, "WARNING", str(e))
        except ArtoError as e:
            return self._quit(context, "ERROR", str(e))
        except BaseException:
            self._quit(context, "ERROR", f"{self.bl_label} failed: see the console")
            raise
        self._show(context, step)
        if isinstance(step, Render):
            self._waiting = step
            bpy.ops.render.render("INVOKE_DEFAULT", write_still=True, scene=step.scene)
        return {"RUNNING_MODAL"}

    _last = ""

    def _show(self, context: bpy.types.Context, step: Progress | Render) -> None:
        self._last = step.text
        context.window_manager.progress_update(int(step.share * 100))
        context.workspace.status_text_set(
            f"ARTO {self.bl_label}: {step.share:.0%} {step.text}   (ESC: cancel)"
        )

    def _quit(self, context: bpy.types.Context, level: str, text: str) -> set[str]:
        """The only way out of the modal work."""
        self._steps.close()
        bpy.app.handlers.render_complete.remove(self._on_complete)
        bpy.app.handlers.render_cancel.remove(self._on_cancel)
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        context.preferences.view.render_display_type = self._display
        self.report({level}, text)
        for area in context.screen.areas:
            area.tag_redraw()
        return {"FINISHED"} if level == "INFO" else {"CANCELLED"}


class ARTO_OT_capture(_Work):
    """Render how the scene answers light from every patch, with Cycles"""

    bl_idname = "arto.capture"
    bl_label = "Capture"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.render.engine != "CYCLES":
            cls.poll_message_set("ARTO captures with Cycles: choose it as the render engine")
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera")
            return False
        return True

    def steps(self, context: bpy.types.Context) -> Steps:
        return capture(context.scene, context.view_layer.name)


class ARTO_OT_fit(_Work):
    """Fit the captured images as a reflectance field"""

    bl_idname = "arto.fit"
    bl_label = "Fit"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _there(cls, context, paths.capture_folder, "capture.json", "Capture the scene first")

    def steps(self, context: bpy.types.Context) -> Steps:
        return fit(context.scene)


class ARTO_OT_relight(_Work):
    """Show the captured scene in the light of its world, as an image in the compositor"""

    bl_idname = "arto.relight"
    bl_label = "Relight"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.world is None:
            cls.poll_message_set("The scene has no world to relight with: add one with an HDRI")
            return False
        return _there(cls, context, paths.field_folder, "field.json", "Fit the capture first")

    def steps(self, context: bpy.types.Context) -> Steps:
        return relight(context.scene)


def _there(cls: type, context: bpy.types.Context, folder: object, name: str, say: str) -> bool:
    """Whether a file of the scene's is on disk; else say what to do first."""
    try:
        there = (folder(context.scene) / name).is_file()
    except ArtoError as e:
        there, say = False, str(e)
    if not there:
        cls.poll_message_set(say[0].upper() + say[1:])
    return there


CLASSES = (
    ARTO_OT_build_hemicube,
    ARTO_OT_remove_hemicube,
    ARTO_OT_capture,
    ARTO_OT_fit,
    ARTO_OT_relight,
)
