"""The panel *Shot*: which picture, whether it is captured, and one large button."""

from __future__ import annotations

import bpy

from ...core.capture import kinds
from ...core.units import clock
from ..blender.markers import camera_of
from ..blender.words import tr
from ..job import session
from ..job.session import SecondBlender
from ..job.verbs import Verb
from ..job.words import plain
from ..shot import status
from ..stage.settings import looks_otherwise, samples_of
from ..stage.stage import picture_size
from . import state
from .places import Draws, say, sentence, shortened, slot

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
        slot(column, context, text, "CAMERA_DATA", lines=1)
        found = state.told(scene)
        text, icon = " ".join(tr(line) for line in found.lines), _ICONS[found.kind]
        caution = status.caution_line(scene)
        if caution and found.kind == "ready" and len(found.lines) == 1:
            text, icon = f"{text}. {tr(caution[0])}", "ERROR"
        slot(column, context, text, icon)
        if scene.render.use_border and found.kind != "blocked":
            say(column, context, "Only the render region is captured", "INFO")
        if job := session.asked_for():
            running(column, context, job)
        else:
            _buttons(column, context, found)
        if found.kind != "blocked":
            for text in looks_otherwise(scene):
                say(column, context, text, "INFO")


def _of_photographs(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what a scene of photographs has in the place of a capture's buttons."""
    column.separator(factor=0.5)
    big = column.row(align=True)
    big.scale_y = 1.6
    big.operator("arto.read_photographs", icon="FILE_REFRESH")
    big.operator("arto.open_photographs", text="", icon="FILE_FOLDER")
    if not ended(column, context, ("photographs",)):
        slot(column, context, context.scene.arto.photographs)


def _buttons(column: bpy.types.UILayout, context: bpy.types.Context, found: state.Told) -> None:
    scene = context.scene
    if scene.arto.photographs:
        _of_photographs(column, context)
        return
    column.separator(factor=0.5)
    row = column.row(align=True)
    row.prop(scene.arto, "quality", text="")
    if scene.arto.quality == kinds.Quality.CUSTOM:
        row.prop(scene.arto, "samples", text="")
    if found.kind == "ready":  # no line of its own: what is below must not jump
        row.operator("arto.more_samples", text="", icon="ADD")
    big = column.row(align=True)
    big.scale_y = 1.6
    # the text of the button says what is to be done next
    text = bpy.app.translations.pgettext_iface(found.button, "Operator")
    # another button beside it leaves no room for an icon
    beside = {"elsewhere": "arto.set_back", "other": "arto.adopt"}.get(found.kind)
    icon = "NONE" if beside else "RENDER_STILL"
    big.operator("arto.shoot", text=text, icon=icon, translate=False)
    if beside:
        big.operator(beside)
    if found.stopped:
        big.operator("arto.discard_unfinished", text="", icon="TRASH")
    works: tuple[Verb, ...] = ("capture", "shoot", "fit", "capture_frames", "more_samples")
    if not ended(column, context, works):
        lines = state.price(scene, found.goes_on) if found.kind != "blocked" else ()
        slot(column, context, "\n".join(lines))
    column.operator("arto.open_photographs", icon="FILE_FOLDER")


def running(column: bpy.types.UILayout, context: bpy.types.Context, job: SecondBlender) -> None:
    """Draw the progress of a job: a bar, what is being done, and a cross to cancel.

    All is as high as what it takes the place of, so that what is below does not jump under the
    mouse.
    """
    column.separator(factor=0.5)
    text = tr(plain(job.state.text))
    if not job.is_of(context.scene):
        text = f"{job.title}: {text}"
    column.label(text=shortened(context, text), translate=False)
    row = column.row(align=True)
    row.scale_y = 1.6
    row.progress(factor=job.state.share, text=f"{job.state.share:.0%}")
    row.operator("arto.cancel", text="", icon="X")
    spent = "Stopping" if job.told else tr("{spent} spent", spent=clock(job.spent))
    left = job.state.left
    more = "" if left is None else tr("{left} left", left=clock(left))
    slot(column, context, f"{spent}\n{more}")


def ended(column: bpy.types.UILayout, context: bpy.types.Context, verbs: tuple[Verb, ...]) -> bool:
    """Draw how the last job of the scene ended, if its verb is one of these and it did not succeed.

    Returns whether anything was drawn: two lines.
    """
    found = session.outcome
    if found is None or found.verb not in verbs or found.level == "INFO":
        return False
    if not found.is_of(context.scene):
        return False
    icon = {"WARNING": "INFO", "ERROR": "CANCEL"}[found.level]
    slot(column, context, sentence(found.text), icon, whole=True)
    return True


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
        column.operator("arto.more_samples", icon="ADD")
        column.prop(settings, "live_first")
        column.prop(settings, "lamps")
        if settings.lamps:
            column.prop(settings, "lamp_samples")
        column.prop(settings, "environment_width")
