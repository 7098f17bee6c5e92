"""A farm's job: a folder that says what is to be rendered, and takes what was.

`job.json` says what; `frame_<n>/` is the capture set of each frame, with no tile rendered yet, and
beside it those of its other takes, where there are shadow catchers; a part is `parts/part_<i>/`,
there whole or not at all.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ...core.capture.capture_set import CaptureSet
from ...core.description import Description
from ...core.errors import FarmError
from ...core.field.writer import tile_names
from ...core.files import write_text
from ...core.region import Region
from ..capture import room
from ..capture.capture import plan_of
from ..capture.room import Estimate
from ..capture.sequence import frame_kept
from ..settings.table import FARM
from ..shot import home
from ..stage.settings import samples_told
from ..stage.takes import TAKES, WHOLE

# Version 1 knows no takes beside the first, and so has none.
VERSION = 2
READABLE = (1, VERSION)
FORMAT = "ARTO farm job"
HEADER = "job.json"
PART_HEADER = "part.json"
MOST = 1_000_000


@dataclass(frozen=True)
class Part:
    """number: in the job; frame; tile: of the frame's capture set; seed: 0 for the first of the
    job's seeds, and so on; take: see `stage.takes`."""

    number: int
    frame: int
    tile: int
    seed: int
    take: str = WHOLE

    @property
    def name(self) -> str:
        return f"part_{self.number:04d}"

    def to_json(self) -> dict[str, Any]:
        said = dict(vars(self))
        if self.take == WHOLE:
            del said["take"]
        return said


class Job:
    """A farm's job, opened. Raises FarmError where it is missing or damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / HEADER
        if not path.is_file():
            raise FarmError(f"there is no job in {folder}: run --command arto plan first")
        said = Description(path, lambda text: FarmError(f"{text}: plan again"))
        if said.data.get("version") not in READABLE:
            raise said.wrong("version", said.data.get("version"))
        self.scene_name = str(said.kind("scene", str, ""))
        self.view_layer = str(said.kind("view_layer", str, ""))
        self.blend = str(said.kind("blend", str, ""))
        self.settings: dict[str, Any] = said.kind("settings", dict, {})
        self.seeds = said.whole("seeds", 1, MOST)
        frames = said.kind("frames", list, [])
        if not frames or any(type(f) is not int for f in frames):
            raise said.wrong("frames", frames)
        self.frames: list[int] = frames
        self.subframe = said.number("subframe", 0.0)
        # the frames that show some
        catchers = said.kind("catchers", list, [])
        if any(type(f) is not int or f not in frames for f in catchers):
            raise said.wrong("catchers", catchers)
        self.catchers: set[int] = set(catchers)
        self.tiles = said.whole("tiles", 1, MOST)
        if sum(len(self.takes(f)) for f in frames) * self.tiles * self.seeds > MOST:
            raise said.wrong("tiles", self.tiles)

    def takes(self, frame: int) -> tuple[str, ...]:
        """The names of a frame's takes, that of everything first."""
        return (WHOLE, *TAKES) if frame in self.catchers else (WHOLE,)

    @property
    def parts(self) -> list[Part]:
        every = [
            (frame, tile, seed, take)
            for frame in self.frames
            for take in self.takes(frame)
            for tile in range(self.tiles)
            for seed in range(self.seeds)
        ]
        return [Part(i, *each) for i, each in enumerate(every)]

    def part(self, number: int) -> Part:
        """Raises FarmError for a number that is no part's."""
        parts = self.parts
        if not 0 <= number < len(parts):
            raise FarmError(f"there is no part {number}: {self.folder} has 0 to {len(parts) - 1}")
        return parts[number]

    def set_folder(self, frame: int, take: str) -> Path:
        return set_folder(self.folder, frame, take)

    def set_of(self, frame: int, take: str) -> CaptureSet:
        """The capture set of a take of a frame, unfinished. Raises FarmError, CaptureSetError."""
        found = CaptureSet(self.set_folder(frame, take), unfinished=True)
        if len(found.regions) != self.tiles:
            raise FarmError(f"{found.folder} has not the job's {self.tiles} tiles: plan again")
        if found.head.get("take", WHOLE) != take:
            raise FarmError(f"{found.folder} is not of the take '{take}': plan again")
        return found

    def samples_of(self, head: dict[str, Any]) -> int:
        """How many samples a part has. Once a tile is gathered, its set's description says those of
        all seeds."""
        gathered = any(entry["done"] for entry in head["tiles"])
        return head["samples"] // self.seeds if gathered else head["samples"]

    def go_to(self, scene: bpy.types.Scene, frame: int) -> None:
        """Bring the scene to a frame as it was planned."""
        scene.frame_set(frame, subframe=self.subframe)
        # whatever a script has moved is where it should be
        scene.view_layers[self.view_layer].update()

    def part_folder(self, part: Part) -> Path:
        return self.folder / "parts" / part.name

    def there(self, part: Part, key: str) -> dict[str, Any] | None:
        """What a rendered part says of itself; None where it is not there. Raises FarmError for one
        of another job or scene."""
        path = self.part_folder(part) / PART_HEADER
        if not path.is_file():
            return None
        said = Description(path, lambda text: FarmError(f"{text}: render that part again"))
        if said.data.get("key") != key or said.data.get("part") != part.to_json():
            raise FarmError(
                f"{path.parent} was rendered from another scene, or for another plan: remove it, "
                "and render that part again"
            )
        files = said.kind("files", list, [])
        said.data["files"] = [said.file_name(name, "files") for name in files]
        said.kind("samples", int, 0)
        if fitted := said.kind("fitted", dict):
            # what it names is moved into the frame's field, in place of what has that name there
            name = fitted.get("file") or fitted.get("folder")
            if said.file_name(name, "fitted") not in tile_names(part.tile):
                raise said.wrong("fitted", name)
        return said.data

    @contextmanager
    def scene(self) -> Iterator[tuple[bpy.types.Scene, str]]:
        """The job's scene and view layer in this file, with the job's settings and, at the end,
        with its own again, and at its frame. Raises FarmError where the file is another one."""
        scene = bpy.data.scenes.get(self.scene_name)
        if scene is None or self.view_layer not in scene.view_layers:
            raise FarmError(
                f"there is no scene '{self.scene_name}' with a view layer '{self.view_layer}' in "
                f"this file: open the one that was planned, {self.blend}"
            )
        before = settings_of(scene)
        with frame_kept(scene):
            try:
                _set(scene, self.settings)
                yield scene, self.view_layer
            finally:
                _set(scene, before)


def is_job(path: Path) -> bool:
    """Whether a file says that it is the description of a farm's job, of whatever version."""
    try:
        return Description(path, FarmError).data.get("format") == FORMAT
    except FarmError:
        return False


def set_folder(folder: Path, frame: int, take: str) -> Path:
    """Where in a job's folder the capture set of a take of a frame is."""
    return folder / (f"frame_{frame:04d}" + (f"_{take}" if take else ""))


def _set(scene: bpy.types.Scene, settings: dict[str, Any]) -> None:
    for name in settings:
        if name not in scene.arto.bl_rna.properties:
            raise FarmError(f"this ARTO has no setting '{name}': use the one that planned")
    for name in FARM:
        if name in settings:
            value = settings[name]
            setattr(scene.arto, name, set(value) if isinstance(value, list) else value)


def estimate(head: dict[str, Any], fitted: bool) -> Estimate:
    """What a take of a frame needs, all its tiles under one seed; fitted: see `room.estimate`."""
    tiles = [Region(*t["region"]) for t in head["tiles"]]
    images = [len(some) for some in plan_of(head)]
    return room.estimate(images, tiles, head["patches"], fitted)


def settings_of(scene: bpy.types.Scene) -> dict[str, Any]:
    """ARTO's settings of a scene that go to a farm."""
    found = {}
    for name in FARM:
        value = getattr(scene.arto, name)
        found[name] = sorted(value) if isinstance(value, set) else value
    if samples_told(scene):
        found["quality"] = "CUSTOM"
    return found


def write(
    folder: Path,
    scene: bpy.types.Scene,
    view_layer: str,
    frames: list[int],
    subframe: float,
    catchers: list[int],
    tiles: int,
    seeds: int,
) -> Job:
    """Write a job's description. subframe: of all frames; catchers: the frames that show some.
    Raises FarmError."""
    blend = Path(home.file())
    data = {
        "format": FORMAT,
        "version": VERSION,
        "blend": blend.name,
        "blender": bpy.app.version_string,
        "scene": scene.name,
        "view_layer": view_layer,
        "settings": settings_of(scene),
        "frames": frames,
        "subframe": subframe,
        "catchers": catchers,
        "tiles": tiles,
        "seeds": seeds,
        "parts": (len(frames) + len(TAKES) * len(catchers)) * tiles * seeds,
    }
    try:
        write_text(folder / HEADER, json.dumps(data, indent=1))
    except OSError as e:
        raise FarmError(f"{folder} cannot be written ({e}): choose another folder") from e
    return Job(folder)
