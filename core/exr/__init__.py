"""EXR files: the one door to them (`file`), whether all of a file is there (`layout`), and where a
picture stands in what is delivered (`window`)."""

from __future__ import annotations

from .reading import Layers, header, part_names, parts, read, whole_parts, windows
from .writing import write, write_layered, write_planes

__all__ = [
    "Layers",
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
