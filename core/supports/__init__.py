"""The support models, one a module, and what a field may be fitted with."""

from __future__ import annotations

from .base import Support
from .box import Box
from .linear import Linear
from .whole import Whole

WHOLE, LINEAR, BOX = Whole(), Linear(), Box()
SUPPORTS: dict[str, Support] = {s.name: s for s in (WHOLE, LINEAR, BOX)}
BY_CODE: dict[int, Support] = {s.code: s for s in SUPPORTS.values()}
NOTHING = 0

__all__ = ["BOX", "BY_CODE", "LINEAR", "NOTHING", "SUPPORTS", "WHOLE", "Support"]
