"""Descriptions: small JSON files that say what a folder holds, read without trusting them.

Every value is asked for by the kind and the bounds that it must have, and what is not so is a typed
error that names it. A panel reads descriptions while it is drawn: nothing else may come of one.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from .errors import ArtoError
from .region import Region

# No description is larger: 100,000 things' fingerprints come to 8 MB.
MOST_BYTES = 64 << 20
LARGEST_SIDE = 65536
MOST_TILES = 100_000
_Choice = TypeVar("_Choice", bound=str)
_NAME = re.compile(r"[\w][\w .~-]{0,120}")


class Description:
    """A JSON object from a file. `error` makes the exception of a text.

    Raises what `error` makes, for a file that cannot be read or is no object.
    """

    def __init__(self, path: Path, error: Callable[[str], ArtoError]) -> None:
        self.path, self.error = path, error
        try:
            if path.stat().st_size > MOST_BYTES:
                raise error(f"{path} cannot be read (it has {path.stat().st_size} bytes)")
            data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
        except (OSError, ValueError, RecursionError) as e:
            raise error(f"{path} cannot be read ({e})") from e
        if not isinstance(data, dict):
            raise error(f"{path} cannot be read (it is no description)")
        self.data: dict[str, Any] = data

    def wrong(self, name: str, value: Any) -> ArtoError:
        """The error of a value that cannot be."""
        return self.error(f"{self.path} is damaged ('{name}' cannot be {value!r:.60})")

    def _of(self, where: dict[str, Any], name: str) -> Any:
        if name not in where:
            raise self.error(f"{self.path} lacks '{name}'")
        return where[name]

    def whole(self, name: str, low: int, high: int, where: dict[str, Any] | None = None) -> int:
        """An integer within bounds, both included."""
        value = self._of(self.data if where is None else where, name)
        if type(value) is not int or not low <= value <= high:
            raise self.wrong(name, value)
        return value

    def number(
        self, name: str, default: float, low: float = -math.inf, high: float = math.inf
    ) -> float:
        """A finite number within bounds, both included, or a default where there is none."""
        value = self.data.get(name, default)
        if type(value) not in (int, float) or not math.isfinite(value) or not low <= value <= high:
            raise self.wrong(name, value)
        return float(value)

    def text(self, name: str, where: dict[str, Any] | None = None) -> str:
        """A text, of the whole description or of an object in it."""
        value = self._of(self.data if where is None else where, name)
        if not isinstance(value, str):
            raise self.wrong(name, value)
        return value

    def choice(self, name: str, among: Iterable[_Choice]) -> _Choice:
        """One of some texts."""
        value = self._of(self.data, name)
        for choice in among:
            if value == choice:
                return choice
        raise self.wrong(name, value)

    def only(self, *names: str, where: dict[str, Any] | None = None) -> None:
        """Raise where the description, or an object in it, has a value of another name."""
        for name in self.data if where is None else where:
            if name not in names:
                raise self.error(f"{self.path} has an unknown '{name}'")

    def kind(self, name: str, kind: type, default: Any = None) -> Any:
        """A value of a type; a default where it is not there or null."""
        value = self.data.get(name)
        if value is None:
            return default
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.wrong(name, value)
        return value

    def texts(self, name: str) -> dict[str, str]:
        """An object of texts, empty where there is none."""
        found = self.kind(name, dict, {})
        for key, value in found.items():
            if not isinstance(value, str):
                raise self.wrong(name, {key: value})
        return found

    def shape(self) -> tuple[int, int]:
        """(height, width) of the picture."""
        return self.whole("height", 1, LARGEST_SIDE), self.whole("width", 1, LARGEST_SIDE)

    def file_name(self, value: Any, name: str) -> str:
        """The name of a file or folder in the description's own folder, and of none elsewhere."""
        if not isinstance(value, str) or not _NAME.fullmatch(value) or value.endswith((" ", ".")):
            raise self.wrong(name, value)
        return value

    def tiles(self) -> list[tuple[Region, dict[str, Any]]]:
        """The tiles: each one's region, inside the picture, and the rest of its entry."""
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
        """Raise where two tiles have a pixel in common."""
        rows = [(r.y, r.x, r.y + r.height, r.x + r.width) for r in regions]
        # sorted by their tops, only tiles that begin above another's end can meet it
        rows.sort()
        open_rows: list[tuple[int, int, int, int]] = []
        for row in rows:
            open_rows = [r for r in open_rows if r[2] > row[0]]
            if any(r[1] < row[3] and row[1] < r[3] for r in open_rows):
                raise self.wrong("tiles", "two that overlap")
            open_rows.append(row)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")
