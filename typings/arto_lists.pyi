"""The lists of ARTO's settings: entries as `arto_addon/ui/lists.py` describes them."""

from collections.abc import Iterator
from typing import Any, Generic, TypeVar, overload

class Group:
    name: str
    mask: Any
    azimuth: float
    elevation: float
    radius: float
    soft: float

class Look:
    name: str
    world: Any

class Lamp:
    name: str
    show: bool
    gain: float

_Entry = TypeVar("_Entry")

class _Entries(Generic[_Entry]):
    def __iter__(self) -> Iterator[_Entry]: ...
    def __len__(self) -> int: ...
    def __contains__(self, name: str) -> bool: ...
    def __getitem__(self, place: int | str) -> _Entry: ...
    @overload
    def get(self, name: str) -> _Entry | None: ...
    @overload
    def get(self, name: str, default: _Entry) -> _Entry: ...
    def keys(self) -> list[str]: ...
    def add(self) -> _Entry: ...
    def clear(self) -> None: ...
    def find(self, name: str) -> int: ...
    def move(self, source: int, to: int) -> None: ...
    def remove(self, place: int) -> None: ...

Looks = _Entries[Look]
Lamps = _Entries[Lamp]
Groups = _Entries[Group]
