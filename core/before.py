"""Folders of the version before, which have no mark: their own descriptions say what they are.

Such a folder counts as ARTO's only while it holds nothing but what ARTO writes there.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as folder:
...     _ = (Path(folder) / "capture.json").write_text('{"format": "ARTO capture set"}')
...     is_one(Path(folder), "capture")
False
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from .regular import is_folder, json_object

# No description is larger.
_MOST = 16 << 20
# What systems put into folders by themselves.
_SYSTEM = r"\.DS_Store|Thumbs\.db|desktop\.ini|\.nfs\w+"


def _only(folder: Path, names: str) -> bool:
    """Whether nothing else is in a folder than files and folders of such names."""
    form = re.compile(rf"(?:{names}|{_SYSTEM})(?:\.part)?")
    return all(form.fullmatch(there.name) for there in folder.iterdir())


def _capture_before(folder: Path) -> bool:
    said = json_object(folder / "capture.json", _MOST)
    ours = said.get("format") == "ARTO capture set" and said.get("version") == 1
    return ours and _only(folder, r"capture\.json|tile_\w+\.exr|field")


def _field_before(folder: Path) -> bool:
    said = json_object(folder / "field.json", _MOST)
    ours = said.get("format") == "ARTO reflectance field" and said.get("version") in (1, 2, 3)
    # of tiles that a capture has fitted as they came, the description is written at the end
    first = folder / "tile_0000.arto"
    ours = ours or (not said and (first.is_file() or _tile_before(folder / "tile_0000")))
    return ours and _only(folder, r"field\.json|tile_\d+(\.arto)?|proxy_\d+")


def _tile_before(folder: Path) -> bool:
    whole = all((folder / f"{name}.npy").is_file() for name in ("peaks", "scales"))
    return is_folder(folder) and whole and _only(folder, r"\w+\.npy")


def _job_before(folder: Path) -> bool:
    said = json_object(folder / "task.json", _MOST)
    ours = all(isinstance(said.get(n), str) for n in ("verb", "scene", "view_layer", "blend"))
    ours = ours and folder.name.startswith("job-") and isinstance(said.get("painted"), list)
    names = (
        r"task\.json|progress\.json|log\.txt|lock|[^/]+\.blend\d?|blendcache_.*|painted_\d+\.npy"
    )
    return ours and _only(folder, names)


def _part_before(folder: Path) -> bool:
    said = json_object(folder / "part.json", _MOST)
    ours = isinstance(said.get("part"), dict) and isinstance(said.get("key"), str)
    return ours and _only(folder, r"part\.json|tile_\w+\.exr|field")


_KINDS: dict[str, Callable[[Path], bool]] = {
    "capture": _capture_before,
    "field": _field_before,
    "tile": _tile_before,
    "job": _job_before,
    "part": _part_before,
}


def is_one(folder: Path, kind: str) -> bool:
    """Say whether a folder without a mark is one of ARTO's.

    Parameters
    ----------
    folder : Path
    kind : str
        One of `marked.Kind`.

    Returns
    -------
    bool
    """
    return kind in _KINDS and _KINDS[kind](folder)
