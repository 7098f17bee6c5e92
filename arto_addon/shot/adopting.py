"""Using what was captured for another file or scene."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bpy

from ...core import marked
from ...core.capture import head as capture_heads
from ...core.capture.head import HEADER as CAPTURE_HEADER
from ...core.errors import SceneError
from ...core.field import head as field_heads
from ...core.field.head import HEADER as FIELD_HEADER
from ...core.field.writer import write_head
from ...core.files import moved
from ...core.shot import Shot
from ..stage.takes import TAKES
from . import paths, scene_id

# The folders of a shot that another shot may use.
_KINDS: dict[str, marked.Kind] = {
    "capture": "capture",
    "field": "field",
    **dict.fromkeys(TAKES, "take"),
}


def adopt(scene: bpy.types.Scene, view_layer: str, source: Path) -> Path:
    """Use what is in `source` for this shot too; returns the shot's own folder.

    Files are hard links where the disk allows links, which take no room, and copies elsewhere.
    Links are safe because ARTO replaces such files and never changes them. Raises SceneError,
    CaptureSetError, FieldError.
    """
    folder = paths.claim(scene, view_layer)
    own = scene_id.of(scene)
    for name in _KINDS:
        if (source / name).is_dir() and not (folder / name).exists():
            partial: Path | None = None
            try:
                partial = marked.scratch(folder / name, _KINDS[name])
                _share(source / name, partial)
                _give(partial, own)
                moved(partial, folder / name)
                partial = None
            except OSError as e:
                raise SceneError(f"{source / name} cannot be taken over ({e}): make room") from e
            finally:
                if partial:
                    marked.remove_quietly(partial, _KINDS[name], folder)
    paths.forget()
    return folder


def _share(source: Path, target: Path) -> None:
    def link(a: str, b: str) -> str:
        try:
            os.link(a, b)
        except OSError:
            shutil.copy2(a, b)
        return b

    marks = shutil.ignore_patterns(marked.MARK)  # The target has its own mark.
    # a link stays a link, and nothing that reads the copy follows it
    shutil.copytree(source, target, True, marks, link, dirs_exist_ok=True)


def _give(folder: Path, own: str | None) -> None:
    """Make the scene's ID that of a capture set, a field or a take in a folder."""
    for there in (folder, folder / "capture", folder / "field"):
        if (there / CAPTURE_HEADER).is_file():
            head = capture_heads.read(there)
            if head.shot:
                shot = replace(head.shot, scene_id=own)
                capture_heads.write(there, replace(head, shot=shot))
        if (there / FIELD_HEADER).is_file():
            field = field_heads.read(there)
            if field.about.shot:
                shot = replace(field.about.shot, scene_id=own)
                write_head(there, replace(field, about=replace(field.about, shot=shot)))


def adopt_from(scene: bpy.types.Scene, view_layer: str, folder: Path) -> Iterator[tuple[int, Path]]:
    """Use what was captured into a shot's folder, or into the folders of shots below a folder.

    Of a folder above shots, those through this scene's camera and of this view layer are used, each
    at its frame. The scene is left at the last of them. Yields the frame and the shot's own folder,
    one after the other. Raises SceneError where there are none, or two of one frame.
    """
    found = paths.all_in(folder)
    camera = scene.camera.name if scene.camera else ""
    if not any(path == folder for path, _ in found):
        found = [(p, s) for p, s in found if (s.camera, s.view_layer) == (camera, view_layer)]
    if not found:
        raise SceneError(
            f"{folder} holds no captured shot through the camera '{camera}' of the view layer "
            f"'{view_layer}': name the folder of a shot, or one above (//arto/<file>/<scene>)"
        )
    by_frame: dict[tuple[int, float], tuple[Path, Shot]] = {}
    for path, shot in found:
        at = shot.frame, shot.subframe or 0.0
        if at in by_frame:
            raise SceneError(
                f"{by_frame[at][0]} and {path} are both of frame {shot.frame}: name one of them"
            )
        by_frame[at] = path, shot
    for (frame, subframe), (path, _) in sorted(by_frame.items()):
        if len(by_frame) > 1 or path != folder:
            scene.frame_set(frame, subframe=subframe)
        yield frame, adopt(scene, view_layer, path)
