"""An operator over long work: in batch here and now, behind a button as a job.

*Run in This Blender* (preferences) is for machines whose memory holds the scene once: the work then
goes by steps in this process, and the window takes no other input until it is over. Nothing an
artist could do meanwhile reaches the data-blocks that it works on, because nothing is let through.
"""

from __future__ import annotations

import time
from contextlib import ExitStack

import bpy

from ...core.errors import ArtoError, CancelledError, SceneError
from ..job import session
from ..job.verbs import Verb
from ..shot.shot import layer_of
from ..work import Progress, ProgressLines, Render, Steps, last_properties_kept, run
from .preferences import run_here

# Steps are taken for this long before the window is drawn again.
SECONDS_A_TICK = 0.1
# Event timer, in seconds.
TICK = 0.05


class LongWork(bpy.types.Operator):
    """See the module. `verb` names the work for a job, `steps` is it."""

    verb: Verb

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        lines = ProgressLines(self.bl_label.lower())
        try:
            run(self.steps(context.scene, layer_of(context.scene)), lines)
        except ArtoError as e:  # cancelled too: whoever waits for the result must not go on
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}

    def check(self, scene: bpy.types.Scene) -> None:
        """Raise an ArtoError for what can be seen at once."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        scene, layer = context.scene, layer_of(context.scene)
        try:
            self.check(scene)
            if run_here(context):
                return self._lock(context, self.steps(scene, layer))
            before = scene.arto.scene_id
            session.start(self.verb, scene, layer)
            if scene.arto.scene_id != before:
                # an undo to before it would lose what is captured by it
                bpy.ops.ed.undo_push(message="ARTO Scene ID")
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}

    # Run in This Blender

    _steps: Steps
    _waiting: Render | None = None
    _last = ""

    def _lock(self, context: bpy.types.Context, steps: Steps) -> set[str]:
        self._steps = steps
        self._lent = ExitStack()
        self._waiting = None
        bpy.app.handlers.render_complete.append(self._on_complete)
        bpy.app.handlers.render_cancel.append(self._on_cancel)
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _ended(self, scene: bpy.types.Scene, state: str) -> None:
        if self._waiting and scene and scene.name == self._waiting.scene:
            self._waiting.state = state

    def _on_complete(self, scene: bpy.types.Scene, *_: object) -> None:
        self._ended(scene, "done")

    def _on_cancel(self, scene: bpy.types.Scene, *_: object) -> None:
        self._ended(scene, "cancelled")

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        # until Blender's operator is gone too: it leaves its properties to the next F12 as it goes
        rendering = bpy.app.is_job_running("RENDER") or any(
            o.bl_idname == "RENDER_OT_render"
            for w in context.window_manager.windows
            for o in w.modal_operators
        )
        if event.type == "ESC" and not rendering:
            return self._quit(context, "WARNING", "cancelled")
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # nothing gets through
        if self._waiting:
            if rendering:
                return {"RUNNING_MODAL"}
            if self._waiting.state == "waiting":
                # it is over and nobody said how
                self._waiting.state = "cancelled"
        self._waiting = None
        self._lent.close()
        until = time.perf_counter() + SECONDS_A_TICK
        try:
            step = next(self._steps)
            while not isinstance(step, Render) and time.perf_counter() < until:
                self._last = step.text
                step = next(self._steps)
            self._show(context, step)
            if isinstance(step, Render):
                self._render(context, step)
        except StopIteration:
            return self._quit(context, "INFO", self._last)
        except CancelledError as e:
            return self._quit(context, "WARNING", str(e))
        except ArtoError as e:
            return self._quit(context, "ERROR", str(e))
        except BaseException:
            self._quit(context, "ERROR", f"{self.bl_label} failed: see the console")
            raise
        return {"RUNNING_MODAL"}

    def _render(self, context: bpy.types.Context, step: Render) -> None:
        """Start a render as Blender's own job. Raises SceneError where Blender does not."""
        view = context.preferences.view
        display, dirty = view.render_display_type, context.preferences.is_dirty
        try:
            # for the moment in which Blender opens its window: none for each tile
            view.render_display_type = "NONE"
            self._lent.enter_context(last_properties_kept())
            begun = bpy.ops.render.render("INVOKE_DEFAULT", write_still=True, scene=step.scene)
        finally:
            view.render_display_type = display
            context.preferences.is_dirty = dirty
        if "RUNNING_MODAL" not in begun:
            raise SceneError("Blender did not start the render: wait until it has ended its own")
        self._waiting = step

    def _show(self, context: bpy.types.Context, step: Progress | Render) -> None:
        self._last = step.text
        context.window_manager.progress_update(int(step.share * 100))
        context.workspace.status_text_set(
            f"ARTO {self.bl_label}: {step.share:.0%} {step.text}   (ESC: cancel)"
        )

    def _quit(self, context: bpy.types.Context, level: str, text: str) -> set[str]:
        """The only way out."""
        self._steps.close()
        self._lent.close()
        bpy.app.handlers.render_complete.remove(self._on_complete)
        bpy.app.handlers.render_cancel.remove(self._on_cancel)
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        self.report({level}, text)
        for area in context.screen.areas:
            area.tag_redraw()
        return {"FINISHED"} if level == "INFO" else {"CANCELLED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender takes the operator away: it quits, or opens another file."""
        self._quit(context, "WARNING", "cancelled")
