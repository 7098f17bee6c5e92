"""A .blend that was cut off by a full disk is told."""

from __future__ import annotations

import bpy
import pytest
from arto.arto_addon.blender import saving
from arto.core.errors import SceneError


@pytest.mark.parametrize("packed", [False, True])
def test_a_blend_without_its_end_is_told(tmp_path, packed: bool) -> None:
    path = tmp_path / "shot.blend"
    block = bpy.data.node_groups.new("Saved", "ShaderNodeTree")
    bpy.data.libraries.write(str(path), {block}, fake_user=True, compress=packed)
    bpy.data.node_groups.remove(block)
    saving.check_whole(path)
    data = path.read_bytes()
    # what is plain ends with a block that is all zeros
    end = len(data) - (1 if packed else 60)
    for left in (0, 5, 3000, end // 2, end - 12, end):
        path.write_bytes(data[:left])
        with pytest.raises(SceneError, match="full"):
            saving.check_whole(path)
    # a part in its middle that is missing
    if packed:
        path.write_bytes(data[:1000] + data[1010:])
        assert not saving.is_whole(path)
