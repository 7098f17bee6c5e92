"""What an earlier capture of the same scene found when it looked at it.

Which patches a scene needs, and how light gets to them, hangs on the scene and on few settings. A
capture that only has other samples, tiles or support models takes both over.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from dataclasses import astuple, fields, replace
from pathlib import Path

import bpy

from ...core.capture import head as heads
from ...core.capture.head import HEADER, VERSION, CaptureHead
from ...core.errors import ArtoError
from ...core.hemicube import Hemicube
from ...core.shot import Shot
from ..shot.fingerprint import key_of
from ..stage.stage import Pace
from .planned import Given

# Names in a capture set's description: the key of the look, and how fast the scene rendered.
LOOKED, PACE = "looked", "pace"
# Counted up when the same scene may be looked at with another outcome.
LOOK = 1


def key_of_look(head: CaptureHead, hemicube: Hemicube, shot: Shot, found: dict[str, str]) -> str:
    """A digest of all that decides what a look at the scene finds.

    head: before any look; hemicube: before it is refined; found: the scene's fingerprint.
    """
    said = replace(head, samples=None, changed=None).to_json()
    changed = {name: pair[1] for name, pair in (head.changed or {}).items()}
    changed.pop("cycles.samples", None)
    of = [LOOK, VERSION, bpy.app.version_string, said, changed, hemicube.to_json()]
    of += [shot.camera_matrix, shot.lens, shot.frame, shot.subframe, shot.view_layer]
    of += [shot.region, key_of(found)]
    return hashlib.sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:16]


def noted(key: str, pace: Pace | None) -> dict[str, object]:
    """What a description says of a look, for `looked_before`."""
    said: dict[str, object] = {LOOKED: key}
    if pace:
        said[PACE] = list(astuple(pace))
    return said


def looked_before(place: Path, key: str, on_cpu: bool) -> Given | None:
    """What a capture in the folder of a shot found by a look with this key; None for no such.

    on_cpu: whether Cycles renders on the processor, which other programs use too.
    """
    for path in sorted(place.glob(f"*/{HEADER}")):
        # a set that is damaged is told of where it is used
        with contextlib.suppress(ArtoError, OSError):
            head = heads.read(path.parent)
            if head.others.get(LOOKED) == key and head.route is not None:
                return Given(
                    head.hemicube, head.route, head.caution, _pace(head.others.get(PACE), on_cpu)
                )
    return None


def _pace(said: object, on_cpu: bool) -> Pace | None:
    if not isinstance(said, list) or len(said) != len(fields(Pace)):
        return None
    if not all(isinstance(v, float | int) and math.isfinite(v) and v >= 0 for v in said):
        return None
    pace = Pace(*map(float, said))
    if not on_cpu or not hasattr(os, "getloadavg"):
        return pace
    # what other programs do now, and not what they did then
    cores = os.cpu_count() or 1
    return replace(pace, busy=1.0 + os.getloadavg()[0] / cores)
