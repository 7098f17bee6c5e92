"""What there is of a shot on disk: its captures, fields and plates, and whether each is whole.

All files are read and compared with their checksums, where they have some.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import bpy

from ...core import exr
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import HEADER as CAPTURE_HEADER
from ...core.errors import ArtoError, ShotError
from ...core.field.field import Field, proxy_folder
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.field.proxy import FACTORS
from ...core.field.tile_file import TileFile
from ...core.shot import Shot
from ..capture.sequence import frame_kept
from ..plate import composite, plate
from ..plate.marks import SCRIPTS, is_of
from ..plate.together import beside, older_prefix
from ..relight import ahead
from ..relight.light_key import HEADER, light_key
from ..shot import paths, status
from ..shot.shot import shot_of
from ..stage.takes import TAKES
from ..world.check import world_of

FORMAT, VERSION = "ARTO status", 1
# whole: all of it is there, and as it was written; unfinished: of a capture that was stopped;
# outdated: whole, but not of the light, the field and the settings as they are now.
State = Literal["whole", "missing", "damaged", "unfinished", "outdated"]


@dataclass(frozen=True)
class Thing:
    """Something of a shot.

    kind: "capture", "field", "plate", or what a file beside the plate is; path: where it is, or
    would be; why: what is wrong with it, in words.
    """

    kind: str
    path: Path
    state: State
    why: str = ""

    def to_json(self) -> dict[str, str]:
        said = {"kind": self.kind, "path": str(self.path), "state": self.state}
        return said | ({"why": self.why} if self.why else {})


@dataclass(frozen=True)
class OfFrame:
    """What there is of a frame."""

    frame: float
    things: tuple[Thing, ...]


@dataclass(frozen=True)
class Inventory:
    """What there is of a shot."""

    scene: str
    view_layer: str
    frames: tuple[OfFrame, ...]

    @property
    def whole(self) -> bool:
        """Whether all of it is whole, and there is something."""
        return bool(self.frames) and all(
            thing.state == "whole" for frame in self.frames for thing in frame.things
        )

    @property
    def lines(self) -> list[str]:
        """The same in words."""
        out = []
        for frame in self.frames:
            for thing in frame.things:
                why = f" ({thing.why})" if thing.why else ""
                out.append(f"frame {frame.frame:g}: {thing.kind} {thing.state}{why}: {thing.path}")
        return out or ["nothing was captured"]

    def to_json(self) -> dict[str, object]:
        return {
            "format": FORMAT,
            "version": VERSION,
            "scene": self.scene,
            "view layer": self.view_layer,
            "whole": self.whole,
            "frames": [
                {"frame": f.frame, "things": [thing.to_json() for thing in f.things]}
                for f in self.frames
            ],
        }


def inventory(
    scene: bpy.types.Scene, view_layer: str, frames: Sequence[int] | Literal["all"] | None
) -> Inventory:
    """Look at all that there is of some frames.

    frames: None for the scene's frame; "all" for those that a capture was begun of. The scene is
    put back to its frame. Raises SceneError.
    """
    several = frames is not None
    if frames == "all":
        frames = sorted(int(frame) for frame in paths.frames(scene, view_layer))
    found = []
    with frame_kept(scene):
        for frame in [scene.frame_current] if frames is None else frames:
            if several:
                scene.frame_set(int(frame))
                scene.view_layers[view_layer].update()
            numbers = [int(frame)] if several else []
            path = ahead.wanted(scene, (), 1, numbers)[0].path
            things = (*_of_shot(scene, view_layer), *_of_plate(scene, view_layer, path))
            found.append(OfFrame(frame, things))
    return Inventory(scene.name, view_layer, tuple(found))


def _of_shot(scene: bpy.types.Scene, view_layer: str) -> Iterator[Thing]:
    """The capture and the field of a shot, and those of its takes."""
    try:
        place = paths.place(scene, view_layer)
    except ShotError as e:
        yield Thing("shot", Path(), "damaged", str(e))
        return
    source, now = place.source, shot_of(scene, view_layer)
    if place.owner:
        yield Thing("capture", source / "capture", "missing", f"captured for {place.owner}")
        return
    for text in status.unfinished(source):
        yield Thing("capture", source, "unfinished", text)
    takes = [name for name in TAKES if (source / name).is_dir()]
    for folder in (source, *(source / name for name in takes)):
        name = f" {folder.name}" if folder != source else ""
        captured, fitted = folder / "capture", folder / "field"
        yield _capture(f"capture{name}", captured, now)
        yield _field(f"field{name}", fitted, now, _key_of(captured))


def _key_of(folder: Path) -> str | None:
    """The key of a capture set; None where it has none, or is damaged."""
    there = status.capture_at(folder / CAPTURE_HEADER)
    return there.head.key if there else None


def _capture(kind: str, folder: Path, now: Shot) -> Thing:
    if not (folder / CAPTURE_HEADER).is_file():
        return Thing(kind, folder, "missing")
    try:
        there = CaptureSet(folder)
        for tile in range(len(there.head.tiles)) if there.kept else ():
            with there.open(tile):
                pass  # its files were compared with their checksums
    except ArtoError as e:
        return Thing(kind, folder, "damaged", str(e))
    return _of_now(kind, folder, there.head.shot, now)


def _of_now(kind: str, folder: Path, then: Shot | None, now: Shot) -> Thing:
    """What is whole; said is where it is of another shot, such as of another frame."""
    difference = then.difference(now) if then else None
    if difference:
        return Thing(kind, folder, "outdated", f"it is of {difference}")
    return Thing(kind, folder, "whole")


def _field(kind: str, folder: Path, now: Shot, key: str | None) -> Thing:
    if not (folder / FIELD_HEADER).is_file():
        return Thing(kind, folder, "missing")
    try:
        with Field(folder) as there:
            _compare(there)
            for factor in FACTORS:
                if proxy_folder(folder, factor).exists():
                    with there.proxy(factor) as small:
                        _compare(small)
    except ArtoError as e:
        return Thing(kind, folder, "damaged", str(e))
    if None not in (key, there.about.key) and key != there.about.key:
        return Thing(kind, folder, "outdated", "it is of another capture than the one beside it")
    return _of_now(kind, folder, there.about.shot, now)


def _compare(field: Field) -> None:
    """Compare all arrays of a field with their checksums. Raises FieldError."""
    for tile in field.tiles:
        tile.has_layer("alpha")
        if tile.path.is_file():
            file = TileFile(tile.path)
            for name in file.sizes:
                file.load(name)  # compares it with its checksum


def _of_plate(scene: bpy.types.Scene, view_layer: str, path: Path) -> Iterator[Thing]:
    """A plate and the files beside it."""
    if not path.is_file():
        yield Thing("plate", path, "missing")
        return
    try:
        head = exr.header(path)
        exr.whole_parts(path)
    except ArtoError as e:
        yield Thing("plate", path, "damaged", str(e))
        return
    world, field = world_of(scene, view_layer), _field_of(scene, view_layer)
    key = head.get(HEADER)
    same = field is None or world is None or key == light_key(scene, world, view_layer, field)
    yield Thing("plate", path, "whole" if same else "outdated")
    prefix = older_prefix(path)
    expected = {plate.full_file(path)} if plate.CROPPED in head else set()
    expected |= {plate.share_file(path)} if plate.CATCHER in head else set()
    if plate.LAYERS in head and prefix is None:
        expected.add(plate.layers_file(path))
    others = [p for p in beside(path, {prefix} if prefix is not None else set()) if is_of(p, path)]
    for other in sorted({*expected, *others}):
        yield _beside(path, other, key)
    if noted := composite.said_of(scene):
        of_now = noted.get("plate") == key
        why = "" if of_now else "it is of an earlier plate"
        there = composite.composite_file(scene)
        yield Thing("composite", there, "whole" if of_now else "outdated", why)


def _field_of(scene: bpy.types.Scene, view_layer: str) -> Field | None:
    """The shot's field; None where it is missing or damaged, or nobody knows whose it is."""
    with contextlib.suppress(ShotError):
        return status.field_of(paths.place(scene, view_layer).source)
    return None


def _beside(path: Path, other: Path, key: object) -> Thing:
    kind = other.stem.removeprefix(path.stem).lstrip("_").replace("_", " ")
    if not other.is_file():
        return Thing(kind, other, "missing")
    if other.suffix in SCRIPTS:  # that it is ARTO's own says that it is as it was written
        return Thing(f"script {other.suffix}", other, "whole")
    try:
        exr.whole_parts(other)
        if exr.header(other).get(HEADER, key) != key:
            return Thing(kind, other, "outdated", "it is of another light than the plate")
    except ArtoError as e:
        return Thing(kind, other, "damaged", str(e))
    return Thing(kind, other, "whole")
