"""A farm's job: a folder that says what to render, and takes what was rendered.

`job.json` says what to render. `frame_<n>/` is the capture set of a frame, with no tile rendered
yet. With shadow catchers, the sets of the frame's other takes are beside it. `parts/part_<i>/` is a
rendered part, which is either there as a whole or not there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...core import checksum
from ...core.capture.capture_set import CaptureSet
from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Quality, Take
from ...core.capture.tile_entry import fitted_name
from ...core.errors import FarmError, FieldError
from ...core.field.tile import SUFFIX, checksum_of
from ...core.field.tile_file import TileFile
from ...core.file_names import is_text
from ..blender import scripts
from ..blender.front import to_front
from ..capture import room
from ..capture.around import plan_of
from ..capture.room import Estimate
from ..capture.sequence import frame_kept
from ..capture.stream import Stream
from ..settings.table import FARM
from ..shot import home
from ..stage.settings import samples_told
from ..stage.takes import TAKES, WHOLE
from . import head as heads
from .head import JobHead, Part, PartHead


class Job:
    """A farm's job, opened. Raises FarmError where it is missing or damaged."""

    def __init__(self, folder: Path) -> None:
        if not is_text(folder):
            raise FarmError(
                f"the path {str(folder)!a} is not written in UTF-8, so nothing can be rendered "
                "there: rename its folder, or plan into another"
            )
        self.folder, self.head = folder, heads.read(folder)
        # the frames that show shadow catchers
        self.catchers = frozenset(self.head.catchers)

    def takes(self, frame: int) -> tuple[Take, ...]:
        """The names of a frame's takes. The take of everything comes first."""
        return (WHOLE, *TAKES) if frame in self.catchers else (WHOLE,)

    @property
    def parts(self) -> list[Part]:
        every = [
            (frame, tile, seed, take)
            for frame in self.head.frames
            for take in self.takes(frame)
            for tile in range(self.head.tiles)
            for seed in range(self.head.seeds)
        ]
        return [Part(i, *each) for i, each in enumerate(every)]

    def part(self, number: int) -> Part:
        """The part with this number. Raises FarmError where there is none."""
        parts = self.parts
        if not 0 <= number < len(parts):
            raise FarmError(f"there is no part {number}: {self.folder} has 0 to {len(parts) - 1}")
        return parts[number]

    def set_folder(self, frame: int, take: Take) -> Path:
        return set_folder(self.folder, frame, take)

    def set_of(self, frame: int, take: Take) -> CaptureSet:
        """The capture set of a take of a frame, unfinished. Raises FarmError, CaptureSetError."""
        found = CaptureSet(self.set_folder(frame, take), unfinished=True)
        tiles = self.head.tiles
        if len(found.head.tiles) != tiles:
            raise FarmError(f"{found.folder} has not the job's {tiles} tiles: plan again")
        if found.head.shot and found.head.shot.frame != frame:
            raise FarmError(
                f"{found.folder} is of frame {found.head.shot.frame}: put it back, or plan again"
            )
        if (found.head.take or WHOLE) != take:
            raise FarmError(f"{found.folder} is not of the take '{take}': plan again")
        return found

    def samples_of(self, head: CaptureHead) -> int:
        """The number of samples of a part, from the head of its set. Raises FarmError.

        The head of a gathered set has the samples of all seeds together.
        """
        if not head.samples:
            raise FarmError(f"{self.folder} has a capture set without samples: plan again")
        return int(head.samples) // (self.head.seeds if head.done else 1)

    def go_to(self, scene: bpy.types.Scene, frame: int) -> None:
        """Bring the scene to a frame, at the subframe that was planned.

        Raises SceneError where a driver by Python is refused here that ran where it was planned.
        """
        scene.frame_set(frame, subframe=self.head.subframe)
        # let the scene follow what a script has moved
        scene.view_layers[self.head.view_layer].update()
        if self.head.scripts:
            scripts.check_drivers()

    def part_folder(self, part: Part) -> Path:
        return self.folder / "parts" / part.name

    def there(self, part: Part, key: str | None) -> PartHead | None:
        """The head of a rendered part; None where the part is not there.

        Raises FarmError where the part is of another job or scene.
        """
        folder = self.part_folder(part)
        said = heads.read_part(folder)
        if said is not None and (said.key != key or said.part != part):
            raise FarmError(
                f"{folder} was rendered from another scene, or for another plan: remove it, and "
                "render that part again"
            )
        return said

    def damage(self, part: Part, told: PartHead) -> str:
        """Say what is missing or damaged of a part that was rendered, in words; "" for nothing.

        Its files are compared with their checksums, where it has some. A gathering that was
        stopped may have moved some of them already.
        """
        for i, name in enumerate(told.files):
            path = self.part_folder(part) / name
            if not path.exists():
                path = self.set_folder(part.frame, part.take) / part.file_name(i)
            try:
                if name in told.sums and checksum.of_file(path) != told.sums[name]:
                    return f"{path} is not what was rendered"
                if not path.is_file():
                    return f"{path} is not there"
            except OSError as e:
                return f"{path} cannot be read ({e})"
        if told.fitted is not None:
            return self._damage_fitted(part, told.fitted)
        return ""

    def _damage_fitted(self, part: Part, fitted: Mapping[str, object]) -> str:
        """Say why a fitted tile is not what was written; it is to replace another."""
        path = self.part_folder(part) / Stream.FIELD / str(fitted_name(fitted))
        if path.suffix != SUFFIX or not path.exists():
            return ""  # of the version before, or moved by an earlier gathering
        try:
            tile = TileFile(path)
            tile.check()
            found = checksum_of(tile.index.values())
        except FieldError as e:
            return str(e)
        return "" if fitted.get("checksum", found) == found else f"{path} is another part's"

    @contextmanager
    def scene(self) -> Iterator[tuple[bpy.types.Scene, str]]:
        """Give the scene and view layer of the job in this file the job's settings for a while.

        At the end the scene has its own settings and its frame again. Raises FarmError where the
        job was planned from another file.
        """
        scene = _scene(self.head.scene, self.head.library)
        layer = self.head.view_layer
        if scene is None or layer not in scene.view_layers:
            raise FarmError(
                f"there is no scene '{self.head.scene}' with a view layer '{layer}' in this file: "
                f"open the one that was planned, {self.head.blend}"
            )
        to_front(scene)
        before = settings_of(scene)
        with frame_kept(scene):
            try:
                _set(scene, self.head.settings)
                yield scene, self.head.view_layer
            finally:
                _set(scene, before)


def _scene(name: str, library: str) -> bpy.types.Scene | None:
    """The scene of a name that is from a library of a file name, or from the file itself."""
    found = [
        scene
        for scene in bpy.data.scenes
        if scene.name == name and Path(home.library_of(scene)).name == library
    ]
    return found[0] if len(found) == 1 else None


def set_folder(folder: Path, frame: int, take: Take) -> Path:
    """The folder of the capture set of a take of a frame, in a job's folder."""
    return folder / (f"frame_{frame:04d}" + (f"_{take}" if take else ""))


def _set(scene: bpy.types.Scene, settings: Mapping[str, object]) -> None:
    for name in settings:
        if name not in scene.arto.bl_rna.properties:
            raise FarmError(f"this ARTO has no setting '{name}': use the one that planned")
    for name in FARM:
        if name in settings:
            value = settings[name]
            try:
                setattr(scene.arto, name, set(value) if isinstance(value, list) else value)
            except (TypeError, ValueError, OverflowError) as e:
                raise FarmError(
                    f"the job's setting '{name}' cannot be {value!r:.60} ({e}): plan again"
                ) from e


def estimate(head: CaptureHead, fitted: bool) -> Estimate:
    """Estimate a take of a frame: all its tiles, with one seed. fitted: see `room.estimate`."""
    tiles = [tile.region for tile in head.tiles]
    images = [len(some) for some in plan_of(head)]
    return room.estimate(images, tiles, len(head.hemicube), fitted)


def settings_of(scene: bpy.types.Scene) -> dict[str, object]:
    """The settings of a scene that a farm's job carries."""
    found = {}
    for name in FARM:
        value = getattr(scene.arto, name)
        found[name] = sorted(value) if isinstance(value, set) else value
    if samples_told(scene):
        found["quality"] = Quality.CUSTOM
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
    """Write `job.json` and open the job.

    subframe: the same for all frames; catchers: the frames that show shadow catchers. Raises
    FarmError.
    """
    blend = Path(home.file())
    head = JobHead(
        blend=blend.name,
        blender=bpy.app.version_string,
        scene=scene.name,
        library=Path(home.library_of(scene)).name,
        scripts=not bpy.app.autoexec_fail,
        view_layer=view_layer,
        settings=settings_of(scene),
        frames=tuple(frames),
        subframe=subframe,
        catchers=tuple(catchers),
        tiles=tiles,
        seeds=seeds,
    )
    heads.write(folder, head)
    return Job(folder)
