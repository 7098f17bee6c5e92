"""The shot: the picture of a scene that a capture, a field and a plate belong to.

The identity of a shot is what decides the picture's frame: the scene, the camera and its lens, the
frame and the size. The look of the scene is kept apart from it, in the fingerprint.

Examples
--------
>>> Shot("Kitchen", 7, 960, 540, (), (), camera="Close").folders
('untitled', 'Kitchen', 'Close_0007')
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from .description import is_finite
from .errors import ShotError
from .file_names import safe_name, short_hash


@dataclass(frozen=True)
class Shot:
    """A picture of a scene.

    None stands for what an older description does not say.

    Parameters
    ----------
    scene : str
        The scene's name.
    frame : int
    width, height : int
        The size of the picture in pixels.
    camera_matrix : tuple of 16 float
        The camera's matrix to the world, row by row.
    lens : tuple
        The numbers and names besides the matrix that decide the framing.
    file : str, optional
        The name of the .blend file without its ending; empty where it was never saved.
    scene_id : str, optional
        Stays with the scene when the scene or its file is renamed.
    view_layer, camera : str, optional
    subframe : float, optional
        The part of a frame after `frame`, 0 to 1.
    region : tuple of 4 int, optional
        x, y, width, height of the part of the picture that is rendered; rows from the top.
    colour_space : str, optional
        Blender's name of the working colour space.
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
        """Give the shot as an object of a description.

        Returns
        -------
        dict
        """
        return asdict(self)

    @staticmethod
    def from_json(data: Any) -> Shot:
        """Read a shot from an object of a description, of this version or the one before.

        Parameters
        ----------
        data : dict

        Returns
        -------
        Shot

        Raises
        ------
        ShotError
            The object is no description of a shot, or a value of it is of the wrong kind.
        """
        if not isinstance(data, dict):
            raise ShotError(f"this is not the description of a shot: {data!r:.60}")
        if "camera_matrix" not in data and isinstance(data.get("camera"), list):
            # the version before called the camera's matrix `camera`
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
        if None in (given["camera_matrix"], given["lens"]) or not 0 <= (out.subframe or 0) <= 1:
            raise ShotError("a shot's camera, lens or subframe is missing or cannot be")
        numbers = (*out.camera_matrix, *(out.region or ()), out.subframe or 0, out.frame)
        if not all(map(is_finite, numbers)) or not all(
            isinstance(x, int | float | str) for x in out.lens
        ):
            raise ShotError("a shot's camera, lens or region is no row of numbers")
        return out

    @property
    def title(self) -> str:
        """The shot in a few words, for messages."""
        return f"'{self.scene}', {self.camera or 'no camera'}, frame {self.frame}"

    @property
    def folders(self) -> tuple[str, str, str]:
        """The names of the shot's folder, from the outside in: file, scene, camera with frame."""
        part = f"_{round(self.subframe * 1000):03d}" if self.subframe else ""
        return (
            safe_name(self.file or "untitled"),
            safe_name(self.scene),
            safe_name(f"{self.camera or 'camera'}_{self.frame:04d}{part}"),
        )

    @property
    def mark(self) -> str:
        """The ending of the folder's name where another shot has taken the name already."""
        keys = (self.scene_id, self.view_layer, self.camera, self.frame, self.subframe)
        return short_hash(*map(str, keys))

    def is_place_of(self, other: Shot) -> bool:
        """Say whether another shot belongs into this shot's folder.

        It does if scene, view layer, camera and frame are the same. A camera that has only been
        renamed is the same one: its matrix and lens tell.

        Parameters
        ----------
        other : Shot

        Returns
        -------
        bool
        """
        return (
            (self.scene_id, self.view_layer, self.frame, self.subframe or 0)
            == (other.scene_id, other.view_layer, other.frame, other.subframe or 0)
        ) and (
            self.camera == other.camera
            or (self.camera_matrix, self.lens) == (other.camera_matrix, other.lens)
        )

    def difference(self, now: Shot) -> str | None:
        """Say in words how another shot differs from this one.

        Parameters
        ----------
        now : Shot
            The other shot, as it is now.

        Returns
        -------
        str or None
            None where the two are the same.
        """
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
