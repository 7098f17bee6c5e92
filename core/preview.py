"""Previews: what a field shows in a light, at the size that there is time for.

A field has proxies at a half, a quarter and an eighth of its size (`field.proxy`). A preview opens
them when they are first asked for and remembers how long each takes. So an artist who drags a
slider gets the largest picture that is quick enough.

Examples
--------
>>> class Lamps:  # as much of a field as `own_light` asks for
...     own_layers = ["own_Key"]
...     def layer(self, name):
...         return np.full((1, 1, 3), {"own": 1.0, "own_Key": 0.4}[name], np.float32)
>>> [round(float(x), 3) for x in own_light(Lamps(), gains={"Key": 0.5})[0, 0]]
[0.8, 0.8, 0.8]
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .catcher import catch, held_out
from .field.field import Field, proxy_folder
from .field.head import HEADER
from .field.merged import merged
from .field.proxy import FACTORS
from .hemicube import Hemicube
from .light.light import PatchLight
from .relight import relights

# Of the light that gains add or take away, what is rounding.
ROUNDING = np.float32(1e-5)
# Seconds for a pixel and a patch, until a picture was timed.
_GUESS = 2e-9


class Preview:
    """The fields of a shot, whole and as proxies.

    Parameters
    ----------
    takes : sequence of Field
        One field, or the three of a shot with shadow catchers: of everything, of the catchers, of
        the things (`catcher`).
    holds_out : bool
        Whether an object cuts holes into the picture.
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
        """The hemicube of the fields."""
        return self.takes[0].hemicube

    def level(self, factor: int) -> tuple[Field, ...]:
        """Open the fields at a smaller size.

        Parameters
        ----------
        factor : int
            1, 2, 4 or 8: how many times smaller.

        Returns
        -------
        tuple of Field

        Raises
        ------
        FieldError
            A field has no proxy of this factor.
        """
        if factor not in self._levels:
            self._levels[factor] = tuple(merged(t.proxy(factor)) for t in self.takes)
        return self._levels[factor]

    def shape(self, factor: int) -> tuple[int, int]:
        """Give the size of the picture.

        Parameters
        ----------
        factor : int
            How many times smaller.

        Returns
        -------
        tuple of int
            (height, width).
        """
        return self.level(factor)[0].shape

    def through(self, factor: int) -> NDArray[np.float32] | None:
        """Give how much of the world behind is seen, by channel.

        Parameters
        ----------
        factor : int
            How many times smaller.

        Returns
        -------
        (h, w, 3) float32, or None
            None where it is 1 - alpha: of a picture without colours behind clear things, and of a
            shot with shadow catchers.
        """
        fields = self.level(factor)
        return fields[0].through() if len(fields) == 1 else None

    def factor_for(self, seconds: float) -> int:
        """Find the largest picture that is expected to take no longer than a time.

        Parameters
        ----------
        seconds : float

        Returns
        -------
        int
            Its factor; the greatest one, of the smallest picture, where every picture takes longer.
        """
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
        """Compute the picture in a light.

        Parameters
        ----------
        light : PatchLight
        factor : int
            How many times smaller.
        own : float
            The factor for the light of the scene's own lamps.
        gains : dict of str to float, optional
            Factors for the light groups of these lamps, by name, see `own_light`.

        Returns
        -------
        (h, w, 4) float32
            Scene-linear, premultiplied. Of a shot with shadow catchers the shadows are in the
            alpha, as in its plate.
        """
        begun = time.perf_counter()
        found = []
        fields = self.level(factor)
        for field in fields:
            cut = len(fields) > 1 and field is not fields[-1]
            picture = relights(field, [light], 0.0, cut=cut)[0]
            lamps = own_light(field, own, gains)
            # lamps may take light away; a fit that falls below 0 may not
            picture[..., :3] = np.maximum(picture[..., :3] + lamps, np.minimum(lamps, 0))
            found.append(picture)
        out = found[0]
        if len(found) > 1:
            whole, alone, apart = found
            alphas = whole[..., 3], alone[..., 3], apart[..., 3]
            held = held_out(*alphas) if self.holds_out else 0.0
            out = catch(whole[..., :3], alone[..., :3], apart, alone[..., 3], held).plate
        took = time.perf_counter() - begun
        # smoothed, because a machine is busy at one time and idle at another
        self._seconds[factor] = took + 0.5 * (self._seconds.get(factor, took) - took)
        return out


def own_light(
    field: Field, own: float = 1.0, gains: Mapping[str, float] | None = None
) -> NDArray[np.float32]:
    """Compute the light of the scene's own lamps and of what emits in it.

    Parameters
    ----------
    field : Field
    own : float
        The factor for all of it.
    gains : dict of str to float, optional
        The factor for each light group, by name; 1 for the others.

    Returns
    -------
    (H, W, 3) float32
        Scene-linear radiance. Below 0 where lamps or emission of negative strength take light away.
    """
    out = field.layer("own")
    scale: NDArray | float = 0.0
    for name in field.own_layers:
        gain = (gains or {}).get(name.removeprefix("own_"), 1.0)
        if gain != 1.0:
            part = np.float32(gain - 1.0) * field.layer(name)
            out, scale = out + part, scale + np.abs(part)
    # a group that is switched off leaves 0 or, by rounding, a little less
    rounding = (out < 0) & (out > -ROUNDING * scale)
    return np.float32(own) * np.where(rounding, 0, out)
