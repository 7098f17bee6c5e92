"""The devices that Cycles renders with, as its preferences have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy

from ...core.errors import SceneError


@dataclass(frozen=True)
class Devices:
    """The artist's render devices.

    kind: the backend, as Cycles' preferences name it (`NONE`, `CUDA`, `OPTIX`, ...); use: by the
    ID of each device, whether Cycles renders with the device.
    """

    kind: str
    use: Mapping[str, bool]


def chosen() -> Devices | None:
    """The artist's render devices as they are now in the preferences, saved or not.

    None without Cycles.
    """
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None:
        return None
    found = addon.preferences
    return Devices(
        found.compute_device_type, {device.id: bool(device.use) for device in found.devices}
    )


def use(devices: Devices | None) -> None:
    """Render with the devices that `chosen` gave; with None, change nothing.

    Raises SceneError where Cycles on this machine has no devices of that kind.
    """
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None or devices is None:
        return
    try:
        addon.preferences.compute_device_type = devices.kind
    except TypeError as e:
        raise SceneError(
            f"Cycles has no render devices of the kind {devices.kind} here: choose others in the "
            "preferences, System, Cycles Render Devices"
        ) from e
    for device in addon.preferences.devices:
        if device.id in devices.use:
            device.use = devices.use[device.id]
