"""Descriptions: small JSON files that say what a folder holds, read without trusting them.

Every value is asked for by its kind and its bounds. A value that is of another kind or out of
bounds is a typed error that names it. A panel reads descriptions while it is drawn, so a damaged
file must lead to no other exception.

Where a description has a digest, the rest is compared with it (`signed`).

Examples
--------
>>> import tempfile
>>> from arto.core.errors import FieldError
>>> folder = tempfile.TemporaryDirectory()
>>> path = Path(folder.name) / "field.json"
>>> _ = path.write_text('{"height": 540, "width": 960, "samples": "many"}')
>>> said = Description(path, FieldError)
>>> said.shape()
(540, 960)
>>> said.number("samples", 0.0)
Traceback (most recent call last):
...
arto.core.errors.FieldError: ... is damaged ('samples' cannot be 'many')
>>> folder.cleanup()
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from .errors import ArtoError, FilesError
from .file_names import is_plain_name
from .region import Region
from .regular import WITHHELD, read_regular
from .signed import parsed

# The largest file that is read. Fingerprints of 100,000 objects take 8 MB. What Python makes of a
# file takes up to eight times as much.
MOST_BYTES = 16 << 20
LARGEST_SIDE = 65536
MOST_TILES = 100_000
_Choice = TypeVar("_Choice", bound=str)


class Description:
    """A JSON object of a regular file.

    Parameters
    ----------
    path : Path
        The file.
    error : callable
        Makes the exception for a text, such as `FieldError`.
    most : int
        The largest size in bytes.

    Raises
    ------
    ArtoError
        What `error` makes: the file cannot be read, is too large, or holds no JSON object.
    FilesError
        The file is withheld: by its permissions, its disk, or too many open files.
    """

    def __init__(
        self, path: Path, error: Callable[[str], ArtoError], most: int = MOST_BYTES
    ) -> None:
        self.path, self.error = path, error
        try:
            text = read_regular(path, most).decode("utf-8")
            self.data: dict[str, Any] = parsed(text)
        except (OSError, ValueError, RecursionError) as e:
            if isinstance(e, OSError) and e.errno in WITHHELD:
                raise FilesError(
                    f"{path} cannot be read ({e}): see its permissions and disk"
                ) from e
            raise error(f"{path} cannot be read ({e})") from e

    def wrong(self, name: str, value: Any) -> ArtoError:
        """Make the error for a value that cannot be right.

        Parameters
        ----------
        name : str
            The name of the value.
        value : object
            What stands there.

        Returns
        -------
        ArtoError
        """
        return self.error(f"{self.path} is damaged ('{name}' cannot be {value!r:.60})")

    def _of(self, where: dict[str, Any], name: str) -> Any:
        if name not in where:
            raise self.error(f"{self.path} lacks '{name}'")
        return where[name]

    def whole(self, name: str, low: int, high: int, where: dict[str, Any] | None = None) -> int:
        """Read an integer within bounds.

        Parameters
        ----------
        name : str
        low, high : int
            The bounds, both included.
        where : dict, optional
            The object that holds the value, if it is not the outermost one.

        Returns
        -------
        int

        Raises
        ------
        ArtoError
            The value is missing, no integer, or out of bounds.
        """
        value = self._of(self.data if where is None else where, name)
        if type(value) is not int or not low <= value <= high:
            raise self.wrong(name, value)
        return value

    def number(
        self, name: str, default: float, low: float = -math.inf, high: float = math.inf
    ) -> float:
        """Read a finite number.

        Parameters
        ----------
        name : str
        default : float
            The number where the description has none.
        low, high : float
            The bounds, both included.

        Returns
        -------
        float

        Raises
        ------
        ArtoError
            The value is no finite number, or out of bounds.
        """
        value = self.data.get(name, default)
        if not is_finite(value) or not low <= value <= high:
            raise self.wrong(name, value)
        return float(value)

    def text(self, name: str, where: dict[str, Any] | None = None) -> str:
        """Read a text.

        Parameters
        ----------
        name : str
        where : dict, optional
            The object that holds the value, if it is not the outermost one.

        Returns
        -------
        str

        Raises
        ------
        ArtoError
            The value is missing, or no text.
        """
        value = self._of(self.data if where is None else where, name)
        if not isinstance(value, str):
            raise self.wrong(name, value)
        return value

    def choice(self, name: str, among: Iterable[_Choice]) -> _Choice:
        """Read one of some texts.

        Parameters
        ----------
        name : str
        among : iterable of str
            The texts that are allowed.

        Returns
        -------
        str
            The member of `among`.

        Raises
        ------
        ArtoError
            The value is missing, or none of the texts.
        """
        value = self._of(self.data, name)
        for choice in among:
            if value == choice:
                return choice
        raise self.wrong(name, value)

    def only(self, *names: str, where: dict[str, Any] | None = None) -> None:
        """Check that an object has no values of other names.

        Parameters
        ----------
        names : str
            The names that are allowed.
        where : dict, optional
            The object, if it is not the outermost one.

        Raises
        ------
        ArtoError
            There is a value of another name. The message names it.
        """
        for name in self.data if where is None else where:
            if name not in names:
                raise self.error(f"{self.path} has an unknown '{name}'")

    def kind(self, name: str, kind: type, default: Any = None) -> Any:
        """Read a value of a type.

        Parameters
        ----------
        name : str
        kind : type
            A truth value counts as `bool` only, and not as an integer.
        default : object, optional
            The value where the description has none, or null.

        Returns
        -------
        object

        Raises
        ------
        ArtoError
            The value has another type.
        """
        value = self.data.get(name)
        if value is None:
            return default
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.wrong(name, value)
        return value

    def texts(self, name: str) -> dict[str, str]:
        """Read an object whose values are texts.

        Parameters
        ----------
        name : str

        Returns
        -------
        dict of str to str
            Empty where the description has none.

        Raises
        ------
        ArtoError
            The value is no object, or holds something else than texts.
        """
        found = self.kind(name, dict, {})
        for key, value in found.items():
            if not isinstance(value, str):
                raise self.wrong(name, {key: value})
        return found

    def shape(self) -> tuple[int, int]:
        """Read the size of the picture.

        Returns
        -------
        tuple of int
            (height, width) in pixels.

        Raises
        ------
        ArtoError
            A side is missing or out of bounds.
        """
        return self.whole("height", 1, LARGEST_SIDE), self.whole("width", 1, LARGEST_SIDE)

    def file_name(self, value: Any, name: str) -> str:
        """Check a name of a file or folder that stands in the description's own folder.

        Parameters
        ----------
        value : object
            What the description holds.
        name : str
            The name of the value, for the error.

        Returns
        -------
        str

        Raises
        ------
        ArtoError
            The value is no name, or would lead out of the folder.
        """
        if not is_plain_name(value):
            raise self.wrong(name, value)
        return value

    def tiles(self) -> list[tuple[Region, dict[str, Any]]]:
        """Read the tiles of the picture.

        Returns
        -------
        list of (Region, dict)
            The region of each tile, inside the picture, and its whole entry.

        Raises
        ------
        ArtoError
            The list or one of the regions is damaged.
        """
        height, width = self.shape()
        entries = self._of(self.data, "tiles")
        if not isinstance(entries, list) or len(entries) > MOST_TILES:
            raise self.wrong("tiles", entries)
        found = []
        for entry in entries:
            if not isinstance(entry, dict):
                raise self.wrong("tiles", entry)
            region = self._of(entry, "region")
            if (
                not isinstance(region, list)
                or len(region) != 4
                or any(type(x) is not int for x in region)
            ):
                raise self.wrong("region", region)
            x, y, w, h = region
            if min(x, y) < 0 or min(w, h) < 1 or x + w > width or y + h > height:
                raise self.wrong("region", region)
            found.append((Region(x, y, w, h), entry))
        return found

    def check_apart(self, regions: list[Region]) -> None:
        """Check that no two tiles have a pixel in common.

        Parameters
        ----------
        regions : list of Region

        Raises
        ------
        ArtoError
            Two regions overlap.
        """
        rows = [(r.y, r.x, r.y + r.height, r.x + r.width) for r in regions]
        # by their tops: a tile can only meet those that have not ended above it
        rows.sort()
        open_rows: list[tuple[int, int, int, int]] = []
        for row in rows:
            open_rows = [r for r in open_rows if r[2] > row[0]]
            if any(r[1] < row[3] and row[1] < r[3] for r in open_rows):
                raise self.wrong("tiles", "two that overlap")
            open_rows.append(row)


def is_finite(value: Any) -> bool:
    """Say whether a value is a finite number that a float can hold.

    Parameters
    ----------
    value : object

    Returns
    -------
    bool
    """
    try:
        return type(value) in (int, float) and math.isfinite(value)
    except OverflowError:
        return False
