"""A movie of a turntable: the plates as the scene shows them, encoded by Blender itself."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.files import is_writable, whole
from ...core.photographs import png_file
from ..blender.scratch import temporary
from ..plate import notes
from ..relight import ahead
from ..relight.many import made
from ..relight.outputs import check_beside
from ..shot.home import check_outside
from ..work import PLAIN, Batch, Progress, Steps, Wrote, last_properties_kept, looked, part_of
from .cells import cell_of, to_make

# The ending of a movie's file.
ENDING = ".mp4"


def check(scene: bpy.types.Scene, path: Path) -> None:
    """Raise SceneError where no movie can be written, or where it would be over a file of others.

    A movie of ARTO's is known by its checksum, see `plate.notes`.
    """
    if not bpy.app.build_options.codec_ffmpeg:
        raise SceneError(
            "this Blender was built without FFmpeg, which encodes movies: use one of blender.org, "
            "or relight with --turntable and make the movie of the plates elsewhere"
        )
    if not is_writable(path.parent):
        raise SceneError(f"nothing can be written into {path.parent}: choose another place")
    check_outside(path, "movies")
    if not notes.noted(scene, path):
        check_beside(scene, path, path)


def movie(
    scene: bpy.types.Scene,
    view_layer: str,
    path: Path,
    turns: int,
    worlds: Sequence[Path] = (),
    batch: Batch = PLAIN,
) -> Steps[Path]:
    """Make a movie in which each world turns once around the vertical -> its path.

    turns: the pictures of a turn, which are shown at the scene's frame rate; worlds: environment
    maps, one after the other, in place of the scene's world; batch: what a warning means; a movie
    without one of its pictures is not made. Plates of the scene's world that are up to date are not
    made again. Raises what `relight_many` raises.
    """
    check(scene, path)
    scene.view_layers[view_layer].update()
    every = ahead.wanted(scene, worlds, turns, ())
    wrong = yield from ahead.look(scene, view_layer, every, batch.strict)
    whole_batch = Batch(strict=batch.strict)
    named = {one.path.name: error for one, error in wrong.items()}
    yield from looked(named, len(every), "pictures", whole_batch)
    new = to_make(scene, view_layer, every)
    yield Progress(0.0, f"{len(every) - len(new)} plates are up to date")
    yield from part_of(made(scene, view_layer, new, whole_batch), 0.0, 0.8)
    with temporary() as folder:
        files, size = [], (0, 0)
        for number, one in enumerate(every):
            yield Progress(0.8 + 0.1 * number / len(every), f"showing {one.path.name}")
            picture = _even(cell_of(scene, view_layer, one).picture)
            files.append(folder / f"{number:06d}.png")
            size = picture.shape[:2]
            png_file.write(files[-1], np.rint(255 * picture).astype(np.uint8))
        yield Progress(0.9, "encoding the movie")
        encoded = encode(scene, files, size, folder)
        try:
            with whole(path) as partial:
                shutil.copyfile(encoded, partial)
            notes.note(scene, path)
        except OSError as e:
            raise SceneError(f"{path} cannot be written ({e})") from e
    yield Wrote(1.0, f"wrote {path}, a movie of {len(every)} pictures", path)
    return path


def _even(picture: np.ndarray) -> np.ndarray:
    """A picture without its last row or column where their number is odd, as movies need it."""
    return picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]


def encode(
    scene: bpy.types.Scene, files: Sequence[Path], size: tuple[int, int], folder: Path
) -> Path:
    """Encode pictures of one size as a movie in their folder -> its path.

    scene: whose frame rate is the movie's; size: height and width, even. Raises SceneError.
    """
    path = folder / f"movie{ENDING}"
    on = bpy.data.scenes.new("ARTO Movie")
    try:
        render = on.render
        render.resolution_y, render.resolution_x = size
        render.resolution_percentage = 100
        render.fps, render.fps_base = scene.render.fps, scene.render.fps_base
        on.frame_start, on.frame_end = 1, len(files)
        # the pictures are as on the screen already
        on.view_settings.view_transform = "Standard"
        strips = on.sequence_editor_create().strips
        strip = strips.new_image("Plates", str(files[0]), 1, 1, fit_method="ORIGINAL")
        for file in files[1:]:
            strip.elements.append(file.name)
        settings = render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "VIDEO"
        settings.file_format = "FFMPEG"
        render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
        render.ffmpeg.constant_rate_factor = "HIGH"
        render.ffmpeg.audio_codec = "NONE"
        render.filepath = str(path)
        with last_properties_kept():
            bpy.ops.render.render(animation=True, scene=on.name)
    except (RuntimeError, TypeError) as e:
        raise SceneError(f"Blender could not encode the movie: {e}") from e
    finally:
        bpy.data.scenes.remove(on)
    if not path.is_file() or not path.stat().st_size:
        raise SceneError("Blender has encoded no movie: see what it said in the console")
    return path
