"""Values of a description that may be missing: read as their kind, or None.

A description of an older version, or of another program, lacks values that newer ones have. What is
there is still checked: its kind, and its bounds.

Examples
--------
>>> from arto.core.errors import CaptureSetError
>>> said = Values.of({"samples": 64, "seed": -1}, Path("capture.json"), CaptureSetError)
>>> said.real("samples", 0, 1000), said.some_text("scene")
(64, None)
>>> said.count("seed", 0, 1000)
Traceback (most recent call last):
...
arto.core.errors.CaptureSetError: capture.json is damaged ('seed' cannot be -1)
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar

from .description import Description, is_finite
from .errors import ArtoError

# Windows takes no longer path than that, and Blender no longer name.
MOST_TEXT = 1 << 15
_Kind = TypeVar("_Kind", bound=StrEnum)


class Values(Description):
    """A JSON object of a file, some of whose values may be missing.

    Parameters
    ----------
    path, error, most : as of `Description`
    """

    _within = ""

    @classmethod
    def of(
        cls, data: dict[str, Any], path: Path, error: Callable[[str], ArtoError], within: str = ""
    ) -> Values:
        """Take an object that is in memory for a description.

        Parameters
        ----------
        data : dict
            The object.
        path : Path
            The file that it is from, or goes to. Messages name it.
        error : callable
            Makes the exception for a text.
        within : str
            What messages put before the names of the object's values.

        Returns
        -------
        Values
        """
        out = cls.__new__(cls)
        out.path, out.error, out.data, out._within = path, error, data, within
        return out

    def wrong(self, name: str, value: Any) -> ArtoError:
        """Make the error for a value that cannot be right.

        Parameters
        ----------
        name : str
        value : object

        Returns
        -------
        ArtoError
        """
        return super().wrong(self._within + name, value)

    def damaged(self, name: str, why: object) -> ArtoError:
        """Make the error for a value that cannot be right, and say why.

        Parameters
        ----------
        name : str
        why : object
            The reason, in words.

        Returns
        -------
        ArtoError
        """
        return self.error(f"{self.path} is damaged ('{self._within}{name}': {why})")

    def inside(self, value: Any, name: str, within: str = "") -> Values:
        """Take an object in this description for a description.

        Parameters
        ----------
        value : object
            What stands there.
        name : str
            Its name in this description.
        within : str
            What messages put before the names of its own values.

        Returns
        -------
        Values

        Raises
        ------
        ArtoError
            The value is no object.
        """
        if not isinstance(value, dict):
            raise self.wrong(name, value)
        return Values.of(value, self.path, self.error, within)

    def others(self, known: Collection[str]) -> dict[str, Any]:
        """Give what the description says beside some names.

        Parameters
        ----------
        known : collection of str

        Returns
        -------
        dict
        """
        return {name: value for name, value in self.data.items() if name not in known}

    def some_text(self, name: str) -> str | None:
        """Read a text of at most `MOST_TEXT` letters.

        Parameters
        ----------
        name : str

        Returns
        -------
        str or None
            None where the description has none.
        """
        value = self.kind(name, str)
        if value is not None and len(value) > MOST_TEXT:
            raise self.wrong(name, value)
        return value

    def count(self, name: str, low: int, high: int) -> int | None:
        """Read an integer within bounds.

        Parameters
        ----------
        name : str
        low, high : int
            Both included.

        Returns
        -------
        int or None
            None where the description has none.
        """
        return None if self.data.get(name) is None else self.whole(name, low, high)

    def real(self, name: str, low: float, high: float) -> float | None:
        """Read a finite number within bounds, as it is written: an integer stays one.

        Parameters
        ----------
        name : str
        low, high : float
            Both included.

        Returns
        -------
        float or int or None
            None where the description has none.
        """
        value = self.data.get(name)
        if value is None:
            return None
        if not is_finite(value) or not low <= value <= high:
            raise self.wrong(name, value)
        return value

    def pair(self, name: str) -> tuple[float, float] | None:
        """Read two finite numbers that are not below 0.

        Parameters
        ----------
        name : str

        Returns
        -------
        tuple of 2 float or None
            None where the description has none.
        """
        value = self.data.get(name)
        if value is None:
            return None
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise self.wrong(name, value)
        if not all(is_finite(x) and x >= 0 for x in value):
            raise self.wrong(name, value)
        return float(value[0]), float(value[1])

    def one_of(self, name: str, kinds: type[_Kind]) -> _Kind | None:
        """Read one of the names of an enumeration.

        Parameters
        ----------
        name : str
        kinds : type
            The enumeration.

        Returns
        -------
        StrEnum or None
            None where the description has none.
        """
        value = self.kind(name, str)
        if value is None:
            return None
        try:
            return kinds(value)
        except ValueError:
            raise self.wrong(name, value) from None

    def names(self, name: str, most: int) -> tuple[str, ...] | None:
        """Read a list of texts.

        Parameters
        ----------
        name : str
        most : int
            How many texts the list may have.

        Returns
        -------
        tuple of str or None
            None where the description has none.
        """
        value = self.kind(name, list)
        if value is None:
            return None
        if len(value) > most or any(not isinstance(x, str) or len(x) > MOST_TEXT for x in value):
            raise self.wrong(name, value)
        return tuple(value)
