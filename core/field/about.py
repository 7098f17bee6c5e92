"""What a field says of itself: of which shot it is, and what it was made from.

>>> about = About(choice="auto", samples=64, view_layer="ViewLayer")
>>> about.to_json()
{'choice': 'auto', 'samples': 64, 'view_layer': 'ViewLayer'}
>>> about.far is None
True
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ..capture.kinds import Route, Take
from ..description import MOST_TILES
from ..errors import ShotError
from ..shot import Shot
from ..values import Values

# What Blender takes for a frame; a hundred years in seconds; more samples than a renderer counts.
LARGEST_FRAME, LONGEST, MOST_SAMPLES = 2**31 - 1, 3.2e9, 2**31 - 1


@dataclass(frozen=True)
class About:
    """What `field.json` says in `about`. What it does not say is None.

    Parameters
    ----------
    choice : str
        The choice of support models, one of `choice.CHOICES`.
    separate : bool
        Whether each channel has a support of its own.
    scene, file, view_layer, shot, frame
        What was captured.
    colour_space : str
        The space in which light is scene-linear.
    samples : float
        Of each pixel of the capture; 0 where it was rendered without noise.
    far : bool
        Whether the light comes from far away, as a world's does.
    key, fingerprint, route, catchers, take, pair, behind, portals
        As in the head of the capture set, see `core.capture.head`.
    guides : str
        "clean" where albedo and normals were denoised.
    proxy : int
        Of a proxy, how many pixels a side each of its pixels covers.
    draft : bool
        Whether it is a small picture of a capture that is not complete. No plate is made of it.
    fit_seconds, read_seconds : float
        How long the fit took, and how much of that the reading of the images did.
    others : mapping
        What the file says besides; it is written again.
    """

    choice: str | None = None
    separate: bool | None = None
    scene: str | None = None
    colour_space: str | None = None
    samples: float | None = None
    file: str | None = None
    frame: int | None = None
    view_layer: str | None = None
    far: bool | None = None
    key: str | None = None
    fingerprint: Mapping[str, str] | None = None
    route: Route | None = None
    shot: Shot | None = None
    catchers: tuple[str, ...] | None = None
    take: Take | None = None
    pair: str | None = None
    behind: bool | None = None
    portals: bool | None = None
    guides: str | None = None
    proxy: int | None = None
    draft: bool | None = None
    fit_seconds: float | None = None
    read_seconds: float | None = None
    others: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def read(said: Values) -> About:
        """From the `about` of a `field.json`.

        Parameters
        ----------
        said : Values
            That object, in its file.

        Returns
        -------
        About
            With every value of its kind and within its bounds.

        Raises
        ------
        FieldError
            If a value is not, naming it.
        """
        there = said.kind("shot", dict)
        try:
            shot = Shot.from_json(there) if there else None
        except ShotError as e:
            raise said.damaged("shot", e) from e
        return About(
            choice=said.some_text("choice"),
            separate=said.kind("separate", bool),
            scene=said.some_text("scene"),
            colour_space=said.some_text("colour_space"),
            samples=said.real("samples", 0, MOST_SAMPLES),
            file=said.some_text("file"),
            frame=said.count("frame", -LARGEST_FRAME, LARGEST_FRAME),
            view_layer=said.some_text("view_layer"),
            far=said.kind("far", bool),
            key=said.some_text("key"),
            fingerprint=said.texts("fingerprint") if said.kind("fingerprint", dict) else None,
            route=said.one_of("route", Route),
            shot=shot,
            catchers=said.names("catchers", MOST_TILES),
            take=said.one_of("take", Take),
            pair=said.some_text("pair"),
            behind=said.kind("behind", bool),
            portals=said.kind("portals", bool),
            guides=said.some_text("guides"),
            proxy=said.count("proxy", 1, 64),
            draft=said.kind("draft", bool),
            fit_seconds=said.real("fit_seconds", 0, LONGEST),
            read_seconds=said.real("read_seconds", 0, LONGEST),
            others=said.others([f.name for f in fields(About)]),
        )

    def to_json(self) -> dict[str, Any]:
        """What `read` reads. What is None is left out.

        Returns
        -------
        dict
            As `json` writes it.
        """
        out: dict[str, Any] = {}
        for name in (f.name for f in fields(About) if f.name != "others"):
            value = getattr(self, name)
            if isinstance(value, Shot):
                value = value.to_json()
            elif isinstance(value, tuple):
                value = list(value)
            if value is not None:
                out[name] = value
        return out | dict(self.others)
