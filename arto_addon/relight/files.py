"""The files of a relight: which files the settings ask for, and what their headers say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.catcher import Caught
from ...core.exr.writing import Opener
from ..plate import plate
from ..plate.marks import PLATE
from ..plate.names import relit_file
from ..plate.together import Together
from ..work import Progress, Steps, Wrote
from . import ahead, layers, scripts
from .shown import Ready, Shown


@dataclass(frozen=True)
class Made:
    """What a relight has made.

    picture: the plate, (H, W, 4); things: the plate without the world behind, (H, W, 3); caught:
    the shadows, for a shot with shadow catchers only.
    """

    picture: NDArray[np.float32]
    things: NDArray[np.float32]
    caught: Caught | None


def write(shown: Shown, ready: Ready, made: Made, about: dict[str, str]) -> Steps[None]:
    """Write the plate and the files that the settings ask for beside it.

    All are put in place together once they are complete. Files that ARTO has written beside an
    earlier plate, and that this one does not have, are removed. about: the first entries of each
    header. Raises SceneError, ExrError.
    """
    scene, path, caught = shown.scene, ready.lit.path, made.caught
    settings = scene.arto
    yield Progress(0.9, f"writing {path}")
    about = about | {"lamps": ready.lamps}
    if scene.render.film_transparent and scene.cycles.film_transparent_glass:
        about["glass"] = ahead.GLASS
    about |= {
        "look": ready.lit.look,
        "turn": f"{math.degrees(ready.whole.turn):.4g}" if ready.whole.turn else "",
        "world by rays": ready.by_rays,
        "world below 0": ready.below,
        "changed since capture": "; ".join(ready.changed),
    }
    about = {name: text for name, text in about.items() if text}
    if caught:
        about[plate.CATCHER.removeprefix("arto.")] = "footage * catcher + RGB"
    if settings.layers != "OFF":
        name = plate.layers_file(path).name
        if settings.layers_files == "EACH":
            name = f"{path.stem}_{layers.prefix_of(scene)}*.exr"
        about[plate.LAYERS.removeprefix("arto.")] = name
    about[PLATE.removeprefix("arto.")] = path.name
    single = settings.layers != "OFF" and settings.layers_files == "EACH"
    together = Together(path, layers.prefix_of(scene) if single else None, settings.overwrite)
    with together:
        yield from _written(shown, ready, made, about, together.file)
    for there in sorted(together.written, key=lambda there: there != path):
        yield Wrote(0.95, f"wrote {there.name}", there)
    if together.removed:
        names = ", ".join(there.name for there in together.removed)
        yield Progress(0.95, f"removed {names}: of the plate before")


def _written(
    shown: Shown, ready: Ready, made: Made, about: dict[str, str], opener: Opener
) -> Steps[None]:
    """Write the plate and the files beside it. about: of each header; opener: see `Together`."""
    scene, path, picture, caught = shown.scene, ready.lit.path, made.picture, made.caught
    settings = scene.arto
    plate.write(scene, path, picture, about, shows=True, opener=opener)
    if caught:
        share = plate.share_file(path)
        plate.write(scene, share, caught.share, about, shows=True, opener=opener)
        if settings.shadows == "ADD":
            light = np.dstack([caught.light, caught.alpha])
            plate.write(scene, plate.light_file(path), light, about, opener=opener)
        yield from _into_footage(shown, ready, caught, about, opener)
    if settings.write_data:
        mattes = shown.mattes()
        missing = plate.write_data(scene, path, shown.field, mattes, about, opener)
        if missing:
            lacks = f"the data file has no {', '.join(missing)}"
            yield Progress(0.9, f"{lacks}: it was not captured; capture again to have it")
    if settings.layers != "OFF":
        found = yield from layers.of_plate(shown, ready)
        if not scene.render.film_transparent:
            found[layers.BEHIND] = picture[..., :3] - made.things
        attributes, space = plate.header_of(scene, about)
        yield from layers.write(scene, path, picture, found, attributes, space, opener)
        frames, one = ready.lit.frames, path == relit_file(scene)
        if settings.scripts and (one or frames):
            files = layers.files_by_name(scene, path, found)
            mix = scripts.described(scene, path, files, bool(caught))
            if one:
                yield from scripts.write(path, mix, opener)
            if frames:
                yield from scripts.write(*scripts.of_frames(scene, path, mix, frames[1]), opener)


def _into_footage(
    shown: Shown, ready: Ready, caught: Caught, about: dict[str, str], opener: Opener
) -> Iterator[Progress]:
    """Write the picture of the things over the artist's footage, where the scene has footage."""
    found = shown.filmed()
    if found is None:
        return
    name, there = found
    yield Progress(0.9, f"putting it into the footage: {name}")
    adds = shown.scene.arto.shadows == "ADD"
    comp = caught.added_to(there) if adds else caught.over(there)
    path = plate.comp_file(ready.lit.path)
    plate.write(shown.scene, path, comp, about | {"footage": name}, opener=opener)
