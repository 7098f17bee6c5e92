"""Maps of worlds, made by the resident renderer, and their suns."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays, marked
from ...core.errors import SceneError
from ...core.light.environment import Environment
from ...core.light.lamps import Split, split
from ..blender.colour import work_in
from ..job.snapshot import put_pixels
from ..shot.pixels import image as digest_of
from ..world import kept
from ..world.bake import rough
from ..world.dials import without_dials
from ..world.studio import like_textures
from .sent import Apart, images, put_back

# Width of a rough map, which takes a moment to make, and the number of maps kept in memory.
ROUGH_WIDTH = 512
MOST = 4
# The most bytes that a map's file may have: 16384 x 8192 texels.
MOST_BYTES = 16384 * 8192 * 3 * 4
# The name of the scene from which maps are made: a small one, beside the artist's.
DESK = "ARTO Maps"


@dataclass(frozen=True)
class Question:
    """What the window asks for.

    key: of what the world shows; blend: a file with the world in it; world: the world's name there;
    width: the width of a full map, 0 for a rough map; space: the working colour space; textures:
    see `studio.of_textures`; apart: its large packed images, see `sent`; painted: for each image
    that is in no file, its name and the file with its pixels; folder: where full maps are kept;
    out: the .npy file to write.
    """

    key: str
    blend: str
    world: str
    width: int
    frame: int
    subframe: float
    space: str
    device: str
    textures: list[object]
    apart: list[Apart]
    painted: dict[str, str]
    folder: str
    out: str


class Maps:
    """The maps that were made last, and what their suns are."""

    def __init__(self) -> None:
        self._found: OrderedDict[tuple[str, bool], NDArray[np.float32]] = OrderedDict()
        self._split: OrderedDict[tuple[str, bool], Split] = OrderedDict()

    def answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Make a map -> its file, and of a rough one the share of light of its suns.

        The share is 0 where suns are not worth a render. Raises ArtoError.
        """
        question = Question(**asked)
        full = bool(question.width)
        self.keep(question.key, full, _made(question))
        if full:  # to look for the suns in so many texels takes as long as the map
            return {"map": question.out}
        suns = self.split(question.key, full)
        return {"map": question.out, "suns": suns.share if suns and suns.worth else 0.0}

    def keep(self, key: str, full: bool, image: NDArray[np.float32]) -> None:
        """Keep a map, (H, W, 3), at strength 1 and not turned."""
        self._split.pop((key, full), None)
        self._found[key, full] = image
        while len(self._found) > MOST:
            self._found.popitem(last=False)

    def width(self, key: str, full: bool) -> int:
        """The width of a map that is here."""
        return self._found[key, full].shape[1]

    def split(self, key: str, full: bool) -> Split | None:
        """A map's suns and the rest; None for a map that is not here."""
        of = key, full
        if of not in self._split:
            if of not in self._found:
                return None
            self._split[of] = split(Environment(self._found[of]))
            while len(self._split) > MOST:
                self._split.popitem(last=False)
        return self._split[of]


def _desk() -> bpy.types.Scene:
    """The scene from which maps are made: the artist's would be worked out anew at each frame."""
    return bpy.data.scenes.get(DESK) or bpy.data.scenes.new(DESK)


def _made(asked: Question) -> NDArray[np.float32]:
    """The map of a world, (H, W, 3), also written into its file. Raises SceneError."""
    scene = _desk()
    work_in(asked.space)
    scene.frame_set(asked.frame, subframe=asked.subframe)
    scene.cycles.device = asked.device
    like_textures(scene, asked.textures)
    scene.arto.folder = asked.folder
    before = _there()
    with bpy.data.libraries.load(asked.blend) as (_, into):
        into.worlds.append(asked.world)
    world = into.worlds[0]
    if world is None:
        raise SceneError(f"the world '{asked.world}' is not in {asked.blend}: change the world")
    try:
        put_back(asked.apart)
        for name, pixels in asked.painted.items():
            image = bpy.data.images[name]
            put_pixels(image, Path(pixels))
        if not asked.width:
            for image in images(world):
                if reduced := _reduced(image):
                    image.user_remap(reduced)
        with without_dials(scene, scene.view_layers[0].name, world) as (plain, _, _):
            if asked.width:
                found = kept.environment(scene, asked.width, None, plain)
            else:
                found = rough(scene, ROUGH_WIDTH, plain)
        arrays.write(Path(asked.out), found.image)
    finally:
        bpy.data.worlds.remove(world)
        marked.remove_file(Path(asked.blend), "temporary")
        _remove_since(before)
    return found.image


# What comes with a world, and is removed with it.
_KINDS: tuple[Callable[[], Any], ...] = (
    lambda: bpy.data.images,
    lambda: bpy.data.node_groups,
    lambda: bpy.data.textures,
    lambda: bpy.data.texts,
    lambda: bpy.data.libraries,
    lambda: bpy.data.worlds,
)


def _there() -> set[int]:
    return {block.session_uid for kind in _KINDS for block in kind()}


def _remove_since(before: set[int]) -> None:
    """Remove what has come since and is used by nothing; the artist's own blocks stay."""
    while True:
        gone = [
            block
            for kind in _KINDS
            for block in kind()
            if block.session_uid not in before and not block.users
        ]
        if not gone:
            return
        bpy.data.batch_remove(gone)


# Names of reduced HDRIs, which Cycles loads in a moment, by what they were made from.
_small: dict[tuple[object, ...], str] = {}


def forget() -> None:
    """Let go of the names of images: another file was opened, which has none of them."""
    _small.clear()


def _reduced(image: bpy.types.Image) -> bpy.types.Image | None:
    """A smaller copy of an image, each pixel the mean of the pixels that it covers.

    None where the image is small already, was painted on, or is not a single file.
    """
    width, height = image.size
    scale = min(width // (2 * ROUGH_WIDTH), height // ROUGH_WIDTH)
    if image.source != "FILE" or scale < 2 or image.is_dirty:
        return None
    digest = digest_of(image)
    key = digest, image.filepath, image.colorspace_settings.name, image.alpha_mode
    if key in _small and _small[key] in bpy.data.images:
        return bpy.data.images[_small[key]]
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    w, h = width // scale, height // scale
    blocks = pixels.reshape(height, width, 4)[: h * scale, : w * scale]
    small = blocks.reshape(h, scale, w, scale, 4).mean(axis=(1, 3), dtype=np.float32)
    out = bpy.data.images.new("ARTO Reduced", w, h, alpha=True, float_buffer=image.is_float)
    out.colorspace_settings.name = image.colorspace_settings.name
    out.alpha_mode = image.alpha_mode
    out.pixels.foreach_set(np.ascontiguousarray(small).ravel())
    out.update()
    out.use_fake_user = True
    _small[key] = out.name
    return out
