"""Live: while the switch is on, the shot follows its world.

A timer looks at the world up to thirty times a second, and never does long work itself. The
resident renderer makes the maps of the world (`maps`) and pictures of its suns (`suns`). A thread
makes the pictures (`viewer`).

While the artist changes the world, the pictures are small. After a short rest the picture has full
size, and is denoised. After a longer rest a relight starts, whose plate has all its samples
(`finishing`). Where the plate on disk is of the light as it is now, the plate is shown, and not the
live picture.
"""

from __future__ import annotations

import time
from dataclasses import replace

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...core.errors import ArtoError, SceneError
from ..blender import handlers
from ..blender.editors import redraw, reveal
from ..blender.quitting import not_when_quitting, when_quitting
from ..plate.plate import name_of
from ..relight.shown import check_film
from ..shot import watch
from ..shot.shot import layer_of
from ..world.check import check_world, world_of
from ..world.kept import shows
from ..world.own import gains_of
from .asking import WHOLE, Asking, Map
from .finishing import Finishing
from .image import Seen, push, put_away, seen, show_plate
from .line import FINISHED_LINE, draft_line, lacking, line, other_shot
from .source import Newest, Opened, place_of, source_of
from .viewer import Drawn, Viewer, Wish
from .wished import Light, Wished

EVERY = 1 / 30
# Seconds after which the world is looked at even if Blender reported no change: it may
# report none for a world that is linked from another file.
ANYWAY = 0.5
# Seconds of rest until a relight is started.
FINISHED = 2.0


class Live:
    """A shot that follows its world."""

    def __init__(self, scene: bpy.types.Scene, by_itself: bool = False) -> None:
        """Open the shot's field, or its draft, and start the resident renderer.

        by_itself: whether a capture switched Live on, to show its first picture. Raises what
        opening the field raises, and SceneError where the scene has no usable world.
        """
        self.scene_uid = scene.session_uid
        self.scene_name, self.blend = scene.name, bpy.data.filepath
        self.layer = layer_of(scene)
        self.name = name_of(scene)
        check_world(scene, self.layer)
        self.by_itself = by_itself
        self.opened = Opened(scene, self.layer, source_of(scene, self.layer))
        self.viewer = Viewer(self.opened.preview)
        self.asking, self._seen = Asking(scene, self.layer, self.opened), Seen()
        self.maps = self.asking.maps
        self._shot = place_of(scene)
        self.behind = True  # whether the world behind is in the picture
        # what Live has to say, why there is no map, and which film the shot was not captured for
        self.trouble = self.problem = self.film = ""
        self.line = "Starting"
        self.dirty = True
        self._looked, self._source = 0.0, Newest(self.opened)
        self._now: Light | None = None
        self._changed = 0.0
        self._wished: Wished | None = None
        # the picture of full size that was made last
        self._whole: Drawn | None = None
        self.finishing = Finishing(self.layer)
        self.revealed = False

    @property
    def scene(self) -> bpy.types.Scene | None:
        return next((s for s in bpy.data.scenes if s.session_uid == self.scene_uid), None)

    def tick(self) -> bool:
        """Look at the world, ask for a picture, show the newest one.

        Returns False where the scene is gone: the timer then ends. Raises SceneError where Live
        cannot go on: the shot was captured anew, the file has another name, no window shows the
        scene any more, or its world is gone.
        """
        scene = self.scene
        if scene is None:
            return False
        self._check(scene)
        now = time.monotonic()
        if self.dirty or now - self._looked > ANYWAY:
            self.dirty, self._looked = False, now
            self._look(scene, now)
        said, self._changed = self.finishing.follow(self._changed)
        self.line = said or self.line
        self._wish(scene, now)
        shown = self.viewer.take()
        if shown is not None and shown.shown is not None:
            self._whole = shown
        if shown is not None and not self.finished:
            picture = np.repeat(np.repeat(shown.picture, shown.factor, 0), shown.factor, 1)
            self.name, (height, width) = name_of(scene), self.opened.size
            image = push(picture[:height, :width], self.name)
            if not self.revealed:
                self.revealed = True
                if not seen(image):
                    reveal(image)
            if not self.opened.draft:
                suns = shown.suns if shown.wish.suns is None else 0.0
                lacks = lacking(scene, self.opened.held, self.behind, suns)
                self.line = line(
                    scene, shown, lacks, self.finishing.took, self.asking.resident.bytes
                )
            redraw()
            watch.redraw()
        said = self.maps.trouble_with(self._now.key) if self._now else ""
        trouble = self.film or self.problem or said or self.viewer.trouble or self.finishing.failed
        trouble = trouble or self.asking.suns.said
        if place_of(scene) != self._shot:
            trouble = other_shot(self._shot, place_of(scene))
        if trouble != self.trouble:
            self.trouble = trouble
            watch.redraw()
        return True

    def _check(self, scene: bpy.types.Scene) -> None:
        """Open what is newer, and raise SceneError where Live cannot go on."""
        self._open_newer(scene)
        if bpy.data.filepath != self.blend:
            raise SceneError("the file has another name now: switch Live on again")
        windows = bpy.context.window_manager.windows
        if not bpy.app.background and all(window.scene != scene for window in windows):
            raise SceneError(
                f"Live was on for the scene '{self.scene_name}': switch it on for this one"
            )

    def _open_newer(self, scene: bpy.types.Scene) -> None:
        """Open what is newer: a draft of a capture that began, its next tile, then its field.

        Raises SceneError where what was open is gone, or is of another capture.
        """
        found = self._source.newer(self.opened, scene, self.layer, place_of(scene) == self._shot)
        if found is not None:
            self.opened = found
            self.viewer.close(wait=False)
            self.viewer, self._wished, self._now = Viewer(found.preview), None, None
            self._whole = None
            self.asking.open(scene, found)
            self.dirty = True
        if self.opened.draft and self.line != (said := draft_line(*self._source.said)):
            self.line = said
            watch.redraw()

    def _look(self, scene: bpy.types.Scene, now: float) -> None:
        """Note what the world is now, and when it last changed."""
        world = world_of(scene, self.layer)
        if world is None:
            raise SceneError("the scene has no world any more: add one, and switch Live on again")
        key, strength, turn = shows(scene, world)
        settings, gains = scene.arto, tuple(gains_of(scene).items())
        own, clear = settings.own_lamps, scene.render.film_transparent
        found = Light(key, strength, turn, own, gains, clear, settings.live_finish)
        self.film = ""
        try:
            check_film(scene, self.opened.field)
        except SceneError as e:
            self.film = str(e)
        if found == self._now:
            return
        self._now, self._changed = found, now
        was = self.finished
        self.finishing.change(scene, world, self.opened)
        self.asking.suns.make_way()
        if self.finished:
            self.name, self.line = name_of(scene), FINISHED_LINE
            show_plate(scene)
            watch.redraw()
        elif was:
            self._wished = None  # the live picture is shown again

    def _wish(self, scene: bpy.types.Scene, now: float) -> None:
        light = self._now
        if light is None or self.film:
            return
        rest = now - self._changed
        world = world_of(scene, self.layer)
        there = self.asking.map_of(world, light)
        whole = self._whole if self.settled and not self.finished else None
        self.problem = ""
        try:
            if world:
                self.asking.ask(scene, world, light, rest, there, whole)
        except SceneError as e:  # between two HDRIs the world has none for a moment
            self.problem = str(e)
        if there is not None:
            self._show(scene, world, light, rest, there)
        waits = rest > FINISHED and self.settled and not self.maps.busy
        if light.finish and not self.opened.draft and not self.finished and waits:
            self.finishing.start(scene, light)

    def _show(
        self,
        scene: bpy.types.Scene,
        world: bpy.types.World | None,
        light: Light,
        rest: float,
        there: Map,
    ) -> None:
        """Wish for a picture of a map, where the picture is another than the last."""
        suns, wait = self.asking.suns_of(scene, there)
        if wait:
            return  # without the suns their shadows would be blurred until then
        full = there.ours and there.full and rest > WHOLE
        clean = self.asking.clean_of(light) if full else None
        ours = light if there.ours else None
        wished = Wished(there.key, ours, id(there.image), full, id(suns), id(clean))
        if wished == self._wished:
            return
        self._wished = wished
        size, region = self.opened.size, self.opened.region
        view = self._seen.view(scene, light.clear, world, there.key, size, region)
        self.behind = light.clear or view is not None
        gains = gains_of(scene)
        wish = Wish(there.image, there.strength, there.turn, light.own, gains, full, view)
        if suns is not None:
            wish = replace(wish, suns=suns.pixels, of_suns=suns.factor)
        if clean is not None and self._whole is not None and self._whole.shown is not None:
            wish = replace(wish, clean=clean.pixels, alpha=self._whole.shown[..., 3:])
        self.viewer.wish(wish)

    @property
    def settled(self) -> bool:
        """Whether the picture of full size, of the world as it is now, is shown."""
        wished = self._wished
        if wished is None or wished.light is None:
            return False
        return wished.light == self._now and wished.whole and self.viewer.idle

    @property
    def shows_suns(self) -> bool:
        """Whether the newest picture of the suns is in the picture that was asked for last."""
        wished, newest = self._wished, self.asking.suns.picture
        return wished is not None and newest is not None and wished.suns == id(newest)

    @property
    def is_clean(self) -> bool:
        """Whether the picture of full size, of the world as it is now, is shown denoised."""
        wished = self._wished
        return self.settled and wished is not None and wished.clean != id(None)

    def relit(self, scene: bpy.types.Scene) -> bool:
        """A relight has ended -> whether its plate is to be shown: not if the light changed."""
        world = world_of(scene, self.layer)
        if scene != self.scene or world is None:
            return True
        wanted, said = self.finishing.relit(scene, world, self.opened)
        self.line = said or self.line
        return wanted

    def close(self, wait: bool = True) -> None:
        """End the thread and the relight. wait: until the thread has ended.

        The resident renderer stays, for when Live is switched on again.
        """
        self.viewer.close(wait)
        self.asking.close()
        self.finishing.dismiss()

    @property
    def finished(self) -> bool:
        """Whether the plate on disk is of the light as it is now, and is shown."""
        return self.finishing.finished


current: Live | None = None
# Why Live is off, where it ended by itself.
trouble = ""


def start(scene: bpy.types.Scene, by_itself: bool = False) -> None:
    """Switch Live on for a scene. by_itself: see `Live`. Raises what `Live` raises."""
    global current, trouble
    stop()
    trouble = ""
    current = Live(scene, by_itself)
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0)


def stop() -> None:
    """Switch Live off. Editors that showed the live image show the plate again."""
    global current
    if current is None:
        return
    ended, current = current, None
    ended.close(wait=False)
    put_away(ended.name)


def _tick() -> float | None:
    global trouble
    if current is None:
        return None
    try:
        if current.tick():
            return EVERY
    except ArtoError as e:
        trouble = str(e)
    except Exception as e:
        trouble = f"{type(e).__name__}: {e}"
        stop()
        raise
    stop()
    watch.redraw()
    return None


@persistent
def _changed(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if current is not None:
        kinds = (bpy.types.World, bpy.types.NodeTree, bpy.types.Image, bpy.types.Scene)
        if any(isinstance(u.id, kinds) for u in depsgraph.updates):
            current.dirty = True


@persistent
def _undone(*_: object) -> None:
    """Have the live image made and shown again: an undo removes it."""
    if current is not None:
        current.dirty, current.revealed, current._wished = True, False, None


@persistent
def _another_file(*_: object) -> None:
    global trouble
    stop()
    trouble = ""


@persistent
def _quitting(*_: object) -> None:
    """End the second Blender and the thread. The open file is left alone: Blender is quitting."""
    global current
    if current is not None:
        ended, current = current, None
        ended.close()


_HANDLERS = {
    "depsgraph_update_post": _changed,
    "load_pre": _another_file,
    "undo_post": _undone,
    "redo_post": _undone,
}


def register() -> None:
    if not bpy.app.background:
        handlers.add(_HANDLERS)
        when_quitting(_quitting)


def unregister() -> None:
    stop()
    not_when_quitting(_quitting)
    handlers.remove(_HANDLERS)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def wrote(scene: bpy.types.Scene) -> bool:
    """A relight of a scene has ended -> whether to show its plate; not if the light changed."""
    return current is None or current.relit(scene)
