"""Everything of ARTO that touches Blender: scene in, capture set, field and plate out."""

from __future__ import annotations

import bpy

from .blender import exr_library
from .job import session
from .live import live
from .resident import resident
from .shot import scene_id, watch
from .ui import (
    cli,
    groups,
    kit_files,
    kit_operators,
    look_inside,
    match_operators,
    operators,
    overlay,
    panels,
    photo_operators,
    preferences,
    properties,
    put_there,
    result_operators,
    shot_operators,
    strip,
    switches,
    thumbnails,
    translations,
    window,
)

_CLASSES = (
    *properties.CLASSES,
    *preferences.CLASSES,
    *switches.CLASSES,
    *operators.CLASSES,
    *shot_operators.CLASSES,
    *result_operators.CLASSES,
    *photo_operators.CLASSES,
    *strip.CLASSES,
    *look_inside.CLASSES,
    *match_operators.CLASSES,
    *kit_operators.CLASSES,
    *kit_files.CLASSES,
    *put_there.CLASSES,
    *groups.CLASSES,
    *panels.CLASSES,
)
# Registered in this order, unregistered in the reverse order.
_MODULES = (
    properties,
    switches,
    scene_id,
    watch,
    session,
    resident,
    live,
    thumbnails,
    strip,
    translations,
    overlay,
    window,
    cli,
)


def register() -> None:
    # first: without it no capture could be read, so nothing of ARTO is registered
    exr_library.use_own()
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    for module in _MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(_MODULES):
        module.unregister()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
