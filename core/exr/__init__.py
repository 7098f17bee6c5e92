"""EXR files: reading (`reading`, `layers`) and writing (`writing`) through one door.

`opening`, `head` and `layout` check that all of a file is there, and read its headers, of which
`attributes` are the values. `window` is the place of a picture in what is delivered. Pixels are
packed and unpacked by a `library`: `open_exr` outside Blender, `open_image_io` inside.
"""

from __future__ import annotations

from .attributes import TimeCode
from .layers import Layers
from .library import choose, chosen
from .open_exr import OpenExr
from .open_image_io import OpenImageIo, imported
from .reading import header, part_names, parts, read, whole_parts, windows
from .writing import COMPRESSIONS, HALF, as_half, write, write_layered, write_planes

__all__ = [
    "COMPRESSIONS",
    "HALF",
    "Layers",
    "OpenExr",
    "OpenImageIo",
    "TimeCode",
    "as_half",
    "choose",
    "chosen",
    "header",
    "imported",
    "part_names",
    "parts",
    "read",
    "whole_parts",
    "windows",
    "write",
    "write_layered",
    "write_planes",
]
