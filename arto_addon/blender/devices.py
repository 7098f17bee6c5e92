"""The devices that Cycles renders with, as its preferences have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

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


# The kinds of GPU that Cycles knows, the quickest of a maker first.
KINDS = ("OPTIX", "CUDA", "HIP", "METAL", "ONEAPI")


def available(kind: str) -> list[str]:
    """The IDs of this machine's devices of a kind, as Cycles finds them now."""
    import _cycles

    return [device[2] for device in _cycles.available_devices(kind) if device[1] == kind]


def _preferences() -> Any:
    """Cycles' preferences; None without Cycles."""
    addon = bpy.context.preferences.addons.get("cycles")
    return addon.preferences if addon else None


def chosen() -> Devices | None:
    """The artist's render devices as they are now in the preferences, saved or not.

    None without Cycles.
    """
    found = _preferences()
    if found is None:
        return None
    if found.compute_device_type in KINDS and not found.devices:
        # Cycles lists them once somebody has opened its preferences
        found.refresh_devices()
    return Devices(
        found.compute_device_type, {device.id: bool(device.use) for device in found.devices}
    )


def use(devices: Devices | None) -> None:
    """Render with the devices that `chosen` gave; with None, change nothing.

    Raises SceneError where Cycles on this machine has no devices of that kind.
    """
    found = _preferences()
    if found is None or devices is None:
        return
    try:
        found.compute_device_type = devices.kind
    except TypeError as e:
        raise SceneError(
            f"Cycles has no render devices of the kind {devices.kind} here: choose others in the "
            "preferences, System, Cycles Render Devices"
        ) from e
    if devices.kind in KINDS:
        # where the preferences were never saved, the list is empty: Cycles would use the CPU
        found.refresh_devices()
    for device in found.devices:
        if device.id in devices.use:
            device.use = devices.use[device.id]


def render_with(scene: bpy.types.Scene, name: str) -> None:
    """Render a scene on the CPU, on the GPUs of this machine, or on those of a kind.

    name: `CPU`, `GPU` or one of `KINDS`; "" changes nothing. The preferences are changed, and not
    saved. Raises SceneError where Cycles finds no such device.
    """
    if name in ("", "CPU"):
        scene.cycles.device = name or scene.cycles.device
        return
    found = _preferences()
    for kind in KINDS if name == "GPU" else (name,):
        there = available(kind) if found else []
        if not there:
            continue
        found.compute_device_type = kind
        found.refresh_devices()
        for device in found.devices:
            device.use = device.type == kind and device.id in there
        scene.cycles.device = "GPU"
        return
    raise SceneError(
        f"Cycles finds no device '{name}' here: see Preferences, System, Cycles Render Devices and "
        "the driver, or render with --device CPU"
    )


def used(scene: bpy.types.Scene) -> str:
    """Name the devices that Cycles renders a scene with, as `CPU` or `OPTIX: its name`."""
    found = _preferences()
    kind = found.compute_device_type if found else ""
    if scene.cycles.device == "CPU" or kind not in KINDS:
        return "CPU"
    there = available(kind)
    names = [d.name for d in found.devices if d.use and d.type == kind and d.id in there]
    return f"{kind}: {', '.join(names)}" if names else "CPU"
