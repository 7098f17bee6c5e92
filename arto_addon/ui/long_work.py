"""An operator over long work: in batch here and now, behind a button as a job."""

from __future__ import annotations

import bpy

from ...core.errors import ArtoError
from ..job import session
from ..job.verbs import Verb
from ..shot.shot import layer_of
from ..work import ProgressLines, Steps, run


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
            before = scene.arto.scene_id
            session.start(self.verb, scene, layer)
            if scene.arto.scene_id != before:
                # an undo to before it would lose what is captured by it
                bpy.ops.ed.undo_push(message="ARTO Scene ID")
        except ArtoError as e:
            self.report({"ERROR"}, str(e))
            return {"CANCELLED"}
        return {"FINISHED"}
