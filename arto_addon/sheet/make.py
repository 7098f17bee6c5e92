"""Make a contact sheet: the plates that are missing, and all of them in one picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.errors import SceneError
from ...core.files import is_writable
from ...core.photographs import png_file
from ..plate.marks import SHEET
from ..plate.names import relit_file
from ..relight import ahead
from ..relight.ahead import Wanted
from ..relight.many import made
from ..relight.outputs import check_beside
from ..shot import home
from ..work import PLAIN, Batch, Progress, Steps, Wrote, looked, part_of
from .cells import Cell, cell_of, through, to_make, wanted
from .layout import AROUND, GAP, LINE, WIDEST, Layout, layout
from .words import Words, write

# Of a light key, so many letters are on the sheet. All of it is in the file's text.
LETTERS = 8


def sheet_of(scene: bpy.types.Scene) -> Path:
    """Where the button puts the sheet: beside the plate. Raises what `relit_file` raises."""
    path = relit_file(scene, look="")
    return path.with_name(f"{path.stem}_sheet.png")


def check(scene: bpy.types.Scene, path: Path) -> None:
    """Raise SceneError where a sheet cannot be written, or would be over a file of others."""
    if path.suffix.lower() != ".png":
        raise SceneError(f"a sheet is a PNG file, and {path.name} has another ending: give it .png")
    if not is_writable(path.parent):
        raise SceneError(f"nothing can be written into {path.parent}: choose another place")
    check_beside(scene, path, path)


def make(
    scene: bpy.types.Scene,
    view_layer: str,
    path: Path,
    worlds: Sequence[Path] = (),
    frames: Sequence[int] = (),
    cameras: Sequence[str] = (),
    batch: Batch = PLAIN,
) -> Steps[Path]:
    """Put plates by their lights, cameras and frames onto one sheet -> its path.

    path: of the PNG file; worlds: environment maps in place of the looks; frames: default: the
    scene's present one; cameras: names, default: the scene's own; batch: what a plate that cannot
    be made means. Plates that are up to date, by their light key, are not made again. The scene is
    put back to its camera and its frame. Raises what `relight_many` raises.
    """
    check(scene, path)
    scene.view_layers[view_layer].update()
    views = {}
    for camera in cameras or [""]:
        with through(scene, view_layer, camera) as other:
            views[camera] = wanted(scene, worlds, frames, other)
    every = [one for some in views.values() for one in some]
    for error in ahead.same_names(every).values():
        raise error
    left: dict[str, list[Wanted]] = {}
    for camera, some in views.items():
        with through(scene, view_layer, camera):
            wrong = yield from ahead.look(scene, view_layer, some, batch.strict)
            named = {one.path.name: error for one, error in wrong.items()}
            yield from looked(named, len(some), "pictures", batch)
            left[camera] = [one for one in some if one not in wrong]
    for i, (camera, some) in enumerate(left.items()):
        with through(scene, view_layer, camera):
            new = to_make(scene, view_layer, some)
            yield Progress(0.9 * i / len(left), f"{len(some) - len(new)} plates are up to date")
            steps = made(scene, view_layer, new, batch)
            done = yield from part_of(steps, 0.9 * i / len(left), 0.9 / len(left))
            left[camera] = [one for one in some if one not in new or one.path in done]
    cells: list[Cell] = []
    shown = sum(map(len, left.values()))
    for camera, some in left.items():
        with through(scene, view_layer, camera):
            for one in some:
                yield Progress(0.9 + 0.08 * len(cells) / shown, f"showing {one.path.name}")
                cells.append(cell_of(scene, view_layer, one, WIDEST))
    if not cells:
        raise SceneError("none of the pictures could be made: see what was said of each")
    title = Path(home.file()).stem or scene.name
    listed = [
        {"plate": c.path.name, "light": c.light, "camera": c.camera, "frame": c.frame, "key": c.key}
        for c in cells
    ]
    png_file.write(path, drawn(title, cells), {SHEET: json.dumps(listed)})
    yield Wrote(1.0, f"wrote {path}, a sheet of {len(cells)} plates", path)
    return path


def drawn(title: str, cells: Sequence[Cell]) -> NDArray[np.uint8]:
    """Draw a sheet -> (H, W, 3): a row for each light, a column for each camera and frame."""
    lights = list(dict.fromkeys(cell.light for cell in cells))
    views = list(dict.fromkeys((cell.camera, cell.frame) for cell in cells))
    width, height = (max(cell.picture.shape[axis] for cell in cells) for axis in (1, 0))
    grid: Layout = layout(len(lights), len(views), width, height)
    out = np.full((*grid.size, 3), AROUND, np.float32)
    words = [Words(title, GAP + LINE - 4, GAP, grid.size[1] - 2 * GAP)]
    for cell in cells:
        at = lights.index(cell.light) * len(views) + views.index((cell.camera, cell.frame))
        row, column = grid.corner(at)
        rows, columns = cell.picture.shape[:2]
        out[row : row + rows, column : column + columns] = cell.picture
        under, most = row + grid.height + LINE, grid.cell[1] - GAP
        words.append(Words(cell.light, under, column, most))
        said = f"{cell.key[:LETTERS]} · frame {cell.frame} · {cell.camera}"
        words.append(Words(said, under + LINE, column, most, 0.6))
    write(out, words)
    return np.rint(np.clip(out, 0, 1) * 255).astype(np.uint8)
