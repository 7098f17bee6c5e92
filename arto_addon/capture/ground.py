"""The takes of a shot with shadow catchers that come after the first: the catchers alone, in the
light of the same patches, and what of the picture the things on them cover (`stage.takes`)."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.capture_set import CaptureSet
from ...core.errors import ArtoError, CaptureSetError
from ...core.field import Field
from ...core.hemicube import Hemicube
from ...core.tile_writer import write_layer
from ..stage.small import parts_of
from ..stage.stage import set_region
from ..stage.takes import MATTE
from ..work import Steps
from .asked import asked
from .planned import Given

# Its folder in the shot's, with a capture set and a field of its own.
FOLDER = "ground"
# What the things cover, in the folder of its capture set.
OUTLINES = "things.exr"
# The layer of the ground's field that says so.
LAYER = "things"
# In a description: the key of the first take.
PAIR = "pair"


def given_by(head: dict[str, Any]) -> Given:
    """What a capture set's description gives to the takes after it."""
    return Given(Hemicube.from_json(head["hemicube"]), head["route"], head.get("caution"))


def is_there(folder: Path, key: str, pair: str) -> bool:
    """Whether a folder has the finished take of that key, made for the first take `pair`."""
    with contextlib.suppress(ArtoError):
        head = CaptureSet(folder).head
        return head.get("key") == key and head.get(PAIR) == pair
    return False


def outlines(scene: bpy.types.Scene, view_layer: str, given: Given, path: Path) -> Steps:
    """Render how much of each pixel the things cover that stand before catchers, where it is not
    there yet. They hide what is behind them in the paths of the other takes: no bounce is needed.

    Raises SceneError, CaptureSetError, CancelledError.
    """
    if path.is_file():
        return
    with asked(scene, view_layer, given, MATTE) as this:
        on = this.on
        set_region(on.scene, this.region)
        on.change("cycles.max_bounces", 0)
        layer = on.scene.view_layers[0]
        layer.use_pass_z = layer.cycles.denoising_store_passes = False
        layer.cycles.use_pass_shadow_catcher = True
        parts = yield from parts_of(on, "rendering the outlines of the things", 0.98)
        combined = next((p for n, p in parts.items() if n.endswith("Combined")), None)
        if combined is None:
            raise CaptureSetError(
                "Blender wrote no picture of the outlines: make room on the disk for temporary "
                "files, and capture again"
            )
        covered = np.zeros((this.shot.height, this.shot.width), np.float32)
        covered[this.region.slices] = combined[..., 3]
        exr.write(path, {"": covered})


def add_outlines(captured: Path, field: Path) -> None:
    """Put the outlines of a take's capture set into its field, as a layer. Raises CaptureSetError,
    ExrError, FieldError."""
    covered: NDArray[np.float32] = next(iter(exr.read(captured / OUTLINES).values()))[..., 0]
    there = Field(field)
    if covered.shape != there.shape:
        raise CaptureSetError(f"{captured / OUTLINES} is of another size: capture again")
    for tile in there.tiles:
        write_layer(tile.folder, LAYER, covered[tile.region.slices])
