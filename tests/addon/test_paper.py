"""The paper's own way, from end to end: its faces, its nine patterns, its search."""

from __future__ import annotations

import pytest
from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.core import exr
from arto.core.errors import PatternError
from arto.core.faces import FACES
from scene_tools import assert_as_cycles, captured, set_colour, small_scene


@pytest.mark.newest
def test_the_papers_way(tmp_path):
    """Four faces above the horizon, nine patterns, one render a pattern, Algorithm 1: under white
    light from just those directions it is what Cycles renders."""
    scene = small_scene(tmp_path)
    scene.render.film_transparent = True
    settings = scene.arto
    settings.preset, settings.patches = "paper", 2
    settings.patterns, settings.route, settings.samples = "paper", "pattern", 512
    there = captured(scene)
    assert len(there.hemicube) == 4 + 3 * 2
    assert len(there.files[0]) == 9
    # the box in closed form needs moments that these patterns cannot tell, and says so
    settings.support = "box"
    with pytest.raises(PatternError, match="'moments'"):
        work.run(fit.fit(scene))
    settings.support = "search"
    work.run(fit.fit(scene))
    _half_white(scene)
    path, _ = work.run(relight.relight(scene))
    assert_as_cycles(exr.read(path)[""], scene, 512, tmp_path)


def _half_white(scene):
    """A world that is white where the paper's four faces are: up, and all sides but the front."""
    set_colour(scene, (1, 1, 1))
    tree = scene.world.node_tree
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], split.inputs[0])

    def math(operation, a, b):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, (a, b), strict=False):
            if isinstance(value, float):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return node.outputs[0]

    x, y, z = (split.outputs[i] for i in range(3))
    # not the front: -y is not the largest of |x|, |y|, |z|
    rest = math("MAXIMUM", math("ABSOLUTE", x, 0.0), z)
    front = math("GREATER_THAN", math("MULTIPLY", y, -1.0), rest)
    lit = math("MULTIPLY", math("GREATER_THAN", z, 0.0), math("SUBTRACT", 1.0, front))
    tree.links.new(lit, tree.nodes["Background"].inputs["Strength"])
    assert FACES["front"][0] == (0, -1, 0)
