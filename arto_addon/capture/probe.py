"""The probe: a small and quick capture that shows where a scene needs small patches."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core import exr
from ...core.capture_set import GROUP
from ...core.errors import CaptureSetError
from ...core.hemicube import FINEST, Hemicube
from ...core.patterns import pattern_set
from ...core.refine import check, refine
from ..blender.output import write_to
from ..stage.stage import Stage, picture_region, picture_size
from ..work import Render, Steps
from . import planes

# Pixels and samples of the probe: its cost is the same for a picture of any size.
PIXELS = 1728
SAMPLES = 32


def refined(on: Stage, hemicube: Hemicube, most: int) -> Steps:
    """Render a probe of the prepared stage and refine the hemicube by it -> Hemicube.

    Raises CancelledError, CaptureSetError, ExrError, HemicubeError; the stage is left as it was.
    """
    check(hemicube)
    scene = on.scene
    render, cycles = scene.render, scene.cycles
    fine = replace(hemicube, patches=FINEST)
    patterns = pattern_set("white")
    images = [(k, "white") for k in range(len(fine))]
    width, height = picture_size(scene)
    region = picture_region(scene)
    share = math.sqrt(PIXELS / region.pixels)
    were = {
        (owner, name): getattr(owner, name)
        for owner, names in (
            (
                render,
                ("resolution_x", "resolution_y", "resolution_percentage", "use_crop_to_border"),
            ),
            (cycles, ("samples",)),
        )
        for name in names
    }
    with tempfile.TemporaryDirectory() as folder:
        try:
            # as large as makes the part that is captured, a render region of the artist's, that
            # many pixels
            render.resolution_x = max(8, round(width * share))
            render.resolution_y = max(8, round(height * share))
            render.resolution_percentage = 100
            render.use_crop_to_border = render.use_border
            cycles.samples = SAMPLES
            path = Path(folder) / "probe.exr"
            write_to(render, path)
            with planes.lit(on, fine, patterns, images):
                request = Render(scene.name, 0, f"probing {len(fine)} directions")
                yield request
                request.check()
            found = [(GROUP.search(name), pixels) for name, pixels in exr.read(path).items()]
            by_patch = {int(match[1]): pixels for match, pixels in found if match}
            if missing := len(fine) - len(by_patch):
                raise CaptureSetError(
                    f"the probe lacks {missing} of {len(fine)} light groups: make room on the disk "
                    f"of {folder}, or turn Adaptive Patches off"
                )
            probe = np.stack([by_patch[k] for k in range(len(fine))])
        finally:
            for (owner, name), value in were.items():
                setattr(owner, name, value)
    return refine(hemicube, probe, SAMPLES, most)
