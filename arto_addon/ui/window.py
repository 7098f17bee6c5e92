"""What the window does besides buttons: show a finished job's result, and tidy up."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from ...core import exr
from ...core.errors import ArtoError
from ..blender.editors import reveal
from ..job import session, snapshot
from ..job.session import SecondBlender
from ..job.verbs import VERBS, Verb
from ..live import live
from ..live.image import put_away
from ..match import apply
from ..match.found import match_file
from ..plate import compare
from ..plate.names import relit_file
from ..plate.plate import name_of, show
from ..plate.present import present, present_frames
from ..relight import inside
from ..relight.finished import FINISHED, SAID, finished_file
from ..relight.many import frames_of
from ..relight.shown import newest
from ..relight.verify import verify_file
from ..shot import paths
from ..shot.shot import layer_of
from ..shot.status import field_of
from ..world import own
from ..world.check import world_of
from . import overlay


def _scene_of(job: SecondBlender) -> bpy.types.Scene | None:
    """The scene of a job, if its file is still open."""
    scene = next((s for s in bpy.data.scenes if s.arto.scene_id == job.scene_id), None)
    return scene if bpy.data.filepath == job.blend else None


def show_relit(job: SecondBlender) -> str:
    """Put an ended relight's plate or frames into the file, if still open, and show the plate."""
    path = Path(job.state.result)
    scene = _scene_of(job)
    if scene is None:
        return f"wrote {path} (its scene is not open any more)"
    window = bpy.context.window_manager.windows[0]
    wanted = live.wrote(scene)
    with bpy.context.temp_override(window=window):
        if job.verb == "relight_frames":
            image = present_frames(scene, path, frames_of(scene), job.light)
        else:
            image = present(scene, path, job.light)
        if wanted:  # otherwise Live shows a newer light already
            reveal(image)
    return job.state.text


# The folder of the job whose first picture was shown.
_showed: Path | None = None


def show_first(job: SecondBlender) -> None:
    """Switch Live on once a capture has a draft, where the shot's field is not of the scene."""
    global _showed
    if job.folder == _showed or not VERBS[job.verb].captures:
        return
    scene = _scene_of(job)
    if scene is None or not scene.arto.live_first or world_of(scene) is None:
        return
    if live.current is not None or bpy.context.window_manager.windows[0].scene != scene:
        return
    folder = paths.place(scene, layer_of(scene), fresh=False).folder
    if newest(scene, layer_of(scene)) != paths.draft_folder(folder):
        return
    _showed = job.folder  # once: an artist may switch it off
    try:
        live.start(scene, by_itself=True)
    except ArtoError as e:
        live.trouble = str(e)


def show_captured(job: SecondBlender) -> str:
    """Bring the light groups of an ended capture into the panel, and show the shot in its light."""
    scene = _scene_of(job)
    if scene is not None:
        there = field_of(paths.place(scene, layer_of(scene)).source)
        if there is not None:
            own.sync(scene, there)
    if job.verb in ("shoot", "photographs") and job.state.result:
        if live.current is not None and live.current.by_itself:
            live.stop()  # the plate takes its place
        return show_relit(job)
    return job.state.text


def show_looks(job: SecondBlender) -> str:
    """Give each relit look its image and its node in the compositor."""
    scene = _scene_of(job)
    if scene is None:
        return job.state.text
    window = bpy.context.window_manager.windows[0]
    shown = None
    with bpy.context.temp_override(window=window):
        for look in scene.arto.looks:
            path = relit_file(scene, look.name)
            if path.is_file():
                image = present(scene, path, look.name)
                if shown is None or look.name == scene.arto.look:
                    shown = image
        if shown is not None:
            reveal(shown)
    return job.state.text


def show_verified(job: SecondBlender) -> str:
    """Show the picture of where the plate differs from the render."""
    _show_beside(job, verify_file, lambda _: "ARTO Verify")
    return job.state.text


def _show_beside(
    job: SecondBlender, beside: Callable[[Path], Path], named: Callable[[bpy.types.Scene], str]
) -> None:
    """Show what a job has made beside the plate that the scene has now; else nothing.

    beside: where that is, by the plate's path; named: the name of its image.
    """
    scene, path = _scene_of(job), Path(job.state.result)
    if scene is None or path != beside(relit_file(scene)):
        return
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        reveal(show(path, named(scene)))


def show_sheet(job: SecondBlender) -> str:
    """Show the contact sheet."""
    path = Path(job.state.result)
    if _scene_of(job) is not None and path.is_file():
        window = bpy.context.window_manager.windows[0]
        with bpy.context.temp_override(window=window):
            image = bpy.data.images.load(str(path), check_existing=True)
            image.reload()
            reveal(image)
    return job.state.text


def show_finished(job: SecondBlender) -> str:
    """Show the picture that plate and samples make together."""
    path = Path(job.state.result)
    _show_beside(job, finished_file, lambda scene: f"{name_of(scene)} {FINISHED}")
    return f"finished with {exr.header(path).get(SAID, '')}" if path.is_file() else job.state.text


def show_matched(job: SecondBlender) -> str:
    """Make the look that a match has found, and show the shot in it."""
    scene = _scene_of(job)
    path = Path(job.state.result)
    if scene is None or path != match_file(relit_file(scene)):
        return job.state.text
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        found = apply.apply(scene, path)
        bpy.ops.ed.undo_push(message="ARTO Match")
    return f"{found.words}. The light is a look: press Relight to see it"


# Images that only the window needs: they are removed before the file is saved.
OURS = (inside.IMAGE, inside.FROM, compare.IMAGE, apply.IMAGE)


@persistent
def _before_save(*_: object) -> None:
    if not snapshot.taking:
        put_away(name_of(bpy.context.scene), *OURS)
        if live.current is not None:
            live.current._wished = None


@persistent
def _another_file(*_: object) -> None:
    """Let go of what was said and drawn of the file that was open."""
    session.forget_outcome()
    bpy.context.window_manager.arto.seen = ""
    overlay.switch(False)
    compare.forget()


_FINISHERS: dict[Verb, Callable[[SecondBlender], str]] = {
    "relight": show_relit,
    "relight_frames": show_relit,
    "relight_looks": show_looks,
    "sheet": show_sheet,
    "capture": show_captured,
    "shoot": show_captured,
    "more_samples": show_captured,
    "fit": show_captured,
    "photographs": show_captured,
    "verify": show_verified,
    "finish": show_finished,
    "match": show_matched,
    "even_out": show_matched,
}


def register() -> None:
    session.finishers.update(_FINISHERS)
    session.followers.append(show_first)
    if not bpy.app.background:
        bpy.app.handlers.save_pre.append(_before_save)
        bpy.app.handlers.load_post.append(_another_file)


def unregister() -> None:
    for verb in _FINISHERS:
        session.finishers.pop(verb, None)
    if show_first in session.followers:
        session.followers.remove(show_first)
    compare.forget()
    if _another_file in bpy.app.handlers.load_post:
        bpy.app.handlers.load_post.remove(_another_file)
    if _before_save in bpy.app.handlers.save_pre:
        bpy.app.handlers.save_pre.remove(_before_save)
    if not bpy.app.background:
        put_away(name_of(bpy.context.scene), *OURS)
