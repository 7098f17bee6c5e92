"""Fit the scene's capture set (paper 5). The calculation is in `core.fit`."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.capture.capture_set import CaptureSet
from ...core.errors import CaptureSetError, FieldError
from ...core.field.field import Field
from ...core.files import Lock
from ...core.fit.fit import fit as fit_captured
from ..fit.guides import cleaned
from ..shot import paths, status
from ..shot.shot import check_same_shot, layer_of, shot_of
from ..stage import takes
from ..work import Progress, Steps, Wrote


def is_fitted(captured: CaptureSet, folder: Path, choice: str, separate: bool) -> bool:
    """Whether the field in a folder is what a fit with these settings would make."""
    try:
        about = Field(folder).about
    except FieldError:
        return False
    then = about.key, about.choice, bool(about.separate)
    return then[0] is not None and then == (captured.head.key, choice, separate)


def _fit_one(scene: bpy.types.Scene, captured: CaptureSet, target: Path) -> Steps[None]:
    settings = scene.arto
    work = fit_captured(captured, target, settings.support, settings.separate)
    for share, text in work:
        yield Progress(share, text)
    yield from cleaned(scene, target)


def fit(scene: bpy.types.Scene, view_layer: str | None = None) -> Steps[Path]:
    """Fit the scene's capture set to a reflectance field; returns the field's folder.

    A shot with shadow catchers gets a field for each take. An old field stays until the new field
    is complete. Raises CaptureSetError, ShotError, FieldError, PatternError, BusyError.
    """
    layer = view_layer or layer_of(scene)
    scene.view_layers[layer].update()
    folder = paths.capture_folder(scene, layer)
    place = paths.place(scene, layer)
    if not folder.exists() and (stopped := status.unfinished(place.source)):
        raise CaptureSetError(
            f"the capture is unfinished ({stopped[0]}): run Capture again, it goes on from there"
        )
    if not folder.exists():
        check_same_shot(scene, paths.nearest(scene, layer), "the capture set", layer)
    captured = CaptureSet(folder)
    check_same_shot(scene, captured.head.shot, "the capture set", layer)
    settings = scene.arto
    there = place.source / "field"
    if is_fitted(captured, there, settings.support, settings.separate):
        yield Progress(1.0, "there is nothing to fit: the field is of this capture")
        return there
    if not captured.kept:
        raise CaptureSetError(
            "the basis images of this capture were not kept, so nothing can be fitted to them "
            f"anew: set Support back to '{captured.head.choice}', or capture again with "
            "Keep Basis Images on Always"
        )
    # A capture set of an earlier version is read where it is. Its field goes to the shot's folder.
    target = (paths.claim(scene, layer) if place.earlier else place.folder) / "field"
    with Lock(target.parent, f"fitting {shot_of(scene, layer).title}"):
        if captured.head.catchers:
            # The fields of the other takes come first. So the field of the whole is never there
            # without them.
            for name in takes.TAKES:
                there = CaptureSet(folder.parent / name / "capture")
                yield from _fit_one(scene, there, target.parent / name / "field")
        yield from _fit_one(scene, captured, target)
        paths.remove_draft(target.parent)
    paths.forget()
    text = f"fitted {len(captured.hemicube)} patches of {captured.pixels} pixels"
    yield Wrote(1.0, text, target)
    return target
