"""A shot with a shadow catcher in the real program: captured, relit with layers, and mixed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from arto.core import exr
from program_tools import MAKE_CATCHER, Program, said

SCENE = (
    MAKE_CATCHER
    + """
bpy.data.objects["Light"].lightgroup = "Key"
scene.view_layers[0].lightgroups.add(name="Key")
scene.arto.samples, scene.arto.patches, scene.arto.adaptive = 16, 1, False
scene.arto.layers, scene.arto.denoise = "FACES", False
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
"""
)
MIXED = """
import bpy, sys
scene = bpy.context.scene
scene.arto.use_in_compositor = "RENDER"
node = next(n for n in scene.compositing_node_group.nodes if "LG_own_Key" in n.inputs)
node.inputs["LG_own_Key"].default_value = 0.0
bpy.ops.arto.mix_to_scene()
assert bpy.data.objects["Light"].data.energy == 0 and scene.world.name == "ARTO Mix"
"""


def test_a_plate_by_the_command_line(program: Program, tmp_path: Path) -> None:
    """Processes of their own: the layers sum to the plate, the ground has a shadow, and what was
    written opens with a mixer that goes back to the scene."""
    blend = tmp_path / "shot.blend"
    program.script(SCENE, blend)
    for line in (("capture",), ("relight", "--write-data")):
        done = program.run("-b", blend, "--command", "arto", *line)
        assert done.returncode == 0, said(done)
    layers = exr.read(tmp_path / "shot_relit_layers.exr")
    picture = layers.pop("")
    assert "LG_own_Key" in layers and "LG_top" in layers
    off = np.abs(sum(layer.astype(float) for layer in layers.values()) - picture[..., :3])
    assert off.max() < 5e-3 * picture.max()
    share = exr.read(tmp_path / "shot_relit_catcher.exr")[""]
    assert share.min() < 0.8 and abs(np.median(share) - 1) < 0.1
    assert "normal" in exr.read(tmp_path / "shot_relit_data.exr")
    text = f"import bpy; bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); bpy.ops.arto.relight()"
    program.script(text + MIXED)
