"""The devices that Cycles renders with, as its preferences have them."""

from __future__ import annotations

from typing import Any

import bpy


def chosen() -> dict[str, Any]:
    """The artist's render devices, also where the preferences were not saved."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None:
        return {}
    found = addon.preferences
    return {
        "kind": found.compute_device_type,
        "use": {device.id: bool(device.use) for device in found.devices},
    }


def use(devices: dict[str, Any]) -> None:
    """Render with what the artist renders with; what `chosen` gave says what that is."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None or not devices:
        return
    addon.preferences.compute_device_type = devices["kind"]
    for device in addon.preferences.devices:
        if device.id in devices["use"]:
            device.use = devices["use"][device.id]
