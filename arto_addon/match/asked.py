"""What a match is asked for: a target and a mask, as pixels of the shot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.errors import ArtoError, SceneError, TargetError
from ...core.match.target import fitting
from ..blender import sequences
from ..blender.colour import working_space
from ..plate.names import relit_file
from ..plate.plate import shown_file
from ..shot import home

# The image that a plate is painted over in.
PAINTED = "ARTO Painted Target"


@dataclass(frozen=True)
class Asked:
    """A target of the shot's size.

    picture: (H, W, 3), scene-linear; mask, keep: (H, W), how much a pixel counts for the target,
    and for staying as it is; words: what was done to the target, "" for nothing.
    """

    picture: NDArray[np.float64]
    mask: NDArray[np.float64]
    keep: NDArray[np.float64]
    words: str = ""


def asked(scene: bpy.types.Scene, shape: tuple[int, int]) -> Asked:
    """Read the target and the masks that the settings name. Raises TargetError, ExrError.

    shape: height and width of the shot.
    """
    settings = scene.arto
    name = settings.match_target
    if name:
        picture = _of_file(home.absolute(name))
    elif settings.match_image:
        name, picture = settings.match_image.name, pixels_of(settings.match_image)
    else:
        raise TargetError("there is no target: choose a file, or an image of this .blend")
    mask, keep = masks(scene, shape)
    h, w = picture.shape[:2]
    words = (
        "" if (h, w) == shape else f"the target was {w} x {h}, and was scaled to the shot's size"
    )
    fit = fitting(picture, shape)
    if fit.shape[-1] == 4:
        # where the target is empty it says nothing
        mask = mask * np.clip(np.nan_to_num(fit[..., 3], nan=0.0), 0, 1)
    good = np.isfinite(fit).all(axis=-1)
    return Asked(np.where(good[..., None], fit[..., :3], 0), mask * good, keep, words)


def named_in(scene: bpy.types.Scene) -> list[Path]:
    """The files of the target and the masks that the settings name."""
    settings = scene.arto
    found = [home.absolute(settings.match_target)] if settings.match_target else []
    for image in (settings.match_image, settings.match_mask, settings.match_keep):
        found += sequences.files_of(image) if image else []
    return found


def masks(
    scene: bpy.types.Scene, shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The pixels to match and those to keep, (H, W) each, 0 to 1. Raises TargetError."""
    settings = scene.arto
    mask, keep = np.ones(shape), np.zeros(shape)
    if settings.match_mask:
        mask = _grey(settings.match_mask, shape)
    if settings.match_keep:
        keep = _grey(settings.match_keep, shape)
        if not settings.match_mask:
            mask = 1 - keep
    return mask, keep


def _grey(image: bpy.types.Image, shape: tuple[int, int]) -> NDArray[np.float64]:
    """A mask's brightness times its alpha, at the size of the shot. Raises TargetError."""
    raw = _raw(image)
    if not np.isfinite(raw).all():
        raise TargetError(
            f"the mask '{image.name}' has pixels that are infinite or not a number: paint it anew"
        )
    return np.clip(fitting(raw[..., :3].mean(axis=-1) * raw[..., 3], shape), 0, 1)


def _of_file(path: Path) -> NDArray[np.float64]:
    """The pixels of a target's file, (h, w, 3 or 4). Raises TargetError, ExrError."""
    if not path.is_file():
        raise TargetError(f"there is no file {path}: choose a target")
    if wrong := sequences.damage(path):
        raise TargetError(f"{wrong}: copy it anew, or choose another target")
    if path.suffix.lower() == ".exr":
        for pixels in exr.read(path).values():
            if pixels.shape[-1] >= 3:
                return pixels[..., : 4 if pixels.shape[-1] == 4 else 3].astype(np.float64)
        raise TargetError(f"{path} has no colour: a target needs R, G and B")
    try:
        image = bpy.data.images.load(str(path))
    except RuntimeError as e:
        raise TargetError(f"{path} cannot be read ({e}): choose a picture") from e
    try:
        return pixels_of(image)
    finally:
        bpy.data.images.remove(image)


def _raw(image: bpy.types.Image) -> NDArray[np.float64]:
    """An image's numbers as Blender has them, (h, w, 4), rows top-down. Raises TargetError."""
    for path in sequences.files_of(image):
        if path.is_file() and (wrong := sequences.damage(path)):
            raise TargetError(f"{wrong}: copy it anew, or choose another image")
    width, height = image.size
    if not width or not height or image.channels != 4:
        raise TargetError(f"the image '{image.name}' has no pixels: reload it, or choose another")
    found = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(found)
    return found.reshape(height, width, 4)[::-1].astype(np.float64)


def pixels_of(image: bpy.types.Image) -> NDArray[np.float64]:
    """An image as light, (h, w, 4), rows top-down, in the working space. Raises TargetError.

    Blender has pixels of floats in the working space, and pixels of bytes as they are in the file.
    """
    found = _raw(image)
    space = image.colorspace_settings
    if image.is_float or space.is_data:
        return found
    if space.name == "sRGB" and working_space() == "Linear Rec.709":
        c = found[..., :3]
        found[..., :3] = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return found
    return _converted(found, space.name, image.name)


def _converted(pixels: NDArray[np.float64], space: str, name: str) -> NDArray[np.float64]:
    """Bring pixels of a colour space to light, by Blender's own configuration."""
    bpy.utils.expose_bundled_modules()
    try:
        import PyOpenColorIO as ocio  # noqa: N813
    except ImportError:
        raise TargetError(
            f"the image '{name}' is in the colour space '{space}', which this Blender cannot "
            "convert here: save it as an OpenEXR file, and choose that"
        ) from None
    try:
        config = ocio.GetCurrentConfig()
        processor = config.getProcessor(space, working_space()).getDefaultCPUProcessor()
    except ocio.Exception as e:
        raise TargetError(
            f"the image '{name}' is in the colour space '{space}', which cannot be brought to "
            f"light ({e}): save it as an OpenEXR file, and choose that"
        ) from e
    colour = np.ascontiguousarray(pixels[..., :3], np.float32)
    processor.applyRGB(colour)
    return np.concatenate([colour.astype(np.float64), pixels[..., 3:]], axis=-1)


def paint_over(scene: bpy.types.Scene) -> bpy.types.Image:
    """Make the target an image to paint on, which begins as the plate. Raises SceneError, ExrError.

    The image has no alpha: what is painted counts, wherever it is.
    """
    path = relit_file(scene)
    if not path.is_file():
        raise SceneError(f"there is no plate {path} to paint over: relight first")
    plate = next(iter(exr.read(shown_file(path, exr.header(path))).values()))
    height, width = plate.shape[:2]
    image = bpy.data.images.new(PAINTED, width, height, alpha=False, float_buffer=True)
    image.colorspace_settings.name = working_space()
    image.use_view_as_render = True
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = plate[::-1, :, :3]
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    scene.arto.match_target, scene.arto.match_image = "", image
    return image


def what(scene: bpy.types.Scene) -> str:
    """Say what the settings' target is, in few words; empty where there is none."""
    settings = scene.arto
    try:
        path = home.absolute(settings.match_target) if settings.match_target else None
    except ArtoError:
        path = Path(settings.match_target)
    if path is not None:
        return path.name
    return settings.match_image.name if settings.match_image else ""
