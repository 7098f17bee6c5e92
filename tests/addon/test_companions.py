"""Files beside a plate: all of one light, put in place together, and none of an earlier plate."""

from __future__ import annotations

import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.plate import marks, mattes, plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import layers, relight
from arto.arto_addon.work import Wrote
from arto.core import exr
from arto.core.errors import ExrError, SceneError


def relit(scene, **settings):
    """Relight with some settings -> (the names of all EXR files there are, what was written)."""
    for name, value in settings.items():
        setattr(scene.arto, name, value)
    wrote = []
    steps = relight.compute(scene, scene.view_layers[0].name)
    work.run(steps, lambda step: wrote.append(step.path) if isinstance(step, Wrote) else None)
    folder, ours = relit_file(scene).parent, (".exr", ".nk", ".comp")
    there = {path.name for path in folder.iterdir() if path.suffix in ours}
    return there, {path.name for path in wrote}


def test_what_another_relight_left_beside_a_plate_goes(shot):
    base = relit_file(shot).stem
    off = {"layers": "OFF", "write_data": False, "data_window": "FULL", "layers_files": "ONE"}
    before, wrote = relit(shot, layers="FACES", write_data=True, data_window="CROP")
    pictures = {f"{base}{end}.exr" for end in ("", "_full", "_layers", "_layers_full", "_data")}
    assert wrote == pictures | {f"{base}.nk", f"{base}.comp"}
    assert wrote <= before
    theirs = plate.layers_file(relit_file(shot)).with_name(f"{base}_comp.exr")
    exr.write(theirs, {"": np.ones((2, 2, 3), np.float32)})  # an artist's, by its header
    after, wrote = relit(shot, **off)
    assert wrote == {f"{base}.exr"} and after == {f"{base}.exr", theirs.name}
    _, wrote = relit(shot, layers="FACES", layers_files="EACH", layer_prefix="A_")
    assert f"{base}_A_top.exr" in wrote
    after, _ = relit(shot, layer_prefix="LG_", **off)
    assert after == {f"{base}.exr", theirs.name}
    theirs.unlink()


def test_a_relight_that_fails_half_way_changes_nothing(shot, monkeypatch):
    relit(shot, layers="FACES", write_data=True, data_window="FULL")
    folder = relit_file(shot).parent
    before = {path: path.read_bytes() for path in folder.glob("*.exr")}

    def fails(*_):
        yield work.Progress(0, "")
        raise ExrError("no room")

    monkeypatch.setattr(layers, "write", fails)
    shot.arto.own_lamps = 0.5
    with pytest.raises(ExrError, match="no room"):
        relit(shot)
    assert {path: path.read_bytes() for path in folder.glob("*.exr")} == before
    assert not list(folder.glob("*.part"))
    shot.arto.own_lamps, shot.arto.layers, shot.arto.write_data = 1.0, "OFF", False


def test_each_header_names_its_own_copy(shot):
    relit(shot, layers="FACES", data_window="CROP")
    path = relit_file(shot)
    for file in (path, plate.layers_file(path)):
        assert exr.header(file)[plate.CROPPED] == f"{file.stem}_full.exr"
        assert plate.CROPPED not in exr.header(plate.full_file(file))
        assert exr.header(file)[marks.PLATE] == path.name
    shot.arto.layers, shot.arto.data_window = "OFF", "FULL"


def rendered(path, shape=(18, 24), **said):
    """A render with a Cryptomatte, as another program writes it."""
    about = {"cryptomatte/a1b2c3d/name": "CryptoObject", **said}
    exr.write_planes(path, {"CryptoObject00": {"R": np.zeros(shape)}}, about)


@pytest.mark.parametrize(
    ("said", "match"),
    [
        ({"Frame": "0002"}, "of frame 2, and the picture is of frame 1"),
        ({"Camera": "Other"}, "through the camera 'Other'"),
        ({"shape": (18, 23)}, "23x18 pixels"),
        ({"Frame": "001", "Camera": "Camera"}, ""),
        ({}, ""),
    ],
)
def test_mattes_of_another_picture_are_refused_before_anything_is_made(shot, tmp_path, said, match):
    path = relit_file(shot)
    path.unlink(missing_ok=True)
    rendered(tmp_path / "mine.0001.exr", **said)
    shot.arto.write_data, shot.arto.cryptomatte = True, str(tmp_path / "mine.####.exr")
    try:
        if match:
            with pytest.raises(SceneError, match=match):
                relit(shot)
            assert not path.exists()
        else:
            relit(shot)
            assert "CryptoObject00.R" in mattes.cryptomatte.read(plate.data_file(path)).planes
    finally:
        shot.arto.write_data, shot.arto.cryptomatte = False, ""
