"""What a job can do: one table of its verbs, for the window that starts a job and for the job."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import bpy

from ..capture.capture import capture
from ..capture.more import more_samples
from ..capture.sequence import capture_frames
from ..fit.fit import fit
from ..match.match import even_out, match_target
from ..photographs.read import read_and_relight
from ..plate.composite import save_composite
from ..relight.finished import finish_plate
from ..relight.looks import relight_looks
from ..relight.many import frames_of, relight_many
from ..relight.relight import compute
from ..relight.verify import verify_plate
from ..sheet.make import make as make_sheet
from ..sheet.make import sheet_of
from ..shoot import shoot
from ..stage.settings import samples_of
from ..web.make import folder_of, make
from ..work import Steps

Verb = Literal[
    "capture",
    "fit",
    "relight",
    "capture_frames",
    "relight_frames",
    "shoot",
    "more_samples",
    "relight_looks",
    "verify",
    "finish",
    "composite",
    "match",
    "even_out",
    "photographs",
    "web",
    "sheet",
]


@dataclass(frozen=True)
class Work:
    """What a verb stands for.

    steps: the work on a scene and a view layer, which returns the file that the window shows, or a
    folder, or None; doing: what the artist is told, before the shot's
    title; captures: whether the work changes the capture, so that no other process may meanwhile;
    grows: whether it makes one picture better and better until it is stopped, which is shown
    meanwhile.
    """

    steps: Callable[[bpy.types.Scene, str], Steps[Path | None]]
    doing: str
    captures: bool = False
    grows: bool = False


def _capture_frames(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return (yield from capture_frames(scene, view_layer, frames_of(scene)))[0]


def _relight(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return (yield from compute(scene, view_layer))[0]


def _relight_frames(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return (yield from relight_many(scene, view_layer, frames=frames_of(scene)))[0]


def _relight_looks(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return (yield from relight_looks(scene, view_layer))[0]


def _web(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return (yield from make(scene, view_layer, folder_of(scene))).single


def _sheet(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return make_sheet(scene, view_layer, sheet_of(scene))


def _capture(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return capture(scene, view_layer, shows=True)


def _more_samples(scene: bpy.types.Scene, view_layer: str) -> Steps[Path]:
    return more_samples(scene, view_layer, samples_of(scene))


def _shoot(scene: bpy.types.Scene, view_layer: str) -> Steps[Path | None]:
    return shoot(scene, view_layer, shows=True)


VERBS: Mapping[Verb, Work] = {
    "capture": Work(_capture, "capturing", captures=True),
    "fit": Work(fit, "fitting", captures=True),
    "relight": Work(_relight, "relighting"),
    "capture_frames": Work(_capture_frames, "capturing the frames of", captures=True),
    "relight_frames": Work(_relight_frames, "relighting the frames of"),
    "shoot": Work(_shoot, "capturing", captures=True),
    "more_samples": Work(_more_samples, "adding samples to", captures=True),
    "relight_looks": Work(_relight_looks, "relighting the looks of"),
    "verify": Work(verify_plate, "verifying the plate of"),
    "finish": Work(finish_plate, "finishing the plate of", grows=True),
    "composite": Work(save_composite, "compositing"),
    "match": Work(match_target, "looking for the light of"),
    "photographs": Work(read_and_relight, "reading the photographs of", captures=True),
    "web": Work(_web, "making the page of"),
    "sheet": Work(_sheet, "making the sheet of"),
    "even_out": Work(even_out, "looking for even light on"),
}
