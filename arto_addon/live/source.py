"""What a live picture is made from: the field of a shot, or of its capture that is not complete."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.errors import SceneError
from ...core.field.field import Field
from ...core.field.head import HEADER
from ...core.preview import Preview
from ...core.region import Region
from ..blender.markers import camera_of
from ..capture.stream import Stream
from ..job import session
from ..job.verbs import VERBS
from ..relight.shown import Shown, check_film, newest
from ..shot import paths, status
from ..shot.shot import check_same_shot
from ..stage.stage import picture_region, picture_size
from ..world.background import holds_out
from .growing import Growing


def place_of(scene: bpy.types.Scene) -> tuple[int, float, str, int, int]:
    """What tells this shot from other shots of the scene: frame, camera and picture size."""
    name = bound.name if (bound := camera_of(scene)) else ""
    return scene.frame_current, scene.frame_subframe, name, *picture_size(scene)


@dataclass(frozen=True)
class Source:
    """Which files a live picture is made from.

    folder: of the field or the draft; written: when it was written, in ns, 0 where it is gone;
    grown: when the last tile of a capture that is not complete was added, in ns, 0 for none.
    """

    folder: Path
    written: int
    grown: int = 0


def source_of(scene: bpy.types.Scene, layer: str) -> Source:
    """What a live picture of a scene is to be made from, as it is on disk now.

    Raises SceneError, ShotError.
    """
    folder = newest(scene, layer)
    written, grown = written_at(folder), 0
    if folder.name == paths.draft_folder(folder).name:
        there = status.draft_of(folder.parent)
        grown = written_at(_tiles(there)) if there else 0
    return Source(folder, written, grown)


def _tiles(draft: Field) -> Path:
    """The field of the tiles that are fitted already, of the capture of a draft."""
    key = draft.about.key or ""
    return paths.unfinished_folder(draft.folder.parent, key) / Stream.FIELD


def written_at(folder: Path) -> int:
    """When the field in a folder was written, in ns; 0 where there is none."""
    try:
        return (folder / HEADER).stat().st_mtime_ns
    except OSError:
        return 0


class Opened:
    """The opened field of a live picture.

    size: (height, width) of the picture; region: outside it the picture is empty; held: whether its
    brightness is that of a render only after a relight; draft: whether it is of a capture that is
    not complete. Raises what opening a field raises.
    """

    def __init__(self, scene: bpy.types.Scene, layer: str, source: Source) -> None:
        shown = Shown(scene, layer, source.folder if source.written else None)
        check_same_shot(scene, shown.field.about.shot, "the reflectance field", layer)
        check_film(scene, shown.field)
        self.source, self.field, self.held = source, shown.field, shown.held
        self.draft = bool(shown.field.about.draft)
        self.size: tuple[int, int] = shown.size
        self.region: Region = picture_region(scene) if self.draft else shown.field.region
        if self.draft:
            tiles = Field(_tiles(shown.field)) if source.grown else None
            if tiles and tiles.hemicube != shown.field.hemicube:
                tiles = None
            self.preview: Preview = Growing(shown.field, shown.size, tiles)
        else:
            fields = [take.field for take in shown.takes]
            self.preview = Preview(fields, holds_out(scene, layer))

    @property
    def progress(self) -> tuple[int, int, bool] | None:
        """Of a capture that is not complete: how many tiles are done, of how many, and whether it
        is going on; None before the first tile."""
        key = self.field.about.key
        heads = status.stopped(self.field.folder.parent)
        head = next((head for head in heads if head.key == key), None)
        job = session.current
        goes_on = job is not None and VERBS[job.verb].captures
        return (head.done, len(head.tiles), goes_on) if head else None


# Seconds between two looks at the disk, and seconds for which what is shown may be away: a newer
# one takes its place.
EVERY, GONE = 0.5, 3.0


class Newest:
    """Looks whether there is something newer to show than what is open.

    said: what to say of a draft: its size (height, width), and `Opened.progress`.
    """

    def __init__(self, opened: Opened) -> None:
        self._looked, self._there = 0.0, time.monotonic()
        self.said = opened.field.shape, opened.progress

    def newer(
        self, opened: Opened, scene: bpy.types.Scene, layer: str, same: bool
    ) -> Opened | None:
        """What is newer: a draft of a capture that began, its next tile, its field; None for none.

        opened: what is shown; same: whether the scene still shows the shot that is open. Raises
        SceneError where what is shown is gone, or another capture took its place.
        """
        was, at = opened.source, time.monotonic()
        if at - self._looked < EVERY and written_at(was.folder) == was.written:
            return None
        self._looked, now = at, replace(was, written=written_at(was.folder))
        if same:
            now = source_of(scene, layer)
        if not now.written:
            if at - self._there > GONE:
                raise SceneError("what Live showed is gone: capture the shot, then switch Live on")
            return None
        self._there, found = at, None
        if now != was:
            if now.folder == was.folder and not opened.draft:
                raise SceneError("the shot was captured anew: switch Live on again")
            opened = found = Opened(scene, layer, now)
        if opened.draft:
            self.said = opened.field.shape, opened.progress
        return found
