"""The files of the extension's zip alone do the main job: nothing else of the project is there, and
no library of EXR files but Blender's own."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from arto.core import exr
from exr_tools import digest

from tools import package

# As the extension runs, in a process of its own. The arguments: the folder with the files, the
# folder of the helpers that make a scene, and a folder to work in.
JOB = """
import json, sys
from pathlib import Path
files, helpers, out = sys.argv[1:]
sys.path[:0] = [files, helpers]
sys.modules["OpenEXR"] = None
import arto
import bpy
assert Path(arto.__file__).is_relative_to(files), arto.__file__
arto.register()
from arto.core import exr
from scene_tools import small_scene
scene = small_scene(Path(out))
scene.arto.samples, scene.arto.keep, scene.arto.layers = 4, "always", "FACES"
scene.arto.write_data = True
scene.arto.patterns, scene.arto.grain, scene.arto.far = "linear", False, False
bpy.ops.wm.save_as_mainfile(filepath=str(Path(out, "scene.blend")))
for step in (bpy.ops.arto.capture, bpy.ops.arto.fit, bpy.ops.arto.relight):
    assert step() == {"FINISHED"}
module = sys.modules["OpenImageIO"]
where = bpy.utils.resource_path("LOCAL")
print("FOUND", json.dumps([exr.chosen().name, Path(module.__file__).is_relative_to(where)]))
arto.unregister()
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the package `arto` is what the zip holds."""
    folder = tmp_path_factory.mktemp("extension")
    with zipfile.ZipFile(package.build()) as file:
        file.extractall(folder / "arto")
    return folder


def test_the_files_of_the_zip_do_the_main_job(files: Path, tmp_path: Path) -> None:
    before = {p for p in files.rglob("*") if p.is_file()}
    helpers = Path(__file__).parent.parent
    line = [sys.executable, "-B", "-c", JOB, str(files), str(helpers), str(tmp_path)]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    said = next(n for n in done.stdout.splitlines() if n.startswith("FOUND"))
    assert json.loads(said.removeprefix("FOUND")) == ["OpenImageIO", True]
    # and what it wrote, both libraries read: plate, layers, data, and the capture that was kept
    written, before_that, read = sorted(tmp_path.rglob("*.exr")), exr.chosen(), []
    assert len(written) == 4
    for library in (exr.OpenImageIo(OpenImageIO), exr.OpenExr()):
        exr.choose(library)
        read.append([digest(path) for path in written])
    plate = exr.read(tmp_path / "relit.exr")[""]
    layers = exr.read(next(tmp_path.glob("*layers*.exr")))
    exr.choose(before_that)
    assert read[0] == read[1]
    assert plate.shape == (18, 24, 4) and np.isfinite(plate).all() and plate[..., :3].mean() > 0.01
    sums = sum(layers[name] for name in layers if name)
    np.testing.assert_allclose(sums, plate[..., :3], atol=5e-3 * float(plate.max()))
    # nothing is written beside the code
    assert {p for p in files.rglob("*") if p.is_file()} == before
