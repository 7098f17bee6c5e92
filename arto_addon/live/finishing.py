"""The relight that finishes a live picture: its plate has full samples and is denoised.

Nobody asked for that relight, so it is a guest: whatever the artist does ends it.
"""

from __future__ import annotations

import time

import bpy

from ...core import exr
from ...core.errors import ArtoError
from ..blender.words import tr
from ..job import session
from ..plate.names import relit_file
from ..relight.light_key import HEADER, light_key
from .line import FINISHED_LINE
from .source import Opened
from .wished import Light


class Finishing:
    """The relight of the light that rests, and whether its plate is shown."""

    def __init__(self, layer: str) -> None:
        self._layer = layer
        # the light for which a relight was started, and the relight while it runs
        self._begun: Light | None = None
        self.job: session.SecondBlender | None = None
        # how long the last relight took, in seconds; why it failed
        self.took: float | None = None
        self.failed = ""
        # whether the plate is of the light as it is now, so that it is shown in place of the live
        # image
        self.finished = False

    def change(self, scene: bpy.types.Scene, world: bpy.types.World, opened: Opened) -> None:
        """Be told that the light is another one."""
        self.failed = ""
        self.dismiss()  # the relight is of a light that is no longer wanted
        self.finished = self._is_finished(scene, world, opened)

    def start(self, scene: bpy.types.Scene, light: Light) -> None:
        """Start the relight of a light that is shown, once for each light."""
        if self._begun == light or session.current or bpy.app.is_job_running("RENDER"):
            return
        self._begun = light
        self.job = session.start("relight", scene, self._layer, guest=True)

    def follow(self, changed: float) -> tuple[str, float]:
        """Look at the relight -> (what to say of it, empty for nothing; when the light changed).

        changed: when the light changed.
        """
        job = self.job
        if job is None:
            return "", changed
        if job.state.end:
            self.job = None
            if job.state.end == "failed":
                self.failed = f"not finished: {job.state.text.splitlines()[0]}"
        elif session.current is not job:
            # whatever the artist pressed came first: the light is finished after it
            self.job, self._begun = None, None
            return "", time.monotonic()
        else:
            text = tr("Finishing, with suns and denoised: {share:.0%}", share=job.state.share)
            return text, changed
        return "", changed

    def relit(
        self, scene: bpy.types.Scene, world: bpy.types.World, opened: Opened
    ) -> tuple[bool, str]:
        """A relight has ended -> (whether its plate is to be shown, what to say)."""
        asked_for = self.job is None
        if self.job is not None:
            self.took, self.job = self.job.spent, None
        self.finished = self._is_finished(scene, world, opened)
        return self.finished or asked_for, FINISHED_LINE if self.finished else ""

    def _is_finished(self, scene: bpy.types.Scene, world: bpy.types.World, opened: Opened) -> bool:
        """Whether the plate on disk is already of this light and this field, and to be shown."""
        if not scene.arto.live_finish or opened.draft:
            return False
        try:
            path = relit_file(scene)
            same = exr.header(path).get(HEADER) == light_key(scene, world, self._layer)
            return same and path.stat().st_mtime_ns >= opened.source.written
        except (ArtoError, OSError):
            return False

    def dismiss(self) -> None:
        """End the relight."""
        if self.job is not None:
            session.dismiss()
            self.job = None
