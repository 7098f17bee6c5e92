"""Previews: what a field shows in a light, at the size that there is time for.

A field has proxies at a half, a quarter and an eighth (see `proxy`). Here they are opened when they
are asked for, and how long each took is kept, so that who drags a slider gets the largest that is
quick enough.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .catcher import catch, held_out
from .field.field import HEADER, Field, proxy_folder
from .field.merged import merged
from .field.proxy import FACTORS
from .hemicube import Hemicube
from .light.light import PatchLight
from .relight import relights

# Seconds of a pixel and patch, until one was measured.
_GUESS = 2e-9


class Preview:
    """The fields of a shot, whole and as proxies.

    takes: one field, or the three of a shot with shadow catchers (of everything, of the catchers,
    of the things, see `catcher`); holds_out: whether anything cuts holes into the picture.
    """

    def __init__(self, takes: Sequence[Field], holds_out: bool = False) -> None:
        self.takes, self.holds_out = tuple(takes), holds_out
        self._levels: dict[int, tuple[Field, ...]] = {1: self.takes}
        self._seconds: dict[int, float] = {}
        self.factors = [1] + [
            f for f in FACTORS if all((proxy_folder(t.folder, f) / HEADER).is_file() for t in takes)
        ]

    @property
    def hemicube(self) -> Hemicube:
        return self.takes[0].hemicube

    def level(self, factor: int) -> tuple[Field, ...]:
        """The fields at 1 / factor of the size. Raises FieldError."""
        if factor not in self._levels:
            self._levels[factor] = tuple(merged(t.proxy(factor)) for t in self.takes)
        return self._levels[factor]

    def shape(self, factor: int) -> tuple[int, int]:
        """Height and width of the picture at 1 / factor of the size."""
        return self.level(factor)[0].shape

    def factor_for(self, seconds: float) -> int:
        """The least factor, which is the largest picture, that takes no longer than so many
        seconds, as far as is known; the greatest where none does."""
        height, width = self.takes[0].shape
        whole = height * width * len(self.hemicube) * len(self.takes) * _GUESS
        for factor in self.factors:
            if self._seconds.get(factor, whole / factor**2) <= seconds:
                return factor
        return self.factors[-1]

    def picture(
        self,
        light: PatchLight,
        factor: int = 1,
        own: float = 1.0,
        gains: Mapping[str, float] | None = None,
    ) -> NDArray[np.float32]:
        """The picture in a light -> (h, w, 4), scene-linear, premultiplied; of a shot with shadow
        catchers, as its plate is, with their shadows in its alpha.

        own, gains: of the scene's own lamps, see `own_light`.
        """
        begun = time.perf_counter()
        found = []
        fields = self.level(factor)
        for field in fields:
            cut = len(fields) > 1 and field is not fields[-1]
            picture = relights(field, [light], 0.0, cut=cut)[0]
            picture[..., :3] += own_light(field, own, gains)
            np.maximum(picture, 0, out=picture)
            found.append(picture)
        out = found[0]
        if len(found) > 1:
            whole, alone, apart = found
            alphas = whole[..., 3], alone[..., 3], apart[..., 3]
            held = held_out(*alphas) if self.holds_out else 0.0
            out = catch(whole[..., :3], alone[..., :3], apart, alone[..., 3], held).plate
        took = time.perf_counter() - begun
        # what is nearest to the last ones: a machine is busy now and idle then
        self._seconds[factor] = took + 0.5 * (self._seconds.get(factor, took) - took)
        return out


def own_light(
    field: Field, own: float = 1.0, gains: Mapping[str, float] | None = None
) -> NDArray[np.float32]:
    """The light of a scene's own lamps and of what emits in it -> (H, W, 3).

    own: how much of it; gains: by the name of a light group, how much of that group (default 1).
    """
    out = field.layer("own")
    for name in field.own_layers:
        gain = (gains or {}).get(name.removeprefix("own_"), 1.0)
        if gain != 1.0:
            out = out + np.float32(gain - 1.0) * field.layer(name)
    # what is left where a group is switched off is nothing, but for rounding
    return np.float32(own) * np.maximum(out, 0)
