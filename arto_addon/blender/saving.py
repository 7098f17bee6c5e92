"""Saved .blend files: whether all of one is there.

Blender tells nothing where the disk is full as it writes the last of a file.
"""

from __future__ import annotations

import struct
from pathlib import Path

import bpy

from ...core.errors import SceneError

_PLAIN, _PACKED, _TABLE = b"BLENDER", b"\x28\xb5\x2f\xfd", b"\xb1\xea\x92\x8f"


def save() -> None:
    """Save the file that is open under its own name. Raises SceneError."""
    path = Path(bpy.data.filepath)
    try:
        bpy.ops.wm.save_mainfile()
    except RuntimeError as e:
        raise SceneError(
            f"{path} cannot be saved ({e}): see who may write there, and whether the disk is full"
        ) from e
    before = path.with_name(path.name + "1")
    check_whole(path, f"; what it was before is in {before}" if before.is_file() else "")


def check_whole(path: Path, more: str = "") -> None:
    """Raise SceneError where a .blend that was written now is not all there. more: what to add."""
    if not is_whole(path):
        raise SceneError(
            f"Blender has written {path} by a part only{more}: the disk is full, make room on it "
            "and save again"
        )


def is_whole(path: Path) -> bool:
    """Whether a .blend has an end: its last block, or the table after what is packed."""
    try:
        with path.open("rb") as file:
            begins = file.read(7)
            size = file.seek(0, 2)
            file.seek(max(size - 64, 0))
            ends = file.read()
            if begins == _PLAIN:
                return b"ENDB" in ends
            if begins[:4] != _PACKED or ends[-4:] != _TABLE:
                return False
            # the sizes of the packed pieces, and that of their table, make up the file
            count, about = struct.unpack("<IB", ends[-9:-4])
            entry = 12 if about & 0x80 else 8
            table = 8 + count * entry + 9
            file.seek(max(size - table + 8, 0))
            entries = file.read(count * entry)
            packed = sum(struct.unpack_from("<I", entries, i * entry)[0] for i in range(count))
            return packed + table == size
    except (OSError, struct.error):
        return False
