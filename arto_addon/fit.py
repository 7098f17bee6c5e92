"""Fitting the scene's capture set (paper 5); the work itself is `core.fit`."""

from __future__ import annotations

import bpy

from ..core.capture_set import HEADER, CaptureSet
from ..core.fit import fit as fit_captured
from .shot import paths
from .shot.shot import check_same_shot
from .work import Progress, Steps


def fit(scene: bpy.types.Scene) -> Steps:
    """Fit the scene's capture set to a reflectance field; returns its folder.

    Raises CaptureSetError, FieldError, PatternError; a field that was there stays until the new
    one is complete.
    """
    folder = paths.capture_folder(scene)
    unfinished = paths.unfinished_capture_folder(scene)
    if not (folder / HEADER).is_file() and (unfinished / HEADER).is_file():
        folder = unfinished  # which says how far it is
    captured = CaptureSet(folder)
    check_same_shot(scene, captured.head, "the capture set")
    folder = paths.field_folder(scene)
    about = {"shot": captured.head.get("shot", {})}
    settings = scene.arto
    work = fit_captured(captured, folder, settings.support, settings.separate, **about)
    for share, text in work:
        yield Progress(share, text)
    yield Progress(1.0, f"fitted {len(captured.hemicube)} patches of {captured.pixels} pixels")
    return folder
