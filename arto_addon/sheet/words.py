"""Words drawn with Blender's own font, without a window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import blf
import bpy
import imbuf
import numpy as np
from numpy.typing import NDArray

from ..blender.scratch import temporary
from .layout import SIZE

# Blender's own font.
_FONT = 0


@dataclass(frozen=True)
class Words:
    """A line of words. row, column: of the left end of its base line; width: the most it may take;
    light: how bright it is, 0 to 1."""

    text: str
    row: int
    column: int
    width: int
    light: float = 1.0


def write(picture: NDArray[np.float32], every: Sequence[Words]) -> None:
    """Write words into a picture (H, W, 3), rows from the top, 0 to 1; what is too long is cut."""
    height, width = picture.shape[:2]
    blf.size(_FONT, SIZE)
    blf.color(_FONT, 1.0, 1.0, 1.0, 1.0)
    for light in {words.light for words in every}:
        some = [words for words in every if words.light == light]
        buffer = imbuf.new((width, height))
        with temporary() as folder:
            path = folder / "words.png"
            try:
                with blf.bind_imbuf(_FONT, buffer):
                    for words in some:
                        blf.position(_FONT, words.column, height - words.row, 0)
                        blf.draw_buffer(_FONT, fitting(words.text, words.width))
                imbuf.write(buffer, filepath=str(path))
            finally:
                buffer.free()
            covered = _alpha(str(path), height, width)
        picture += covered[..., None] * (light - picture)


def fitting(text: str, width: int) -> str:
    """A text, cut at its end where it is wider than some pixels."""
    if blf.dimensions(_FONT, text)[0] <= width:
        return text
    while text and blf.dimensions(_FONT, f"{text}…")[0] > width:
        text = text[:-1]
    return f"{text.rstrip()}…"


def _alpha(path: str, height: int, width: int) -> NDArray[np.float32]:
    """How much the letters in a file cover of each pixel -> (H, W)."""
    image = bpy.data.images.load(path)
    try:
        pixels = np.empty(height * width * 4, np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)[::-1, :, 3]
