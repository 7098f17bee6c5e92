"""The heads of a farm's files, checked: `job.json` of a job, and `part.json` of a rendered part.

Only the functions here read and write these files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

from ...core import signed
from ...core.capture.head import LARGEST_FRAME, LONGEST
from ...core.capture.kinds import Take
from ...core.capture.tile_entry import MOST_SAMPLES, checked_sums, fitted_name
from ...core.errors import FarmError
from ...core.field.writer import tile_names
from ...core.values import Values
from ..settings.table import SETTINGS
from ..stage.takes import TAKES

FORMAT = "ARTO farm job"
# Version 1 has only the first take of each frame.
VERSION = 2
READABLE = (1, VERSION)
HEADER = "job.json"
PART_HEADER = "part.json"
# The most frames, tiles, seeds or parts that a job may have.
MOST = 1_000_000


@dataclass(frozen=True)
class Part:
    """A part of a job.

    Parameters
    ----------
    number : the part's number in the job.
    frame, tile : a tile of the frame's capture set.
    seed : 0 for the first of the job's seeds, and so on.
    take : a take of the frame.
    """

    number: int
    frame: int
    tile: int
    seed: int
    take: Take = Take.WHOLE

    @property
    def name(self) -> str:
        return f"part_{self.number:04d}"

    def file_name(self, render: int) -> str:
        """The name of a render of this part among the files of its capture set."""
        return f"tile_{self.tile:04d}_seed_{self.seed:02d}_{render:04d}.exr"

    def rendered_name(self, render: int) -> str:
        """The name of a render that a Blender without ARTO makes, as Blender numbers frames."""
        sign = "-" if self.frame < 0 else ""
        return f"{self.name}_{render:02d}_{sign}{abs(self.frame):04d}.exr"

    def note(self, render: int, key: str | None) -> str:
        """What such a render says of itself in its header. key: of the capture that it is of."""
        take = f", take {self.take}" if self.take else ""
        return (
            f"ARTO part of {key}: frame {self.frame}{take}, tile {self.tile}, seed {self.seed}, "
            f"render {render}"
        )

    @staticmethod
    def read(said: Values) -> Part:
        """Read a part from the values of a `part.json`. Raises FarmError."""
        return Part(
            number=said.whole("number", 0, MOST),
            frame=said.whole("frame", -LARGEST_FRAME, LARGEST_FRAME),
            tile=said.whole("tile", 0, MOST),
            seed=said.whole("seed", 0, MOST),
            take=said.one_of("take", Take) or Take.WHOLE,
        )

    def to_json(self) -> dict[str, object]:
        said = dict(vars(self))
        if self.take == Take.WHOLE:
            del said["take"]
        return said


@dataclass(frozen=True)
class JobHead:
    """What is to be rendered.

    Parameters
    ----------
    blend : the name of the file that was planned.
    blender : the version of Blender that planned the job.
    scene, view_layer : their names in the file.
    settings : ARTO's settings, by name.
    frames : the numbers of the frames.
    library : the file name of the library that the scene is from, empty for one of the file itself.
    scripts : whether Python in the file was allowed where the job was planned.
    subframe : the same for all frames.
    catchers : the frames that show shadow catchers.
    tiles : how many for each frame.
    seeds : how many for each tile.
    others : all other entries of the file, kept as they are.
    """

    blend: str
    scene: str
    view_layer: str
    settings: Mapping[str, object]
    frames: tuple[int, ...]
    tiles: int
    seeds: int
    subframe: float = 0.0
    catchers: tuple[int, ...] = ()
    blender: str = ""
    library: str = ""
    scripts: bool = False
    others: Mapping[str, object] = field(default_factory=dict)

    @staticmethod
    def read(said: Values) -> JobHead:
        """Read a job from the values of a `job.json`. Raises FarmError."""
        if said.data.get("version") not in READABLE:
            raise said.wrong("version", said.data.get("version"))
        frames = _frames(said, "frames")
        if not frames:
            raise said.wrong("frames", list(frames))
        catchers = _frames(said, "catchers")
        if not set(catchers) <= set(frames):
            raise said.wrong("catchers", list(catchers))
        settings = said.kind("settings", dict, {})
        for setting in SETTINGS:
            value = settings.get(setting.name)
            if setting.name in settings and not setting.can_be(value):
                raise said.wrong(f"settings.{setting.name}", value)
        subframe = said.real("subframe", 0.0, 1.0)
        head = JobHead(
            blend=said.some_text("blend") or "",
            scene=said.some_text("scene") or "",
            view_layer=said.some_text("view_layer") or "",
            settings=settings,
            frames=frames,
            tiles=said.whole("tiles", 1, MOST),
            seeds=said.whole("seeds", 1, MOST),
            subframe=0.0 if subframe is None else subframe,
            catchers=catchers,
            blender=said.some_text("blender") or "",
            library=said.some_text("library") or "",
            scripts=said.kind("scripts", bool, False),
            others=said.others([*_WRITTEN, *(f.name for f in fields(JobHead))]),
        )
        if head.parts > MOST:
            raise said.wrong("tiles", head.tiles)
        if said.data.get("parts", head.parts) != head.parts:
            raise said.wrong("parts", said.data["parts"])
        return head

    def to_json(self) -> dict[str, object]:
        """What `read` reads, in the order in which files have it."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "blend": self.blend,
            "blender": self.blender,
            "scene": self.scene,
            "library": self.library,
            "scripts": self.scripts,
            "view_layer": self.view_layer,
            "settings": dict(self.settings),
            "frames": list(self.frames),
            "subframe": self.subframe,
            "catchers": list(self.catchers),
            "tiles": self.tiles,
            "seeds": self.seeds,
            "parts": self.parts,
            **self.others,
        }

    @property
    def parts(self) -> int:
        """How many parts the job has."""
        catchers = set(self.catchers)
        takes = sum(1 + len(TAKES) * (frame in catchers) for frame in self.frames)
        return takes * self.tiles * self.seeds


# Entries that `to_json` writes and that are no fields of `JobHead`.
_WRITTEN = ("format", "version", "parts")


def _frames(said: Values, name: str) -> tuple[int, ...]:
    """A list of frames; empty where the entry is missing."""
    found = said.kind(name, list, [])
    if (
        len(found) > MOST
        or any(type(frame) is not int or abs(frame) > LARGEST_FRAME for frame in found)
        or len(set(found)) < len(found)
    ):
        raise said.wrong(name, found)
    return tuple(found)


@dataclass(frozen=True)
class PartHead:
    """What a rendered part says of itself.

    Parameters
    ----------
    part : which part of its job.
    key : the key of the capture that the part belongs to.
    samples : the number of samples of each pixel.
    files : the names of the part's EXR files, in its folder.
    seconds : how long the part took.
    fitted : the entry in `field.json`, if the part was fitted and its images removed.
    sums : the checksums of the files, by their names.
    device : what it was rendered with; empty where that is not said.
    """

    part: Part
    key: str
    samples: int
    files: tuple[str, ...]
    seconds: float = 0.0
    fitted: Mapping[str, object] | None = None
    sums: Mapping[str, int] = field(default_factory=dict)
    device: str = ""

    @staticmethod
    def read(said: Values) -> PartHead:
        """From a `part.json`. Raises FarmError."""
        files = said.kind("files", list, [])
        part = Part.read(said.inside(said.kind("part", dict, {}), "part", "part."))
        fitted = said.kind("fitted", dict)
        # The named file later replaces a file of the frame's field: accept only names of this tile.
        if fitted is not None and fitted_name(fitted) not in tile_names(part.tile):
            raise said.wrong("fitted", fitted_name(fitted))
        return PartHead(
            part=part,
            key=said.some_text("key") or "",
            samples=said.whole("samples", 1, MOST_SAMPLES),
            files=tuple(said.file_name(name, "files") for name in files),
            seconds=said.real("seconds", 0, LONGEST) or 0.0,
            fitted=fitted,
            sums=checked_sums(said),
            device=said.some_text("device") or "",
        )

    def to_json(self) -> dict[str, object]:
        """What `read` reads, in the order in which files have it."""
        said: dict[str, object] = {
            "part": self.part.to_json(),
            "key": self.key,
            "samples": self.samples,
        }
        if self.fitted is not None:
            said["fitted"] = dict(self.fitted)
        if self.sums:
            said["sums"] = dict(self.sums)
        if self.device:
            said["device"] = self.device
        return said | {"files": list(self.files), "seconds": self.seconds}


def read(folder: Path) -> JobHead:
    """The head of the job in a folder.

    Raises
    ------
    FarmError : where there is none, or it is damaged.
    """
    path = folder / HEADER
    if not path.is_file():
        raise FarmError(f"there is no job in {folder}: run --command arto plan first")
    return JobHead.read(Values(path, lambda text: FarmError(f"{text}: plan again")))


def is_job(path: Path) -> bool:
    """Whether a file is the head of a farm's job, of any version."""
    try:
        return Values(path, FarmError).data.get("format") == FORMAT
    except FarmError:
        return False


def write(folder: Path, head: JobHead) -> None:
    """Write `job.json` into a folder. Raises FarmError."""
    try:
        signed.write(folder / HEADER, head.to_json())
    except OSError as e:
        raise FarmError(f"{folder} cannot be written ({e}): choose another folder") from e


def read_part(folder: Path) -> PartHead | None:
    """Read the head of the part in a folder; None where it is not there. Raises FarmError."""
    path = folder / PART_HEADER
    if not path.is_file():
        return None
    return PartHead.read(Values(path, lambda text: FarmError(f"{text}: render that part again")))


def write_part(folder: Path, head: PartHead) -> None:
    """Write `part.json` into a folder. Raises OSError."""
    signed.write(folder / PART_HEADER, head.to_json())
