"""Blender's own OpenImageIO, chosen for EXR files."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import bpy

from ...core import exr


def use_own() -> None:
    """Read and write EXR files with Blender's own OpenImageIO from now on.

    Raises ExrError where this Blender has none, as distributions may build it.
    """
    exr.choose(exr.OpenImageIo(own()))


def own() -> ModuleType:
    """Import Blender's own OpenImageIO. Raises ExrError where this Blender has none."""
    return exr.imported(_modules())


def _modules() -> list[Path]:
    """Where a Blender of blender.org has the modules that it brings for Python.

    On most systems Python finds them anyway. Blender as a module (`import bpy`) does not show them.
    """
    library = Path(bpy.utils.resource_path("LOCAL")) / "python" / "lib"
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    return [library / version / "site-packages", library / "site-packages"]
