"""The support models, one a module, and what a field may be fitted with (paper 3 and 5)."""

from __future__ import annotations

from .base import Support
from .bell import Bell
from .box import Box
from .double import Double
from .leaning import Leaning
from .linear import Linear
from .per_channel import PerChannel
from .quadratic import Quadratic
from .tilted import Gaussian, OrientedBox
from .whole import Whole

WHOLE, LINEAR, BOX, BELL, LEANING = Whole(), Linear(), Box(), Bell(), Leaning()
SUPPORTS: dict[str, Support] = {
    s.name: s
    for s in (
        WHOLE,
        LINEAR,
        BOX,
        Quadratic(),
        OrientedBox(),
        Gaussian(),
        Double(),
        BELL,
        LEANING,
    )
}
PER_CHANNEL: dict[str, Support] = {s.name: PerChannel(s) for s in SUPPORTS.values() if s.parameters}
BY_CODE: dict[int, Support] = {s.code: s for s in (*SUPPORTS.values(), *PER_CHANNEL.values())}
# Codes that are no model: no light, and light too small to be an entry, which is in the rest.
NOTHING, REST = 0, 255

__all__ = [
    "BELL",
    "BOX",
    "BY_CODE",
    "LEANING",
    "LINEAR",
    "NOTHING",
    "PER_CHANNEL",
    "REST",
    "SUPPORTS",
    "WHOLE",
    "Support",
]
