"""The key of a plate: all that decides its pixels and its files.

The window compares keys to know whether a plate is up to date. A plate's header holds the key.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import bpy

from ...core.errors import ArtoError
from ...core.field.field import Field
from ...core.shot import Shot
from ..blender import denoise
from ..plate import mattes
from ..plate.footage import TIMING, footage
from ..settings.setting import Decides
from ..settings.table import values
from ..shot import paths, pixels, status, walk, watch
from ..shot.fingerprint import key_of, of_blocks
from ..shot.shot import layer_of, shot_of
from ..world.kept import shows
from ..world.own import gains_of

# Where a plate's header holds the key.
HEADER = "arto.light key"
# What of a shot decides the picture: not the names by which its folder is found.
_OF_SHOT = (
    "frame", "subframe", "width", "height", "camera", "camera_matrix", "lens", "view_layer",
    "region", "colour_space",
)  # fmt: skip
# The numbers of a group of the light.
_PLACE = ("azimuth", "elevation", "radius", "soft")


def light_key(
    scene: bpy.types.Scene,
    world: bpy.types.World,
    view_layer: str | None = None,
    field: Field | None = None,
    shows_now: str | None = None,
) -> str:
    """A key of sixteen letters, the same whenever all that decides a plate is the same.

    That is the light and the scene's own lamps, the things in the scene, the camera, the frame and
    the size, the captured field, the settings of a relight, the footage, the groups of the light
    and the Cryptomattes. view_layer: default: `layer_of`; field: default: the shot's field on disk;
    shows_now: the digest of the things (`Shown.scene_key`, the default).
    """
    layer = view_layer or layer_of(scene)
    field = field or _field_of(scene, layer)
    key, strength, turn = shows(scene, world, full=True)
    settings = scene.arto
    of: list[object] = [key, round(strength, 5), round(turn, 5), scene.render.film_transparent]
    of.append(scene.cycles.film_transparent_glass)
    if settings.lamps:  # their render has noise, and is clamped as the artist's own is
        cycles = scene.cycles
        of += [settings.seed, cycles.use_animated_seed]
        of += [cycles.sample_clamp_direct, cycles.sample_clamp_indirect]
    if settings.denoise:
        of += [getattr(scene.render, name) for name in denoise.DENOISER]
    of += [str(value) for value in values(settings, Decides.PLATE).values()]
    of += [sorted((n, round(g, 5)) for n, g in gains_of(scene).items())]
    of += [_shot(scene, layer), _field(field), _footage(scene), _groups(scene)]
    of.append(_things(scene, layer, field) if shows_now is None else shows_now)
    rendered = mattes.file_of(scene, field) if field else None
    of.append(_content(rendered) if rendered else None)
    return hashlib.sha256(repr(of).encode()).hexdigest()[:16]


def _field_of(scene: bpy.types.Scene, view_layer: str) -> Field | None:
    try:
        place = paths.place(scene, view_layer, fresh=bpy.app.background)
        return status.field_of(place.source)
    except (ArtoError, OSError):
        return None


def _shot(scene: bpy.types.Scene, view_layer: str) -> object:
    try:
        shot: Shot = shot_of(scene, view_layer)
    except ArtoError as e:  # an empty render region
        return str(e)
    return [getattr(shot, name) for name in _OF_SHOT]


def _things(scene: bpy.types.Scene, view_layer: str, field: Field | None) -> str:
    """A digest of the things in the scene, or those of the capture before the window has looked."""
    then = field.about.fingerprint if field else None
    if not then:
        return ""
    found = watch.latest(scene, view_layer, dict(then), bpy.app.background)
    return key_of(dict(then) if found is None else found)


def _field(field: Field | None) -> str | None:
    """What a field was captured and fitted with."""
    if field is None:
        return None
    # the key of the capture stands for the fingerprint, which is long
    said = field.about.to_json() | {"fingerprint": None, "shot": None, "file": None}
    return json.dumps(said, sort_keys=True, default=str)


def _footage(scene: bpy.types.Scene) -> object:
    """What the things are put into at the scene's frame."""
    try:
        found = footage(scene)
        if found is None:
            return None
        source, file = found.source, found.file(scene)
        of = [found.name, found.fills, source.colorspace_settings.name]
        if file:
            return [*of, _content(file)]
        if source.source == "MOVIE" and not getattr(source, "packed_file", None):
            # of a movie, which may be large, the size and the time
            of += [
                scene.render.fps,
                scene.render.fps_base,
                walk.file(source.filepath, source.library),
            ]
            timing = found.timing if found.timing is not None else source
            return [*of, *(getattr(timing, name, None) for name in TIMING)]
        return [*of, pixels.image(source)]
    except ArtoError as e:  # the plate cannot be made again, so it is not up to date
        return str(e)


def _groups(scene: bpy.types.Scene) -> object:
    """The groups of the light and their places."""
    found: list[object] = []
    for group in scene.arto.groups:
        mask = sorted(of_blocks([group.mask]).items()) if group.mask else None
        found.append([group.name, *(round(getattr(group, n), 5) for n in _PLACE), mask])
    return found


def _content(path: Path) -> str:
    """A file's name and a digest of its content, which is read anew when the file is another."""
    return f"{path.name} {walk.file(str(path), None, full=True)}"
