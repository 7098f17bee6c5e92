"""The probe: a small and quick capture that shows where a scene needs small patches."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import NDArray

from ...core.capture.refine import check
from ...core.faces import FINEST
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ..stage.small import parts_of, small
from ..stage.stage import Stage
from ..work import Steps
from . import planes
from .look import SAMPLES, groups_of


def probed(on: Stage, hemicube: Hemicube) -> Steps[NDArray]:
    """Render a probe of the prepared stage -> (F * 16 * 16, h, w, 3), for `refine`.

    The stage is left as it was. Raises CancelledError, CaptureSetError, ExrError, HemicubeError.
    """
    check(hemicube)
    fine = replace(hemicube, patches=FINEST)
    patterns = pattern_set("white")
    images = [(k, "white") for k in range(len(fine))]
    portals = bool(on.portals)
    with small(on, SAMPLES), planes.lit(on, fine, patterns, images, portals=portals):
        parts = yield from parts_of(on, f"probing {len(fine)} directions")
    return groups_of(parts, len(fine))
