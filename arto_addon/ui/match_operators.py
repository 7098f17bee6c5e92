"""The operators of a match: look for the light of a picture, make a region even, ask a region."""

from __future__ import annotations

import bpy
import numpy as np

from ..blender.editors import Editor, editors, reveal
from ..match import apply, region
from ..match.asked import paint_over, what
from ..match.found import match_file
from ..plate.names import relit_file
from ..work import Steps
from .long_work import LongWork
from .look_inside import Picking, show_relit_picture
from .operators import Quick, can_relight, free


class ARTO_OT_match(LongWork):
    """Find the light in which the shot looks like the target. The light becomes a look, beside \
the light as it is now"""

    bl_idname = "arto.match"
    bl_label = "Match"
    verb = "match"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not what(context.scene):
            cls.poll_message_set("Choose a target: a file, or an image of this .blend")
            return False
        return free(cls) and can_relight(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return apply.match_and_apply(scene, view_layer)


class ARTO_OT_even_out(LongWork):
    """Find light that makes the region of the mask even, as bright as it is now, as a look"""

    bl_idname = "arto.even_out"
    bl_label = "Even Out"
    verb = "even_out"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.arto.match_mask is None:
            cls.poll_message_set("Choose a mask that is white in the region")
            return False
        return free(cls) and can_relight(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return apply.even_out_and_apply(scene, view_layer)


class ARTO_OT_paint_over(Quick):
    """Make the target a copy of the relit picture, to paint on: lighter, darker, warmer, cooler. \
Match then finds the light of it"""

    bl_idname = "arto.paint_over"
    bl_label = "Paint Over"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and can_relight(cls, context)

    def work(self, context: bpy.types.Context) -> str:
        image = paint_over(context.scene)
        reveal(image)
        for editor in editors():
            if editor.image == image:
                editor.space.mode = "PAINT"
        return "paint on the picture, then press Match"


class ARTO_OT_where_from(Picking):
    """Click a place of the relit picture: says which lights light it, and from where"""

    bl_idname = "arto.where_from"
    bl_label = "Where From"
    hint = "Click a place of the relit picture"

    def begin(self, context: bpy.types.Context) -> None:
        show_relit_picture(context.scene)

    def picked(self, context: bpy.types.Context, editor: Editor, u: float, v: float) -> str:
        width, height = editor.space.image.size
        at = int(np.floor(u * width)), int(np.floor((1 - v) * height))
        return "\n".join(region.where_from(context.scene, at).lines)


class ARTO_OT_show_missing(Quick):
    """Show what no light makes: brighter than grey where the target has more light, darker where \
it has less"""

    bl_idname = "arto.show_missing"
    bl_label = "What No Light Makes"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls)

    def work(self, context: bpy.types.Context) -> str:
        image = apply.show_missing(match_file(relit_file(context.scene)))
        reveal(image)
        return "grey is where the light makes all of the target"


CLASSES = (
    ARTO_OT_match,
    ARTO_OT_even_out,
    ARTO_OT_paint_over,
    ARTO_OT_where_from,
    ARTO_OT_show_missing,
)
