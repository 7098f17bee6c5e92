"""Names of files and folders that every system takes, and that lead nowhere else.

Examples
--------
>>> safe_name("Scene"), safe_name("shot 010.v2")
('Scene', 'shot 010.v2')
>>> safe_name("a/b") == safe_name("a:b")
False
>>> is_plain_name("tile_0000.exr"), is_plain_name("../tile_0000.exr"), is_plain_name("nul.exr")
(True, False, False)
"""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from pathlib import Path
from typing import Any

# Names that Windows keeps for devices, whatever ending they have.
DEVICES = {"CON", "PRN", "AUX", "NUL"} | {f"{n}{i}" for n in ("COM", "LPT") for i in range(1, 10)}
_NAME = re.compile(r"[\w][\w .~-]{0,120}")
# Characters that file systems refuse, characters that have a meaning in Blender's paths (braces, #,
# %), and `~`, which marks the names that were changed here.
_UNSAFE = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*{}#%~]')
# The longest name in bytes. A path of three such folders and a file stays under the limit of
# Windows for paths, and one such name stays under the limit of Linux for names.
_LONGEST = 48


def short_hash(*texts: str) -> str:
    """Make six letters that tell texts apart.

    Parameters
    ----------
    texts : str

    Returns
    -------
    str
        The first six hexadecimal digits of a SHA-256.
    """
    return hashlib.sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:6]


def safe_name(name: str) -> str:
    """Make a name for a folder out of any text.

    A text that every file system takes stays as it is. Of another text remains what can be kept,
    with a mark of the whole text, so that two texts never become one name.

    Parameters
    ----------
    name : str

    Returns
    -------
    str
    """
    out = _UNSAFE.sub("_", name).strip(" ").rstrip(". ")
    out = out.encode("utf-8", "replace")[:_LONGEST].decode("utf-8", "ignore").rstrip(". ")
    device = out.split(".")[0].rstrip().upper() in DEVICES
    if out == name and out and not device:
        return out
    return f"{'_' if device else ''}{out or '_'}~{short_hash(name)}"


def is_plain_name(value: Any) -> bool:
    """Say whether a value is the name of a file or folder, which leads nowhere else on any system.

    Parameters
    ----------
    value : object

    Returns
    -------
    bool
    """
    if not isinstance(value, str) or not _NAME.fullmatch(value) or value.endswith((" ", ".")):
        return False
    return value.split(".")[0].strip().upper() not in DEVICES


def folded(path: Path) -> str:
    r"""Write a path so that all its spellings are one text: for names that are not there yet.

    Links are followed. Disks of Windows and macOS do not tell upper from lower case, nor an
    accented letter from a letter with its accent.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str

    Examples
    --------
    >>> folded(Path("/x/Caf\u00e9.EXR")) == folded(Path("/x/cafe\u0301.exr"))
    True
    """
    text = unicodedata.normalize("NFC", os.path.realpath(path)).casefold()
    return unicodedata.normalize("NFC", text)


def same_file(one: Path, other: Path) -> bool:
    """Say whether two paths lead to one file.

    Where both are there, the system says so. Otherwise their names decide, see `folded`.

    Parameters
    ----------
    one, other : Path

    Returns
    -------
    bool
    """
    try:
        return one.samefile(other)
    except OSError:
        return folded(one) == folded(other)


def is_text(path: Path) -> bool:
    r"""Say whether a path is text, which every library takes, and not any bytes.

    Parameters
    ----------
    path : Path

    Returns
    -------
    bool

    Examples
    --------
    >>> is_text(Path("shot.exr")), is_text(Path("sh\udcfft.exr"))
    (True, False)
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return False
    return "\0" not in str(path)
