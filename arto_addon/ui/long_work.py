"""The base of operators that do long work: at once in a script, as a job behind a button."""

from __future__ import annotations

import bpy

from ...core.errors import ArtoError
from ..blender.words import tr
from ..job import session
from ..job.verbs import Verb
from ..shot.shot import layer_of
from ..work import ProgressLines, Steps, run
from ..world import shelf


class LongWork(bpy.types.Operator):
    """An operator that does long work: `steps` is the work, `verb` its name for a job."""

    verb: Verb
    # Whether the artist was asked `question`: the operator runs again after a yes.
    asked = False

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.asked:
            return self.start(context)  # the artist has answered
        lines = ProgressLines(self.bl_label.lower())
        try:
            run(self.steps(context.scene, layer_of(context.scene)), lines)
        except (
            ArtoError
        ) as e:  # also where it was cancelled: a script must not go on without the result
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}

    def check(self, scene: bpy.types.Scene) -> None:
        """Raise an ArtoError for mistakes that can be found before a job starts."""

    def question(self, scene: bpy.types.Scene) -> str:
        """What to ask the artist before a job starts; empty for nothing."""
        return ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        if asked := self.question(context.scene):
            self.asked = True
            return context.window_manager.invoke_confirm(
                self, event, title=tr(self.bl_label), message=asked, icon="WARNING"
            )
        return self.start(context)

    def start(self, context: bpy.types.Context) -> set[str]:
        """Start the job."""
        scene, layer = context.scene, layer_of(context.scene)
        try:
            self.check(scene)
            before = scene.arto.scene_id
            session.start(self.verb, scene, layer)
            shelf.note_shown(scene)
            if scene.arto.scene_id != before:
                # an undo step with the new ID: undoing past it would lose the capture made under it
                bpy.ops.ed.undo_push(message="ARTO Scene ID")
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}
