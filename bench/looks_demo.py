"""One shot, captured once, under four HDRIs: the picture at the top of the README."""

from __future__ import annotations

import time
from pathlib import Path

import bpy
from arto.arto_addon import shoot, work
from arto.arto_addon.relight.many import relight_many
from arto.arto_addon.shot import paths
from arto.core import exr

from . import pictures, reference, scenes
from .worlds import World, _hdri_folder

HDRIS = ("courtyard", "sunset", "night", "studio")


def looks_demo(sheet: Path, size: tuple[int, int], samples: int, out: Path) -> dict[str, float]:
    """Write the picture; returns seconds, of the capture and of the four relights."""
    scene = scenes.product_shot(width=size[0], height=size[1])
    reference.registered()
    World(HDRIS[0]).apply(scene)
    out.mkdir(parents=True, exist_ok=True)
    scene.arto.samples = samples
    scene.arto.output = str((out / "look.exr").resolve())
    bpy.ops.wm.save_as_mainfile(filepath=str((out / "looks.blend").resolve()))
    layer = scene.view_layers[0].name
    begun = time.perf_counter()
    work.run(shoot.shoot(scene, layer))
    captured = time.perf_counter()
    files = [_hdri_folder() / f"{name}.exr" for name in HDRIS]
    done = work.run(relight_many(scene, layer, files))
    relit = time.perf_counter()
    _sheet(sheet, [next(iter(exr.read(path).values())) for path in done])
    assert paths.field_folder(scene).is_dir()
    return {"capture": captured - begun, "four relights": relit - captured}


def _sheet(path: Path, plates: list) -> None:
    from matplotlib import pyplot as plt

    height, width = plates[0].shape[:2]
    figure, axes = plt.subplots(1, 4, figsize=(12, 12 / 4 * height / width + 0.25))
    figure.subplots_adjust(0, 0, 1, 0.92, wspace=0.01)
    for axis, plate, name in zip(axes, plates, HDRIS, strict=True):
        picture = plate[..., :3]
        axis.imshow(pictures.display(picture, pictures.exposure_for(picture)))
        axis.set_axis_off()
        axis.set_title(name, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)
