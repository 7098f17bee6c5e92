"""Everything of ARTO that touches Blender: scene in, capture set, field and plate out."""

from __future__ import annotations

import bpy

from .job import session
from .shot import scene_id, watch
from .ui import cli, groups, operators, panels, preferences, properties, window

_CLASSES = (
    *properties.CLASSES,
    *preferences.CLASSES,
    *operators.CLASSES,
    *panels.CLASSES,
    *groups.CLASSES,
)
# In this order; the other way round to unregister.
_MODULES = (properties, scene_id, watch, session, window, cli)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
