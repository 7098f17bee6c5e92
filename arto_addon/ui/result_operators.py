"""The operators behind the buttons of the panel Result."""

from __future__ import annotations

import bpy

from ...core import exr
from ...core.errors import SceneError
from ..blender.editors import reveal
from ..plate import compare
from ..plate.composite import save_composite
from ..plate.names import relit_file
from ..plate.plate import name_of, show, shown_file
from ..relight.finished import finish_plate
from ..relight.verify import verify_plate
from ..web.make import check, folder_of, make, page_of
from ..work import Steps
from .long_work import LongWork
from .operators import Quick, free


def _has_plate(cls: type, context: bpy.types.Context) -> bool:
    try:
        path = relit_file(context.scene)
    except SceneError as e:
        cls.poll_message_set(str(e))
        return False
    if not path.is_file():
        cls.poll_message_set("There is no relit picture yet: press Relight")
        return False
    return True


class ARTO_OT_show_plate(Quick):
    """Show the relit picture in an image editor"""

    bl_idname = "arto.show_plate"
    bl_label = "Show"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_plate(cls, context)

    def work(self, context: bpy.types.Context) -> str:
        scene = context.scene
        path = relit_file(scene)
        image = bpy.data.images.get(name_of(scene))
        if image is None:
            image = show(shown_file(path, exr.header(path)), name_of(scene))
        reveal(image)
        return f"shown is {path.name}"


class ARTO_OT_compare(Quick):
    """Show the relit picture beside the last render of Blender's"""

    bl_idname = "arto.compare"
    bl_label = "Compare"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_plate(cls, context)

    def work(self, context: bpy.types.Context) -> str:
        reveal(compare.begin(context.scene))
        return "left is the relit picture, right the render"


class ARTO_OT_verify(LongWork):
    """Render a few samples of the truth in the background, and show where the relit picture \
differs from them by more than their noise"""

    bl_idname = "arto.verify"
    bl_label = "Verify"
    verb = "verify"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.scene.arto.photographs:
            cls.poll_message_set(
                "A photographed thing cannot be rendered. The other lamps predict each lamp: see "
                "held_out.txt in the shot's folder"
            )
            return False
        return free(cls) and _has_plate(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return verify_plate(scene, view_layer)


class ARTO_OT_finish(LongWork):
    """Make the relit picture better and better by samples of a render, in the background, until \
it is stopped"""

    bl_idname = "arto.finish"
    bl_label = "Finish"
    verb = "finish"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and _has_plate(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return finish_plate(scene, view_layer)


class ARTO_OT_save_composite(LongWork):
    """Save what the scene's compositor makes of the relit picture, in the scene's output format, \
without rendering"""

    bl_idname = "arto.save_composite"
    bl_label = "Save Composite"
    verb = "composite"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and _has_plate(cls, context)

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return save_composite(scene, view_layer)


class ARTO_OT_web(LongWork):
    """Make a page for a browser, beside the plate, in which anyone turns the light of the shot: \
the worlds of its looks, or its own"""

    bl_idname = "arto.web"
    bl_label = "Web Page"
    verb = "web"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return free(cls) and _has_plate(cls, context)

    def check(self, scene: bpy.types.Scene) -> None:
        check(folder_of(scene))

    def steps(self, scene: bpy.types.Scene, view_layer: str) -> Steps[object]:
        return make(scene, view_layer, folder_of(scene))


class ARTO_OT_open_page(Quick):
    """Open the page of the shot in the browser"""

    bl_idname = "arto.open_page"
    bl_label = "Open Page"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _has_plate(cls, context):
            return False
        if not page_of(context.scene).is_file():
            cls.poll_message_set("There is no page yet: press Web Page")
            return False
        return True

    def work(self, context: bpy.types.Context) -> str:
        path = page_of(context.scene)
        bpy.ops.wm.url_open(url=path.as_uri())
        return f"opened {path.name}"


CLASSES = (
    ARTO_OT_web,
    ARTO_OT_open_page,
    ARTO_OT_show_plate,
    ARTO_OT_compare,
    ARTO_OT_verify,
    ARTO_OT_finish,
    ARTO_OT_save_composite,
)
