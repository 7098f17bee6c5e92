"""A farm's job: a folder that says what is to be rendered, and takes what was.

`job.json` says what; `frame_<n>/` is the capture set of each frame, with no tile rendered yet; a
part is `parts/part_<i>/`, there whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ...core.capture_set import CaptureSet
from ...core.description import Description
from ...core.errors import FarmError
from ...core.files import write_text
from ..capture.sequence import frame_kept
from ..shot import home

VERSION = 1
HEADER = "job.json"
PART_HEADER = "part.json"
MOST = 1_000_000
# What of ARTO's settings is where files are on a machine.
_PLACES = {"folder", "output", "look"}


@dataclass(frozen=True)
class Part:
    """number: in the job; frame; tile: of the frame's capture set; seed: 0 for the first of the
    job's seeds, and so on."""

    number: int
    frame: int
    tile: int
    seed: int

    @property
    def name(self) -> str:
        return f"part_{self.number:04d}"


class Job:
    """A farm's job, opened. Raises FarmError where it is missing or damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / HEADER
        if not path.is_file():
            raise FarmError(f"there is no job in {folder}: run --command arto plan first")
        said = Description(path, lambda text: FarmError(f"{text}: plan again"))
        if said.data.get("version") != VERSION:
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
        self.tiles = said.whole("tiles", 1, MOST)
        if len(frames) * self.tiles * self.seeds > MOST:
            raise said.wrong("tiles", self.tiles)

    @property
    def parts(self) -> list[Part]:
        every = [
            (f, t, s) for f in self.frames for t in range(self.tiles) for s in range(self.seeds)
        ]
        return [Part(i, *each) for i, each in enumerate(every)]

    def part(self, number: int) -> Part:
        """Raises FarmError for a number that is no part's."""
        parts = self.parts
        if not 0 <= number < len(parts):
            raise FarmError(f"there is no part {number}: {self.folder} has 0 to {len(parts) - 1}")
        return parts[number]

    def set_folder(self, frame: int) -> Path:
        return self.folder / f"frame_{frame:04d}"

    def set_of(self, frame: int) -> CaptureSet:
        """The capture set of a frame, unfinished. Raises FarmError, CaptureSetError."""
        found = CaptureSet(self.set_folder(frame), unfinished=True)
        if len(found.regions) != self.tiles:
            raise FarmError(f"{found.folder} has not the job's {self.tiles} tiles: plan again")
        return found

    def part_folder(self, part: Part) -> Path:
        return self.folder / "parts" / part.name

    def there(self, part: Part, key: str) -> dict[str, Any] | None:
        """What a rendered part says of itself; None where it is not there. Raises FarmError for one
        of another job or scene."""
        path = self.part_folder(part) / PART_HEADER
        if not path.is_file():
            return None
        said = Description(path, lambda text: FarmError(f"{text}: render that part again"))
        if said.data.get("key") != key or said.data.get("part") != vars(part):
            raise FarmError(
                f"{path.parent} was rendered from another scene, or for another plan: remove it, "
                "and render that part again"
            )
        files = said.kind("files", list, [])
        said.data["files"] = [said.file_name(name, "files") for name in files]
        said.kind("samples", int, 0)
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


def _set(scene: bpy.types.Scene, settings: dict[str, Any]) -> None:
    for name, value in settings.items():
        if name not in scene.arto.bl_rna.properties:
            raise FarmError(f"this ARTO has no setting '{name}': use the one that planned")
        setattr(scene.arto, name, set(value) if isinstance(value, list) else value)


def settings_of(scene: bpy.types.Scene) -> dict[str, Any]:
    """ARTO's settings of a scene, but for places."""
    found = {}
    for prop in scene.arto.bl_rna.properties:
        if prop.is_readonly or prop.identifier in _PLACES | {"rna_type", "name"}:
            continue
        value = getattr(scene.arto, prop.identifier)
        if isinstance(value, bool | int | float | str):
            found[prop.identifier] = value
        elif isinstance(value, set):
            found[prop.identifier] = sorted(value)
    return found


def write(
    folder: Path,
    scene: bpy.types.Scene,
    view_layer: str,
    frames: list[int],
    tiles: int,
    seeds: int,
) -> Job:
    """Write a job's description. Raises FarmError."""
    blend = Path(home.file())
    data = {
        "format": "ARTO farm job",
        "version": VERSION,
        "blend": blend.name,
        "sha256": hashlib.sha256(blend.read_bytes()).hexdigest(),
        "blender": bpy.app.version_string,
        "scene": scene.name,
        "view_layer": view_layer,
        "settings": settings_of(scene),
        "frames": frames,
        "tiles": tiles,
        "seeds": seeds,
        "parts": len(frames) * tiles * seeds,
    }
    try:
        write_text(folder / HEADER, json.dumps(data, indent=1))
    except OSError as e:
        raise FarmError(f"{folder} cannot be written ({e}): choose another folder") from e
    return Job(folder)
