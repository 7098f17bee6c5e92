"""Small pictures for the panels: of plates and of HDRIs."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

import bpy
import bpy.utils.previews
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import ArtoError
from ..shot import watch

WIDTH = 192
_pictures: list[bpy.utils.previews.ImagePreviewCollection] = []
_written: dict[str, int] = {}
# What threads are reading, and what they have read: a plate's path, and its picture or None.
_reading: set[str] = set()
_read_ones: queue.SimpleQueue[tuple[str, NDArray[np.float32] | None]] = queue.SimpleQueue()
# Seconds between two looks at what was read.
_EVERY = 0.1


def of_plate(path: Path) -> int:
    """The icon of a plate on disk; 0 without a plate or without a window.

    A thread reads the file. Meanwhile the icon is that of the plate before, or 0.
    """
    if not _pictures:
        return 0
    try:
        changed = path.stat().st_mtime_ns
    except OSError:
        return 0
    key = str(path)
    if _written.get(key) != changed and key not in _reading:
        _written[key] = changed
        _reading.add(key)
        threading.Thread(target=_read, args=(path, key), daemon=True).start()
        if not bpy.app.timers.is_registered(_show):
            bpy.app.timers.register(_show, first_interval=_EVERY)
    return _pictures[0][key].icon_id if key in _pictures[0] else 0


def _read(path: Path, key: str) -> None:
    """Read a plate and make it small, in a thread."""
    try:
        _read_ones.put((key, displayed(next(iter(exr.read(path).values())))))
    except ArtoError:
        _read_ones.put((key, None))


def _show() -> float | None:
    """Put what was read into icons, and draw the panels again."""
    while not _read_ones.empty():
        key, picture = _read_ones.get()
        _reading.discard(key)
        if picture is not None and _pictures:
            if key in _pictures[0]:
                del _pictures[0][key]
            _put(key, picture)
            watch.redraw()
    return _EVERY if _reading else None


def _put(key: str, picture: NDArray[np.float32]) -> int:
    """Put a picture (h, w, 4), in display values, into an icon -> the icon's number."""
    icon = _pictures[0].new(key)
    height, width = picture.shape[:2]
    side = max(height, width)
    # icons are square: centre the picture in an empty square
    square = np.zeros((side, side, 4), np.float32)
    top, left = (side - height) // 2, (side - width) // 2
    square[top : top + height, left : left + width] = picture
    icon.image_size = (side, side)
    icon.image_pixels_float.foreach_set(np.ascontiguousarray(square[::-1]).ravel())
    return icon.icon_id


def displayed(pixels: NDArray) -> NDArray[np.float32]:
    """Make a scene-linear picture (H, W, 3 or 4) small, in display values -> (h, w, 4)."""
    step = max(1, -(-max(pixels.shape[:2]) // WIDTH))
    h, w = pixels.shape[0] // step * step, pixels.shape[1] // step * step
    blocks = pixels[:h, :w].reshape(h // step, step, w // step, step, -1)
    small = blocks.mean(axis=(1, 3), dtype=np.float64)
    light = np.maximum(np.nan_to_num(small[..., :3], posinf=0, neginf=0), 0)
    # map the mean to a medium grey, and let bright light approach white softly
    light = light / (light + 0.6 * max(float(light.mean()), 1e-9) + 0.2)
    alpha = small[..., 3:4] if small.shape[-1] > 3 else np.ones_like(light[..., :1])
    return np.concatenate([light ** (1 / 2.2), np.clip(alpha, 0, 1)], axis=-1).astype(np.float32)


def of_file(path: str, world: str = "") -> int:
    """The icon of an HDRI, or of a world in a .blend, which Blender reads meanwhile; 0 without a
    window."""
    if not _pictures:
        return 0
    key = f"{path}/World/{world}" if world else path
    if key not in _pictures[0]:
        _pictures[0].load(key, key, "BLEND" if world else "IMAGE")
    return _pictures[0][key].icon_id


def of_hdri(image: bpy.types.Image) -> int:
    """The icon of an HDRI."""
    preview = image.preview_ensure()
    return preview.icon_id if preview else 0


def register() -> None:
    if not bpy.app.background:
        _pictures.append(bpy.utils.previews.new())


def unregister() -> None:
    if bpy.app.timers.is_registered(_show):
        bpy.app.timers.unregister(_show)
    _written.clear()
    _reading.clear()
    while _pictures:
        bpy.utils.previews.remove(_pictures.pop())
