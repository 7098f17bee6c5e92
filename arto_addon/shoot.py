"""The one button: capture a shot, fit what was captured, and show it in its light."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.field.field import Field
from .capture.capture import capture
from .fit.fit import fit
from .plate.present import present
from .relight.relight import compute
from .shot import paths
from .shot.shot import layer_of
from .work import Progress, Steps, part_of
from .world.check import world_of
from .world.own import sync

# The shares of the whole work that are done after the capture, and after the fit.
CAPTURED, FITTED = 0.9, 0.95


def shoot(
    scene: bpy.types.Scene, view_layer: str | None = None, shows: bool = False
) -> Steps[Path | None]:
    """Capture, fit and relight; returns the path of the plate, None without a world.

    shows: whether a window waits for a first picture, see `capture.draft`. The scene does not
    change. Raises what the three steps raise; finished steps are kept.
    """
    layer = view_layer or layer_of(scene)
    yield from part_of(capture(scene, layer, shows=shows), 0.0, CAPTURED)
    yield from part_of(fit(scene, layer), CAPTURED, FITTED - CAPTURED)
    if world_of(scene, layer) is None:
        yield Progress(1.0, "captured: add a world with an HDRI to see the shot in its light")
        return None
    path, _ = yield from part_of(compute(scene, layer), FITTED, 1 - FITTED)
    return path


def shoot_and_show(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path | None]:
    """Shoot, then put the plate into the compositor and the lamps' groups into the panel."""
    layer = view_layer or layer_of(scene)
    path = yield from shoot(scene, layer)
    sync(scene, Field(paths.field_folder(scene, layer)))
    if path is not None:
        present(scene, path)
    return path
