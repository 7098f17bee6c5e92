"""Pictures that ARTO shows in the file take a name, and never an image of the artist's."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from arto.arto_addon.blender import pictures
from arto.arto_addon.live.image import IMAGE, put_away
from arto.arto_addon.plate import compare


@pytest.mark.parametrize("name", [IMAGE, compare.IMAGE])
def test_an_image_of_the_artists_only_gives_its_name(name) -> None:
    """What is shown takes the name, and what goes with the window is ours alone."""
    painted = bpy.data.images.new(name, 4, 2)
    painted.pixels.foreach_set(np.full(32, 0.25, np.float32))
    shown = pictures.put(name, np.ones((2, 3, 4), np.float32))
    assert shown != painted and shown.name == name
    assert pictures.put(name, np.zeros((2, 3, 4), np.float32)) == shown
    put_away("no plate", compare.IMAGE)
    compare.forget()
    assert name not in bpy.data.images
    # nor does what only has the name go
    painted.name = name
    put_away("no plate", compare.IMAGE)
    compare.forget()
    assert bpy.data.images[name] == painted
    found = np.empty(32, np.float32)
    painted.pixels.foreach_get(found)
    np.testing.assert_allclose(found, 0.25, atol=1 / 255)
    bpy.data.images.remove(painted)
