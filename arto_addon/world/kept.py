"""Maps of worlds, kept on disk by a key of what the world shows.

The strength of a world and its turn about the vertical are not in the key. They are applied to the
kept map. So an HDRI that is turned or dimmed is rendered only once.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ...core import arrays, marked
from ...core.errors import KitError, SceneError
from ...core.light.environment import Environment
from ..blender.colour import working_space
from ..blender.nodes import shader_tree, trees
from ..kit import base as of_base
from ..kit import kit as kits
from ..shot import paths
from ..shot.fingerprint import Fingerprint, of_blocks
from ..shot.pixels import image as digest_of
from ..shot.shot import layer_of
from .bake import bake
from .check import check_world
from .dials import read, without_dials
from .images import moves, stamps
from .still import context
from .studio import of_textures

# The version of how maps are made. Maps of another version are not used.
VERSION = 3
# How many maps stay on disk: those that were used last.
MOST = 12
# The last map also stays in memory up to so many bytes, as a turntable needs only this map.
LAST = 1 << 27


@dataclass(frozen=True)
class _Last:
    """A map in memory, with the strength of its world."""

    path: Path
    strength: float
    image: np.ndarray


_last: list[_Last] = []


def environment(
    scene: bpy.types.Scene,
    width: int,
    view_layer: str | None = None,
    world: bpy.types.World | None = None,
) -> Environment:
    """The light of a view layer's world, from a kept map where there is one, else from `bake`.

    world: the world to show (default: the view layer's). Raises what `bake` raises.
    """
    world = world or check_world(scene, view_layer)
    layer = view_layer or layer_of(scene)
    with without_dials(scene, layer, world) as (plain, strength, turn):
        path = paths.worlds_folder(scene) / f"{_key(scene, plain, width)}.npy"
        for last in _last:
            if (last.path, last.strength) == (path, strength):
                return Environment(last.image, turn)
        image = _read(path, width)
        if image is None:
            image = bake(scene, width, layer, plain).image
            _write(path, image)
    image = image * np.float32(strength)
    _last.clear()
    if image.nbytes <= LAST:
        _last.append(_Last(path, strength, image))
    return Environment(image, turn)


def painted(
    scene: bpy.types.Scene, mask: bpy.types.Image, width: int, world: bpy.types.World
) -> np.ndarray:
    """Bring a mask that was painted on a world's HDRI to a map -> (width / 2, width), 0 to 1.

    The map fits the world's `environment` before its turn. mask: an image that is mapped to the sky
    as the HDRI is. Raises SceneError unless the world's own tree has exactly one HDRI.
    """
    with without_dials(scene, layer_of(scene), world) as (plain, _, _):
        found = [n for t in trees(shader_tree(plain), set()) for n in t.nodes]
        textures = [n for n in found if n.bl_idname == "ShaderNodeTexEnvironment" and n.image]
        if len(textures) != 1 or textures[0].id_data != plain.node_tree:
            raise SceneError(
                f"'{mask.name}' is painted on an HDRI, and the world has {len(textures)} (or it is "
                "in a node group): give the group an azimuth, elevation and radius instead"
            )
        texture, tree = textures[0], plain.node_tree
        texture.image = mask
        light = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(texture.outputs["Color"], light.inputs["Color"])
        tree.links.new(light.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
        return np.clip(bake(scene, width, None, plain).image.mean(axis=-1), 0, 1)


def _read(path: Path, width: int) -> np.ndarray | None:
    try:
        image = arrays.read(path, width // 2 * width * 3 * 4)
        os.utime(path, follow_symlinks=False)
    except (OSError, ValueError, NotImplementedError):
        return None  # The map is made again.
    good = image.dtype == np.float32 and image.shape == (width // 2, width, 3)
    return image if good and np.isfinite(image).all() else None


def _write(path: Path, image: np.ndarray) -> None:
    """Keep a map on disk, and remove the maps that were not used for longest."""
    with contextlib.suppress(OSError):  # A map that cannot be kept is made again next time.
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays.write(path, image)
        kept = [p for p in path.parent.glob("*.npy") if arrays.is_signed(p)]
        for old in sorted(kept, key=lambda p: p.stat().st_mtime_ns)[:-MOST]:
            marked.remove_own_file(old, arrays.is_signed)


def _key(scene: bpy.types.Scene, world: bpy.types.World, width: int) -> str:
    """The key of a map: a digest of all that the map depends on."""
    of: list[object] = [VERSION, width, bpy.app.version_string, working_space()]
    of.append(of_textures(scene))
    # `full` reads the files: an HDRI may be replaced by a file of the same size and time.
    found = of_blocks([world], full=True)
    of.append(_unnamed(found))
    of.append(stamps(world, scene.frame_current))
    if moves(world):
        of.append((scene.frame_current, scene.frame_subframe))
    return hashlib.sha256(repr(of).encode()).hexdigest()[:16]


def _unnamed(found: Fingerprint) -> list[tuple[str, str]]:
    """What a world is made of, without its own name: a copy of a world has another one."""
    return sorted(("World" if k.startswith("World") else k, v) for k, v in found.items())


def _of_kit(scene: bpy.types.Scene, world: bpy.types.World) -> tuple[str, float, float] | None:
    """What a world that is all a light kit shows, by the kit's values; None for any other world.

    A kit asks nothing of camera or scene. Its values are read in a fraction of the time that a walk
    through its nodes takes.
    """
    if kits.turns(world) is None:
        return None
    try:
        kit = kits.read(world)
    except KitError:
        return None
    images = [of_base.image_of(kit.base.image)] if kit.base.image else []
    images += [of_base.image_of(light.image) for light in kit.lit if light.image]
    if any(image.source not in {"FILE", "GENERATED"} for image in images):
        return None
    plain = replace(kit, lights=kit.lit, backdrop=None, turn=0.0, strength=1.0)
    of: list[object] = ["kit", plain, kit.backdrop is not None, of_textures(scene)]
    of += [(digest_of(image), image.colorspace_settings.name) for image in images]
    return repr(of), kit.strength, math.radians(kit.turn) % (2 * math.pi)


def shows(
    scene: bpy.types.Scene, world: bpy.types.World, full: bool = False
) -> tuple[str, float, float]:
    """Read what a world shows, apart from its strength and turn -> (key, strength, turn).

    Nothing is changed or copied, so this is quick enough for many calls a second. full: the key
    has the contents of the world's files, which are read anew when a file is another.
    """
    if not full and (quick := _of_kit(scene, world)):
        return quick
    strength, turn, dials = read(world)
    of: list[object] = [*_unnamed(of_blocks([world], full=full, without=dials))]
    of += [of_textures(scene), *context(scene, layer_of(scene), world)]
    if moves(world):
        of += [stamps(world, scene.frame_current), scene.frame_current, scene.frame_subframe]
    return repr(of), strength, turn
