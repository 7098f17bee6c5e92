"""The kinds of captures: each a name that settings and files carry, and that is written once.

Examples
--------
>>> Route("all") is Route.ALL, Take("") is Take.WHOLE
(True, True)
>>> [str(take) for take in Take]
['', 'ground', 'things']
"""

from __future__ import annotations

from enum import StrEnum


class Route(StrEnum):
    """How the basis images of a capture are told apart (paper 4)."""

    ALL = "all"
    """All patches and patterns in one render, by light groups."""
    PATTERN = "pattern"
    """A render for each pattern, with a light group for each patch."""
    SINGLE = "single"
    """A render for each patch and pattern, as in the paper."""
    SAMPLED = "sampled"
    """A render for each pattern, with patches that Cycles samples as lights. No artist chooses this
    route: a capture takes it where light comes in by shadow rays alone."""
    PHOTOGRAPHS = "photographs"
    """No render: photographs of a real thing."""


class Keep(StrEnum):
    """Whether the basis images stay once they were fitted."""

    ALWAYS = "always"
    FITS = "fits"
    """As long as they take no more disk than the artist allows."""
    NEVER = "never"


class Quality(StrEnum):
    """Samples of a capture, as a multiple of the scene's own samples."""

    DRAFT = "DRAFT"
    GOOD = "GOOD"
    FINAL = "FINAL"
    CUSTOM = "CUSTOM"
    """A number of samples that the artist gives."""


class Take(StrEnum):
    """What is in the picture. A shot without shadow catchers has one take, of everything."""

    WHOLE = ""
    GROUND = "ground"
    """The shadow catchers alone."""
    THINGS = "things"
    """What is no shadow catcher, alone."""
