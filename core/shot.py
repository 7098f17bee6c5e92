"""The shot: which picture of which scene a capture, a field and a plate are of.

A shot is told from another by what is in the picture's frame: the scene, the camera and its lens,
the frame, the size. What the scene looks like is not part of it: that is its fingerprint.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import asdict, dataclass, fields
from typing import Any

from .errors import ShotError

# Names that Windows keeps for devices, whatever ending they have.
_DEVICES = {"CON", "PRN", "AUX", "NUL"} | {f"{n}{i}" for n in ("COM", "LPT") for i in range(1, 10)}
# What no file system takes, what Blender's own paths give a meaning to (braces, #, %), and `~`,
# which marks the names that were changed here.
_UNSAFE = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*{}#%~]')
# Of a name in a folder's name, in bytes: three of them and the files below stay under what Windows
# takes for a path, and one under what Linux takes for a name.
_LONGEST = 48


def short_hash(*texts: str) -> str:
    """Six letters that tell texts apart."""
    return hashlib.sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:6]


def safe_name(name: str) -> str:
    """A folder's name for any text: the text itself where every file system takes it.

    Else what is left of it with a mark of the whole, so that two names never come to be one.

    >>> safe_name("Scene"), safe_name("shot 010.v2")
    ('Scene', 'shot 010.v2')
    >>> safe_name("a/b") == safe_name("a:b")
    False
    """
    out = _UNSAFE.sub("_", name).strip(" ").rstrip(". ")
    out = out.encode("utf-8", "replace")[:_LONGEST].decode("utf-8", "ignore").rstrip(". ")
    device = out.split(".")[0].rstrip().upper() in _DEVICES
    if out == name and out and not device:
        return out
    return f"{'_' if device else ''}{out or '_'}~{short_hash(name)}"


@dataclass(frozen=True)
class Shot:
    """A picture of a scene. What an older description does not say is None.

    file: name of the .blend without its ending, empty where it was never saved; scene_id: stays
    with the scene when it or its file is renamed; region: x, y, width, height of what is rendered
    of the picture, from the top; camera_matrix: 16 numbers; lens: what else decides the framing.
    """

    scene: str
    frame: int
    width: int
    height: int
    camera_matrix: tuple[float, ...]
    lens: tuple[Any, ...]
    file: str | None = None
    scene_id: str | None = None
    view_layer: str | None = None
    camera: str | None = None
    subframe: float | None = None
    region: tuple[int, ...] | None = None
    colour_space: str | None = None

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @staticmethod
    def from_json(data: Any) -> Shot:
        """From what `to_json` gave, or the version before it. Raises ShotError."""
        if not isinstance(data, dict):
            raise ShotError(f"this is not the description of a shot: {data!r:.60}")
        if "camera_matrix" not in data and isinstance(data.get("camera"), list):
            # the version before had the camera's matrix by that name
            data = {k: v for k, v in data.items() if k != "camera"} | {
                "camera_matrix": data["camera"]
            }
        try:
            given = {f.name: data[f.name] for f in fields(Shot) if f.name in data}
            for name in ("camera_matrix", "lens", "region"):
                if given.get(name) is not None:
                    given[name] = tuple(given[name])
            out = Shot(**given)
        except TypeError as e:
            raise ShotError(f"this is not the description of a shot: {e}") from None
        for name, kind in (
            ("scene", str),
            ("frame", int),
            ("width", int),
            ("height", int),
            ("file", (str, type(None))),
            ("scene_id", (str, type(None))),
            ("view_layer", (str, type(None))),
            ("camera", (str, type(None))),
            ("subframe", (int, float, type(None))),
            ("colour_space", (str, type(None))),
        ):
            value = getattr(out, name)
            if not isinstance(value, kind) or isinstance(value, bool):
                raise ShotError(f"a shot's {name} cannot be {value!r:.60}")
        numbers = (*out.camera_matrix, *(out.region or ()), out.subframe or 0, out.frame)
        plain = all(type(x) in (int, float) and math.isfinite(x) for x in numbers)
        if not plain or not all(isinstance(x, int | float | str) for x in out.lens):
            raise ShotError("a shot's camera, lens or region is no row of numbers")
        return out

    @property
    def title(self) -> str:
        """The shot in a few words, for messages."""
        return f"'{self.scene}', {self.camera or 'no camera'}, frame {self.frame}"

    @property
    def folders(self) -> tuple[str, str, str]:
        """The names of its folder, from the outside in: file, scene, camera and frame."""
        part = f"_{round(self.subframe * 1000):03d}" if self.subframe else ""
        return (
            safe_name(self.file or "untitled"),
            safe_name(self.scene),
            safe_name(f"{self.camera or 'camera'}_{self.frame:04d}{part}"),
        )

    @property
    def mark(self) -> str:
        """What its folder's name ends in where another shot has taken the name."""
        keys = (self.scene_id, self.view_layer, self.camera, self.frame, self.subframe)
        return short_hash(*map(str, keys))

    def is_place_of(self, other: Shot) -> bool:
        """Whether `other` belongs in this one's folder: the same scene, view layer, camera, frame.

        A camera that was only renamed is the same one.
        """
        return (
            (self.scene_id, self.view_layer, self.frame, self.subframe or 0)
            == (other.scene_id, other.view_layer, other.frame, other.subframe or 0)
        ) and (
            self.camera == other.camera
            or (self.camera_matrix, self.lens) == (other.camera_matrix, other.lens)
        )

    def difference(self, now: Shot) -> str | None:
        """How the shot that is `now` differs from this one, in words; None where it does not."""
        if None not in (self.scene_id, now.scene_id):
            if self.scene_id != now.scene_id:
                return f"another scene ({self.scene}, now {now.scene})"
        elif self.scene != now.scene:
            return f"another scene ({self.scene}, now {now.scene})"
        for name, word in (
            ("view_layer", "view layer"),
            ("width", "width"),
            ("height", "height"),
            ("frame", "frame"),
            ("subframe", "subframe"),
            ("colour_space", "working colour space"),
        ):
            then, there = getattr(self, name), getattr(now, name)
            if None not in (then, there) and then != there:
                return f"another {word} ({then}, now {there})"
        for name, word in (("camera_matrix", "camera"), ("lens", "lens")):
            if tuple(getattr(self, name)) != tuple(getattr(now, name)):
                return f"another {word}"
        return None
