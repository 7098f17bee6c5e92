"""Layers of a plate: what each part of the light adds to the picture.

The parts are cut from the world's light; the scene's own lamps have layers too. The layers are
written beside the plate, all in one file or each in its own file. A node group in Blender's
compositor has a gain and a tint for each layer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import SceneError
from ...core.exr.writing import Opener
from ...core.faces import FACE_NAMES
from ...core.field.field import Field
from ...core.file_names import safe_name
from ...core.files import whole
from ...core.light.environment import Environment
from ...core.light.layers import REST, by_faces, disc, part_of, residual, share_out, shares
from ...core.light.light import PatchLight
from ...core.relight import relights, together
from ..blender import denoise
from ..plate.names import relit_file
from ..plate.plate import (
    CROPPED,
    comp_file,
    data_file,
    full_file,
    layers_file,
    light_file,
    share_file,
    window_of,
    world_file,
)
from ..work import Progress, Steps, Warned
from ..world import kept
from ..world.lamp_render import lamp_light, lamp_samples
from ..world.own import gains_of
from .shown import Ready, Shown

# Layers besides the parts of the world's light: the scene's own lamps, and the world behind.
OWN, BEHIND = "own", "behind"
# Other sockets of a mixer. With an empty prefix a group could be given one of these names.
SOCKETS = {"Exposure", "Footage", "Image", "Combined", "Alpha"}
# A part of the light with less than this share of the lamps' light is given no lamps.
LEAST_LAMPS = 1e-4


def check(scene: bpy.types.Scene, path: Path, field: Field) -> None:
    """Check that the layers of a plate can be named, before anything is made.

    Raises SceneError where two layers share a name, where a layer is named as a mixer's socket, or
    where its file would be written over another.
    """
    settings = scene.arto
    if settings.layers == "OFF":
        return
    if settings.layers == "GROUPS":
        _check(scene)
    if settings.layers_files == "EACH":
        own_files(scene, path, field)


def own_files(scene: bpy.types.Scene, path: Path, field: Field) -> list[Path]:
    """The files of single layers that a plate may have. Raises SceneError, see `layer_files`."""
    settings = scene.arto
    groups = [group.name for group in settings.groups]
    parts = [*groups, REST] if settings.layers == "GROUPS" else list(FACE_NAMES)
    own = field.own_layers if settings.own_lamps else []
    names = [channel_name(scene, name) for name in (*parts, *own, OWN, BEHIND)]
    return list(layer_files(path, names).values())


def files_by_name(
    scene: bpy.types.Scene, path: Path, layers: Iterable[str]
) -> dict[str, str | None]:
    """By the name of each layer in files the name of its own file; None where all are in one."""
    names = [channel_name(scene, name) for name in layers]
    if scene.arto.layers_files != "EACH":
        return dict.fromkeys(names)
    return {name: file.name for name, file in layer_files(path, names).items()}


def _check(scene: bpy.types.Scene) -> None:
    """Raise SceneError where two layers share a name, or a layer is named as a mixer's socket."""
    taken = {channel_name(scene, name) for name in (REST, OWN, BEHIND)} | SOCKETS
    for group in scene.arto.groups:
        name = channel_name(scene, group.name)
        if name in taken:
            raise SceneError(f"two layers would be called '{name}': rename the group")
        taken.add(name)


def parts_of(
    scene: bpy.types.Scene, environment: Environment, field: Field, world: bpy.types.World
) -> dict[str, NDArray[np.float32]]:
    """Cut an environment into the parts that the settings ask for -> shares (H, W), which sum to 1.

    world: the world that the environment is of; masks are painted on its HDRI.
    """
    settings = scene.arto
    if settings.layers == "FACES":
        found = by_faces(environment, field.hemicube)
        # light from where no face is lights nothing, so no layer is made for it
        return {k: v for k, v in found.items() if v.any()}
    _check(scene)
    masks = {}
    for group in settings.groups:
        if group.mask:
            width = environment.image.shape[1]
            masks[group.name] = kept.painted(scene, group.mask, width, world)
            continue
        place = group.azimuth, group.elevation, group.radius
        masks[group.name] = disc(environment, *place, group.soft)
    if not masks:
        return {"light": np.ones(environment.image.shape[:2], np.float32)}
    return shares(masks)


def pictures_of(
    field: Field, environment: Environment, parts: dict[str, NDArray[np.float32]]
) -> dict[str, NDArray[np.float32]]:
    """What each part of an environment adds to a field's picture, (H, W, 3), by part."""
    out: dict[str, NDArray[np.float32]] = {}
    names = list(parts)
    most = together(field)
    for first in range(0, len(names), most):
        some = names[first : first + most]
        lights = [PatchLight(part_of(environment, parts[n]), field.hemicube) for n in some]
        found = relights(field, lights, 0.0)
        out |= {name: picture[..., :3] for name, picture in zip(some, found, strict=True)}
    return out


def lamp_shares(lamps: Environment, parts: dict[str, NDArray[np.float32]]) -> dict[str, float]:
    """The share of the lamps' light in each part; parts with almost none are left out."""
    weights = lamps.image.sum(axis=-1, dtype=np.float64) * lamps.row_solid_angles[:, None]
    total = float(weights.sum())
    found = {name: float((weights * share).sum()) / total for name, share in parts.items()}
    return {name: share for name, share in found.items() if share > LEAST_LAMPS}


def of_plate(shot: Shown, ready: Ready) -> Steps[dict[str, NDArray[np.float32]]]:
    """Make the layers of a plate, (H, W, 3) each, by name.

    They are denoised where the plate is. For a shot with shadow catchers, the layers show the
    things without the catchers.
    """
    shown, rendered = shot.takes[-1], ready.rendered[-1]
    parts = parts_of(shown.scene, ready.whole, shown.field, ready.world)
    scene, field = shown.scene, shown.field
    yield Progress(0.9, f"relighting {len(parts)} layers")
    rest = ready.found.rest if rendered else ready.whole
    found = pictures_of(field, rest, parts)
    for lamps in rendered:
        some = lamp_shares(ready.found.lamps, parts)
        for name, share in some.items():
            light = lamps
            if len(some) > 1:
                mine = part_of(ready.found.lamps, parts[name])
                captured, of_all = field.about.samples, share * ready.found.share
                samples = lamp_samples(scene, of_all, captured)
                light = yield from lamp_light(scene, field, mine, samples, 0.9)
            found[name] = found[name] + light
    own = field.layer("own")
    if scene.arto.own_lamps and own.any():
        left, scale = own, np.float32(scene.arto.own_lamps)
        gains = gains_of(scene)
        for name in field.own_layers:
            gain = np.float32(gains.get(name.removeprefix("own_"), 1.0))
            found[name] = scale * gain * field.layer(name)
            left = left - field.layer(name)
        # lamps in no light group: what the groups leave over, but for what is rounding
        found[OWN] = scale * np.where(np.abs(left) > 1e-5 * np.abs(own), left, 0)
    if scene.arto.denoise and denoise.available():
        for name, picture in found.items():
            yield Progress(0.93, f"denoising the layer {name}")
            found[name] = shown.denoised(picture, signed=name in own_names(scene))
    return found


def own_names(scene: bpy.types.Scene) -> set[str]:
    """The names of the layers of the scene's own lamps, which may take light away."""
    return {OWN, *gains_of(scene)}


def write(
    scene: bpy.types.Scene,
    path: Path,
    beauty: NDArray[np.float32],
    layers: dict[str, NDArray[np.float32]],
    attributes: dict[str, object],
    space: str,
    opener: Opener = whole,
) -> Steps[None]:
    """Write the layers of a plate: all with the plate in one file, or each in a file of its own.

    beauty: the plate, (H, W, 4); opener: how the files are put in their places. The last message
    says by how much the sum of the layers differs from the plate. Raises SceneError, ExrError.
    """
    settings = scene.arto
    names = [channel_name(scene, name) for name in layers]
    each = settings.layers_files == "EACH"
    files = layer_files(path, names) if each else {}
    signed = [i for i, name in enumerate(layers) if name in own_names(scene)]
    parts = share_out(list(layers.values()), beauty[..., :3], signed)
    kind = np.float32
    if settings.layers_half:
        if max(float(np.max(p, initial=0)) for p in [*parts, beauty]) <= exr.HALF:
            kind = np.float16
        else:
            yield Warned(0.95, "the layers are written as 32-bit: light past what half holds")
    stored = [part.astype(kind) for part in parts]
    picture = beauty.astype(kind)
    off = residual(stored, picture[..., :3].astype(np.float64))
    named = dict(zip(names, stored, strict=True))
    window, by = window_of(scene), settings.compression
    for name, file in files.items():
        one = np.dstack([named[name], picture[..., 3]])
        said = attributes | {"arto.layer": name}
        exr.write(file, {"": one}, said, space, window, opener=opener, compression=by)
    together = layers_file(path)
    shown = full_file(together) if window.crop else together
    if not each:
        said = attributes | ({CROPPED: shown.name} if window.crop else {})
        exr.write_layered(together, picture, named, said, space, window, opener, by)
    # the mixer reads all layers and all their pixels from one file
    if window.crop if not each else path == relit_file(scene):
        full = replace(window, crop=False)
        exr.write_layered(shown, picture, named, attributes, space, full, opener, by)
    yield Progress(0.95, f"layers: {', '.join(named)}; their sum is off by {off:.1e} at most")


def layer_files(path: Path, names: list[str]) -> dict[str, Path]:
    """The path of each layer's own file beside a plate, by name.

    Raises SceneError where the file of a layer would overwrite another file.
    """
    beside = (share_file, light_file, layers_file, data_file, comp_file, world_file)
    others = [path, *(name(path) for name in beside)]
    taken = {file.name.lower() for one in others for file in (one, full_file(one))}
    found = {}
    for name in names:
        file = path.with_name(f"{path.stem}_{safe_name(name)}.exr")
        # most disks do not tell large letters from small ones
        if file.name.lower() in taken:
            raise SceneError(
                f"the layer '{name}' would be written over another file, {file.name}: rename its "
                "group, or change Layer Prefix"
            )
        taken.add(file.name.lower())
        found[name] = file
    return found


def prefix_of(scene: bpy.types.Scene) -> str:
    """The prefix of layer names, as the artist set it, without characters that separate names."""
    return re.sub(r"[^\w-]", "_", scene.arto.layer_prefix)


def channel_name(scene: bpy.types.Scene, layer: str) -> str:
    """The name of a layer in files and in the mixer, prefix included."""
    return f"{prefix_of(scene)}{layer_name(layer)}"


def layer_name(name: str) -> str:
    """A name for channels: without blanks, without dots, which separate layers, no bare number."""
    out = safe_name(name).replace(".", "_").replace(" ", "_")
    return f"layer_{out}" if out.isdigit() else out
