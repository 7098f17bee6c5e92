"""A .blend, or a render, that was cut off by a full disk is told."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest
from arto.arto_addon.blender import saving, scratch
from arto.core.errors import ExrError, FilesError, SceneError


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


@pytest.mark.parametrize("left", [0, 2**30])
def test_a_full_disk_is_no_damaged_file(monkeypatch, left: int) -> None:
    monkeypatch.setattr(scratch.shutil, "disk_usage", lambda _: SimpleNamespace(free=left))
    with pytest.raises(ExrError if left else FilesError, match="cut" if left else "is full"):  # noqa: SIM117
        with scratch.temporary():
            raise ExrError("it is cut off")
