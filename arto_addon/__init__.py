"""Everything of ARTO that touches Blender: scene in, capture set, field and plate out."""

from __future__ import annotations

import bpy

from .ui import cli, operators, panels, properties

_CLASSES = (*properties.CLASSES, *operators.CLASSES, *panels.CLASSES)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    properties.attach()
    cli.register()


def unregister() -> None:
    cli.unregister()
    properties.detach()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
