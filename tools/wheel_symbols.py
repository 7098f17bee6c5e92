"""Make a Linux wheel's library use its own symbols before those of the program that loads it.

Blender is linked with an OpenEXR of its own, whose symbols have the names of the wheel's. The
loader takes Blender's first: compressed reads then report errors, and two versions of one library
work on each other's data. RTLD_DEEPBIND would turn the order round for the allocator as well, which
Blender replaces too: memory of one is then freed by the other, and Blender aborts. The flag
DT_SYMBOLIC in the library turns it round for the library's own symbols alone.
"""

from __future__ import annotations

import base64
import hashlib
import struct
import zipfile
from pathlib import Path

_PT_DYNAMIC, _DT_NULL, _DT_SYMBOLIC = 2, 0, 16
# How many relocations are relative: a hint that the loader can do without, so its entry is free.
_DT_RELACOUNT = 0x6FFFFFF9


def symbolic(library: bytes) -> bytes:
    """The same 64-bit little-endian ELF library with DT_SYMBOLIC set.

    Raises ValueError for another kind of file, or one with no entry to spare.
    """
    if library[:6] != b"\x7fELF\x02\x01":
        raise ValueError("no 64-bit little-endian ELF library")
    (table,) = struct.unpack_from("<Q", library, 0x20)
    entry_size, entries = struct.unpack_from("<HH", library, 0x36)
    for at in range(table, table + entries * entry_size, entry_size):
        kind, _, start = struct.unpack_from("<IIQ", library, at)
        if kind == _PT_DYNAMIC:
            break
    else:
        raise ValueError("no dynamic section")
    tags: dict[int, int] = {}
    while (tag := struct.unpack_from("<Q", library, start)[0]) != _DT_NULL:
        tags[tag] = start
        start += 16
    if _DT_SYMBOLIC in tags:
        return library
    if _DT_RELACOUNT not in tags:
        raise ValueError("no entry of the dynamic section to spare")
    out = bytearray(library)
    struct.pack_into("<QQ", out, tags[_DT_RELACOUNT], _DT_SYMBOLIC, 0)
    return bytes(out)


def copy_symbolic(wheel: Path, folder: Path) -> Path:
    """Copy a wheel into `folder`, its libraries `symbolic`, as build 1; the path of the copy."""
    name, version, tags = wheel.name.split("-", 2)
    path = folder / f"{name}-{version}-1-{tags}"
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        changed: dict[str, str] = {}
        for item in old.infolist():
            data = old.read(item)
            if item.filename.endswith(".so"):
                data = symbolic(data)
                changed[item.filename] = _record(item.filename, data)
            elif item.filename.endswith(".dist-info/WHEEL"):
                data = data.rstrip() + b"\nBuild: 1\n"
                changed[item.filename] = _record(item.filename, data)
            elif item.filename.endswith(".dist-info/RECORD"):  # the last one of a wheel
                rows = data.decode().splitlines()
                data = "".join(changed.get(r.split(",")[0], r) + "\n" for r in rows).encode()
            new.writestr(item, data)
    return path


def _record(name: str, data: bytes) -> str:
    """A file's row in the wheel's list of files."""
    digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
    return f"{name},sha256={digest},{len(data)}"
