"""Handlers that Blender calls when something happens: a change, an undo, a file that is opened."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy


def add(handlers: Mapping[str, Callable[..., None]]) -> None:
    """Have handlers called. handlers: by the names of Blender's lists."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).append(handler)


def remove(handlers: Mapping[str, Callable[..., None]]) -> None:
    """Have handlers no longer called; nothing happens for those that are not called."""
    for name, handler in handlers.items():
        called = getattr(bpy.app.handlers, name)
        if handler in called:
            called.remove(handler)
