"""The panel *Shot*: which picture, whether it is captured, and one large button."""

from __future__ import annotations

import bpy

from ...core.capture import kinds
from ...core.units import clock
from ..blender.markers import camera_of
from ..job import session
from ..job.session import SecondBlender
from ..job.verbs import Verb
from ..shot import status
from ..stage.settings import looks_otherwise, samples_of
from ..stage.stage import picture_size
from . import state
from .places import Draws, say, shortened
from .words import tr

_ICONS = {
    "blocked": "ERROR",
    "none": "RADIOBUT_OFF",
    "unfinished": "PAUSE",
    "unfitted": "PAUSE",
    "ready": "CHECKMARK",
    "changed": "ERROR",
    "elsewhere": "ERROR",
    "other": "QUESTION",
}


class ShotPanel(Draws):
    """Which picture this is, whether it is captured, and the button that captures it"""

    label = "Shot"

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        scene = context.scene
        width, height = picture_size(scene)
        bound = camera_of(scene)
        camera = bound.name if bound else "no camera"
        text = tr(
            "{camera}, frame {frame}, {width} x {height}",
            camera=camera,
            frame=scene.frame_current,
            width=width,
            height=height,
        )
        say(column, context, text, "CAMERA_DATA")
        found = state.told(scene)
        for i, line in enumerate(found.lines):
            say(column, context, line, _ICONS[found.kind] if i == 0 else "BLANK1")
        if scene.render.use_border and found.kind != "blocked":
            say(column, context, "Only the render region is captured", "INFO")
        if caution := status.caution_line(scene):
            say(column, context, caution[0], "ERROR")
        if found.kind == "elsewhere":
            column.operator("arto.set_back", icon="LOOP_BACK")
        if found.kind == "other":
            column.operator("arto.adopt", icon="CHECKMARK")
        if job := session.current:
            running(column, context, job)
            return
        _buttons(column, context, found)
        ended(column, context, ("capture", "shoot", "fit", "capture_frames"))


def _buttons(column: bpy.types.UILayout, context: bpy.types.Context, found: state.Told) -> None:
    scene = context.scene
    column.separator(factor=0.5)
    row = column.row(align=True)
    row.prop(scene.arto, "quality", text="")
    if scene.arto.quality == kinds.Quality.CUSTOM:
        row.prop(scene.arto, "samples", text="")
    big = column.row(align=True)
    big.scale_y = 1.6
    # the text of the button says what is to be done next
    text = bpy.app.translations.pgettext_iface(found.button, "Operator")
    big.operator("arto.shoot", text=text, icon="RENDER_STILL", translate=False)
    if "done" in " ".join(found.lines):
        big.operator("arto.discard_unfinished", text="", icon="TRASH")
    if found.kind == "blocked":
        return
    for line in state.price(scene, found.button == "Continue"):
        say(column, context, line[0].upper() + line[1:])
    for text in looks_otherwise(scene):
        say(column, context, text, "INFO")


def running(column: bpy.types.UILayout, context: bpy.types.Context, job: SecondBlender) -> None:
    """Draw the progress of a job: a bar, what is being done, and a cross to cancel.

    The bar is as high as the button that it replaces, so that what is below does not jump under the
    mouse.
    """
    column.separator(factor=0.5)
    column.label(text=shortened(context, session.plain(job.state.text)), translate=False)
    row = column.row(align=True)
    row.scale_y = 1.6
    row.progress(factor=job.state.share, text=f"{job.state.share:.0%}")
    row.operator("arto.cancel", text="", icon="X")
    if job.told:
        say(column, context, "Stopping")
    else:
        say(column, context, tr("{spent} spent", spent=clock(job.spent)))
    left = job.state.left
    say(column, context, " " if left is None else tr("{left} left", left=clock(left)))


def ended(column: bpy.types.UILayout, context: bpy.types.Context, verbs: tuple[Verb, ...]) -> None:
    """Draw how the last job ended, if its verb is one of these and it failed or was stopped."""
    found = session.outcome
    if found is None or found.verb not in verbs or found.level == "INFO":
        return
    icon = {"WARNING": "INFO", "ERROR": "CANCEL"}[found.level]
    say(column, context, found.text[0].upper() + found.text[1:], icon)


class Quality(Draws):
    """How good, and how long it takes"""

    label = "Quality"
    closed = True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        from ..blender import denoise

        scene, settings = context.scene, context.scene.arto
        column.prop(settings, "quality", text="Capture")
        if settings.quality == kinds.Quality.CUSTOM:
            column.prop(settings, "samples")
        say(column, context, tr("{samples} samples a pixel", samples=samples_of(scene)))
        sub = column.column()
        sub.enabled = denoise.known() is not False
        sub.prop(settings, "denoise")
        if denoise.known() is False:
            say(column, context, "This Blender was built without Open Image Denoise", "INFO")
        column.prop(settings, "lamps")
        if settings.lamps:
            column.prop(settings, "lamp_samples")
        column.prop(settings, "environment_width")
