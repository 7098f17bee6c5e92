"""Handlers that are called when Blender quits."""

from __future__ import annotations

import atexit
from collections.abc import Callable

import bpy

from .version import FIVE


def when_quitting(handler: Callable[..., None]) -> None:
    """Have a handler called when Blender quits."""
    if FIVE:
        bpy.app.handlers.exit_pre.append(handler)
    else:  # Blender 4.5 has no handler for this, but ends its Python in order.
        atexit.register(handler)


def not_when_quitting(handler: Callable[..., None]) -> None:
    """Have a handler no longer called when Blender quits; nothing happens for an unknown one."""
    if not FIVE:
        atexit.unregister(handler)
    elif handler in bpy.app.handlers.exit_pre:
        bpy.app.handlers.exit_pre.remove(handler)
