"""EXR files: reading (`reading`, `layers`) and writing (`writing`) through one door (`library`).

`opening` and `layout` check that all of a file is there. `window` is the place of a picture in what
is delivered.
"""

from __future__ import annotations

from .layers import Layers
from .reading import header, part_names, parts, read, whole_parts, windows
from .writing import COMPRESSIONS, HALF, TimeCode, as_half, write, write_layered, write_planes

__all__ = [
    "COMPRESSIONS",
    "HALF",
    "Layers",
    "TimeCode",
    "as_half",
    "header",
    "part_names",
    "parts",
    "read",
    "whole_parts",
    "windows",
    "write",
    "write_layered",
    "write_planes",
]
