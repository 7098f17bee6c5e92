"""Files that others saved, with Blender 2.50 to 2.76: they come out as Cycles renders them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import scene_id
from arto.core import exr
from arto.core.metrics import mean_relative_error
from scene_tools import captured, cycles, hdri, smooth

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(os.environ.get("ARTO_SCENES") or ROOT.parent / "shared" / "scenes")


@pytest.mark.parametrize(
    "name", ["AreaLight_269", "BlenderDefault_276", "TorusLightsCams_250_compressed"]
)
def test_an_old_file_is_what_cycles_renders(tmp_path, name):
    """Beside two seeds of Cycles: no farther off than a twentieth more than they are."""
    source = FOLDER / f"{name}.blend"
    if not source.is_file():
        pytest.skip(f"{source} is not there: set ARTO_SCENES to the folder of old files")
    shutil.copy(source, tmp_path / "old.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "old.blend"), load_ui=False)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.render.resolution_percentage = 100
    scene.camera.data.lens *= 2  # the torus is thin
    scene.render.film_transparent = True
    scene.world = new_world("HDRI")
    hdri(scene, smooth(), rotation=0.5)
    scene_id.give(scene)
    settings = scene.arto
    settings.folder, settings.output = str(tmp_path / "arto"), str(tmp_path / "relit.exr")
    settings.samples, settings.patches, settings.adaptive = 128, 4, False
    settings.patterns, settings.denoise, settings.lamps = "linear", False, False
    captured(scene)
    work.run(fit.fit(scene))
    path, _ = work.run(relight.relight(scene))
    picture = exr.read(path)[""]
    one, two = (cycles(scene, 256, seed, tmp_path) for seed in (1, 2))
    seen = one[..., 3] > 0.999
    assert seen.sum() > 80
    floor = mean_relative_error(one[..., :3], two[..., :3], seen)
    assert mean_relative_error(picture[..., :3], one[..., :3], seen) < floor + 0.02
    assert abs(picture[seen].mean() / one[seen].mean() - 1) < 0.01
    np.testing.assert_allclose(picture[..., 3], one[..., 3], atol=0.05)
