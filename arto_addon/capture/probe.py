"""The probe: a small and quick capture that shows where a scene needs small patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.capture.names import GROUP
from ...core.capture.refine import check, refine
from ...core.errors import CaptureSetError
from ...core.faces import FINEST
from ...core.hemicube import Hemicube
from ...core.patterns import pattern_set
from ..stage.small import parts_of, small
from ..stage.stage import Stage
from ..work import Steps
from . import planes

SAMPLES = 32


def refined(on: Stage, hemicube: Hemicube, most: int) -> Steps[Hemicube]:
    """Render a probe of the prepared stage and refine the hemicube with it -> Hemicube.

    Raises CancelledError, CaptureSetError, ExrError, HemicubeError; the stage is left as it was.
    """
    found = yield from probed(on, hemicube)
    return refine(hemicube, found, SAMPLES, most)


def probed(on: Stage, hemicube: Hemicube) -> Steps[NDArray]:
    """Render a probe of the prepared stage -> (F * 16 * 16, h, w, 3), for `refine`.

    Raises what `refined` raises.
    """
    check(hemicube)
    fine = replace(hemicube, patches=FINEST)
    patterns = pattern_set("white")
    images = [(k, "white") for k in range(len(fine))]
    portals = bool(on.portals)
    with small(on, SAMPLES), planes.lit(on, fine, patterns, images, portals=portals):
        parts = yield from parts_of(on, f"probing {len(fine)} directions")
    found = [(GROUP.search(name), pixels) for name, pixels in parts.items()]
    by_patch = {int(match[1]): pixels for match, pixels in found if match}
    if missing := len(fine) - len(by_patch):
        raise CaptureSetError(
            f"the probe lacks {missing} of {len(fine)} light groups: make room on the disk for "
            "temporary files, or turn Adaptive Patches off"
        )
    return np.stack([by_patch[k] for k in range(len(fine))])
