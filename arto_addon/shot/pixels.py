"""Digests of images: of painted and generated pixels, of packed data, and of files.

In the window a digest of many bytes is made in a thread, and kept for as long as Blender reports no
change of the image. Until it is there, the image has a digest of its own that no other image has.
"""

from __future__ import annotations

import hashlib
import threading
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import bpy
import numpy as np

from . import external, walk

# So many bytes are read in a moment: they are read at each look.
FEW = 1 << 22


@dataclass
class _Kept:
    """A digest that is made in a thread. of: by what one sees that the image has changed."""

    of: object
    digest: str = ""
    thread: threading.Thread = field(default_factory=threading.Thread)


_kept: dict[int, _Kept] = {}
# How often Blender reported a change of an image, by the image's `session_uid`.
_changes: Counter[int] = Counter()
# Called when a digest is begun in a thread.
begun: Callable[[], None] | None = None


def forget(changed: Iterable[int] | None = None) -> None:
    """Note that images have changed. changed: their `session_uid`s; None for all."""
    if changed is None:
        _kept.clear()
    else:
        _changes.update(changed)


def reading() -> bool:
    """Whether a digest is being made."""
    return any(kept.thread.is_alive() for kept in _kept.values())


def image(
    block: bpy.types.Image, then: str = "", full: bool = False, frame: int | None = None
) -> str:
    """The digest of an image: of its painted or generated pixels, else of packed data or the file.

    then: the digest that the new one will be compared with. A file with a new time and the same
    size is read. If its contents are the same, the answer is `then`. full: read all of it now.
    frame: at which a sequence is shown; None where that does not count.
    """
    painted = block.is_dirty or (block.source == "GENERATED" and not block.packed_file)
    if not painted and not block.packed_files:
        if block.source in {"TILED", "SEQUENCE"}:
            return external.digest(external.of_image(block, frame), then, full)
        return walk.file(block.filepath, block.library, then, full)
    size = block.size[0] * block.size[1] * 16
    if not painted:
        size = packed_size(block)
    if full or bpy.app.background or size <= FEW:
        return _digest(_bytes(block, painted))
    return _in_thread(block, painted)


def packed_size(block: bpy.types.Image) -> int:
    """The bytes of an image that are packed into the .blend."""
    return sum(packed.packed_file.size for packed in block.packed_files if packed.packed_file)


def version(block: bpy.types.Image) -> str:
    """What says whether an image is as it was: of its settings, and of its pixels without a file.

    In the window the pixels are not read: they are others once Blender reports a change.
    """
    painted = block.is_dirty or (block.source == "GENERATED" and not block.packed_file)
    seen = image(block) if bpy.app.background else _seen(block, painted)
    return f"{walk.Walk(block).digest} {seen}"


def _seen(block: bpy.types.Image, painted: bool) -> tuple[object, ...]:
    """By what one sees that an image has changed, without reading it."""
    packed = [(p.packed_file.as_pointer(), p.packed_file.size) for p in block.packed_files]
    return (_changes[block.session_uid], painted, packed, tuple(block.size))


def _bytes(block: bpy.types.Image, painted: bool) -> list[bytes | np.ndarray]:
    if not painted:
        return [packed.packed_file.data for packed in block.packed_files]
    values = np.empty(len(block.pixels), np.float32)
    block.pixels.foreach_get(values)
    return [values]


def _digest(parts: list[bytes | np.ndarray]) -> str:
    out = hashlib.blake2b(digest_size=12)
    for part in parts:
        out.update(part)
    return out.hexdigest()


def _in_thread(block: bpy.types.Image, painted: bool) -> str:
    """The kept digest of an image, which a thread makes; until then a digest of its own."""
    uid = block.session_uid
    of = _seen(block, painted)
    if uid not in _kept or _kept[uid].of != of:
        kept = _kept[uid] = _Kept(of)
        parts = _bytes(block, painted)

        def work() -> None:
            kept.digest = _digest(parts)

        kept.thread = threading.Thread(target=work, daemon=True)
        kept.thread.start()
        if begun:
            begun()
    return _kept[uid].digest or f"being read: {uid} {of}"
