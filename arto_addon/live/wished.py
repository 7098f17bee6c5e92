"""The light that a live picture is to show, and the picture that was asked for last."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Light:
    """The light that a live picture is to show.

    key: what the world shows, apart from its strength and turn; own: how much of the scene's own
    lamps; gains: by their light groups; clear: whether the film is transparent; finish: whether a
    relight finishes the picture when the light rests.
    """

    key: str
    strength: float
    turn: float
    own: float
    gains: tuple[tuple[str, float], ...]
    clear: bool
    finish: bool


@dataclass(frozen=True)
class Wished:
    """The picture that was asked for last.

    key: the world's; light: None where the map is of a world that has changed since; image: the
    identity of the map; whole: whether the picture has full size; suns: the identity of the picture
    of the suns; clean: that of the clean picture.
    """

    key: str
    light: Light | None = None
    image: int = 0
    whole: bool = False
    suns: int = 0
    clean: int = 0
