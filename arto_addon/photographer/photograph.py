"""Photograph: a folder as a laboratory would have it of a thing, with the truth beside it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture import capture_set
from ...core.errors import FilesError, PhotographsError
from ...core.faces import PRESETS
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ...core.photographs import description_file, png_file
from ...core.photographs.description import FILE, Description, Kind, Monitors, Photograph
from ...core.photographs.photographer import DomeRig, Exposing, MonitorRig, spiral
from ...core.photographs.screens import hemicube_of
from ...core.photographs.simulate import Camera
from ..blender.colour import working_space
from ..shot.home import check_outside
from ..work import Progress, Steps, Wrote, part_of
from . import lights

TRUTH = "truth"
# Of JPEG files, as cameras write them.
QUALITY = 95
# How much of the work is the render.
RENDERED = 0.7


@dataclass(frozen=True)
class Setup:
    """What photographs, and how.

    rig: `monitors` or `dome`; monitors: as the laboratory has them; distance: of their cube's
    sides, in radii of the scene, 0 for infinity; falls: the power of the cosine by which their
    light falls off; black: the light of black, as a share of white's; lamps: how many a dome has,
    over its whole sphere or above the ground alone (`above`); samples: of the render, whose noise
    is to be far below the camera's; jpeg: whether files are JPEG, else PNG.
    """

    rig: str = "monitors"
    monitors: Monitors = field(
        default_factory=lambda: Monitors(PRESETS["paper"], 4, "moments_uv", 1920, 1080)
    )
    distance: float = 0.0
    falls: float = 0.0
    black: float = 0.002
    lamps: int = 64
    above: bool = False
    camera: Camera = field(default_factory=Camera)
    exposing: Exposing = field(default_factory=Exposing)
    samples: int = 1024
    jpeg: bool = False
    seed: int = 0


def check_folder(folder: Path) -> None:
    """Raise FilesError where a folder holds something else than photographs of ARTO's."""
    check_outside(folder, "a folder of photographs")
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not (folder / FILE).is_file():
        raise FilesError(f"{folder} holds something else: choose another folder")
    description_file.read(folder / FILE)


def photograph(scene: bpy.types.Scene, view_layer: str, folder: Path, setup: Setup) -> Steps[Path]:
    """Photograph a scene as a laboratory would -> the folder, with `photographs.json` in it.

    The scene is rendered once in all lights, without noise of a camera. Beside the photographs, the
    folder `truth` has a capture set of that render. Raises SceneError, PhotographsError,
    FilesError, CaptureSetError, CancelledError.
    """
    check_folder(folder)
    if setup.camera.bits > 8 and setup.jpeg:
        raise PhotographsError("a JPEG has 8 bits: choose 8 bits, or PNG")
    if setup.rig == "dome":
        said = yield from _dome(scene, view_layer, folder, setup)
    else:
        said = yield from _monitors(scene, view_layer, folder, setup)
    description_file.write(folder, said)
    count = len(said.photographs)
    yield Wrote(1.0, f"{count} photographs, and the truth in {folder / TRUTH}", folder)
    return folder


def _monitors(
    scene: bpy.types.Scene, view_layer: str, folder: Path, setup: Setup
) -> Steps[Description]:
    steps = lights.by_monitors(
        scene, view_layer, setup.monitors, setup.distance, setup.samples, setup.falls
    )
    lit = yield from part_of(steps, 0.0, RENDERED)
    # as the laboratory says it: turned to the camera
    cube = replace(hemicube_of(setup.monitors), orientation=lights.heading(scene))
    told = {"colour_space": working_space(), "scene": scene.name}
    capture_set.write(
        folder / TRUTH, cube, pattern_set(lights.MOMENTS), lit.light, lit.own, lit.alpha, **told
    )
    yield Progress(RENDERED, "taking photographs")
    rig = MonitorRig(
        setup.monitors,
        setup.camera,
        setup.exposing,
        falls=setup.falls,
        ending=_ending(setup),
        seed=setup.seed,
    )
    rig = replace(rig, screen=replace(rig.screen, black=setup.black))
    said = rig.photograph(lit.light.__getitem__, _Files(folder, setup), ambient=lit.own)
    return _with_mask(said, lit.alpha, folder)


def _dome(
    scene: bpy.types.Scene, view_layer: str, folder: Path, setup: Setup
) -> Steps[Description]:
    directions = spiral(setup.lamps, 0.0 if setup.above else -1.0)
    steps = lights.by_lamps(scene, view_layer, directions, setup.samples)
    lit = yield from part_of(steps, 0.0, RENDERED)
    x, y, z = directions.T.tolist()
    cube = Hemicube(lamps=tuple(zip(x, y, z, strict=True)), orientation=lights.heading(scene))
    # of a radiance of 1 on a lamp's cell
    basis = lit.light[:, None] * cube.solid_angles[:, None, None, None, None].astype(np.float32)
    told = {"colour_space": working_space(), "scene": scene.name}
    white = pattern_set("white")
    capture_set.write(folder / TRUTH, cube, white, basis, lit.own, lit.alpha, **told)
    yield Progress(RENDERED, "taking photographs")
    rig = DomeRig(directions, setup.camera, setup.exposing, ending=_ending(setup), seed=setup.seed)
    said = rig.photograph(lit.light.__getitem__, _Files(folder, setup), ambient=lit.own)
    _write_lp(folder, said)
    return _with_mask(said, lit.alpha, folder)


def _ending(setup: Setup) -> str:
    return "jpg" if setup.jpeg else "png"


def _with_mask(said: Description, alpha: NDArray, folder: Path) -> Description:
    """The description with a mask of what is in the picture, which is written."""
    png_file.write(folder / "mask.png", np.rint(255 * np.clip(alpha, 0, 1)).astype(np.uint8))
    return replace(said, photographs=(*said.photographs, Photograph("mask.png", Kind.MASK)))


def _write_lp(folder: Path, said: Description) -> None:
    """The lamps as other programs read them: of each its longest exposure."""
    last = {photo.lamp: photo.file for photo in said.of(Kind.LIGHT)}
    lines = [str(len(last))]
    for number, file in last.items():
        x, y, z = said.lamps[number or 0].direction or (0.0, 0.0, 1.0)
        lines.append(f"{file} {x:.6f} {y:.6f} {z:.6f}")
    try:
        (folder / "lights.lp").write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as e:
        raise FilesError(f"{folder} cannot be written ({e}): choose another folder") from e


class _Files:
    """Writes photographs into a folder."""

    def __init__(self, folder: Path, setup: Setup) -> None:
        self._folder, self._jpeg = folder, setup.jpeg

    def __call__(self, name: str, values: NDArray) -> None:
        path = self._folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise FilesError(f"{path.parent} cannot be made ({e}): choose another folder") from e
        if self._jpeg:
            write_jpeg(path, values)
        else:
            png_file.write(path, values)


def write_jpeg(path: Path, values: NDArray) -> None:
    """Write values (H, W, 3) uint8 as a JPEG file, as they are. Raises FilesError."""
    height, width = values.shape[:2]
    image = bpy.data.images.new("ARTO Photograph", width, height, alpha=False)
    try:
        rgba = np.ones((height, width, 4), np.float32)
        rgba[..., :3] = values[::-1] / np.float32(255)
        image.pixels.foreach_set(rgba.ravel())
        image.file_format = "JPEG"
        image.filepath_raw = str(path)
        image.save(quality=QUALITY)
    except RuntimeError as e:
        raise FilesError(f"{path} cannot be written ({e}): make room on the disk") from e
    finally:
        bpy.data.images.remove(image)
