"""All of ARTO's panels, in the order in which they stand."""

from __future__ import annotations

from . import more_panels as more
from .kit_panel import ARTO_UL_kit
from .light_panel import ARTO_UL_looks, LightPanel
from .match_panel import MatchPanel
from .places import panels
from .result_panel import Result
from .shot_panel import Quality, ShotPanel

CLASSES = (
    ARTO_UL_kit,
    ARTO_UL_looks,
    *panels("main", more.Main, sidebar=False),
    *panels("shot", ShotPanel),
    *panels("light", LightPanel),
    *panels("match", MatchPanel),
    *panels("result", Result),
    *panels("quality", Quality, sidebar=False),
    *panels("frames", more.Frames, sidebar=False),
    *panels("layers", more.Layers, sidebar=False),
    *panels("storage", more.Storage, sidebar=False),
    *panels("method", more.Method, sidebar=False),
)
