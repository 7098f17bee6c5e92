"""EXR files in the real program: what it reads and writes is what Python without Blender does."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from arto.core import exr
from arto.core.errors import ExrError
from arto.core.exr.window import Window
from exr_tools import damaged, digest, headers_of, layers
from program_tools import Program

# Reads all files of a folder and writes those that it finds as arrays. A file's digest tells its
# layers, their types and their pixels. Its arguments: the folder of the files, one to write to.
IN_PROGRAM = """
import hashlib, json, sys
from pathlib import Path
import numpy as np
from bl_ext.user_default.arto.core import exr
from bl_ext.user_default.arto.core.errors import ExrError
from bl_ext.user_default.arto.core.exr.window import Window

files, out = map(Path, sys.argv[-2:])
opened, found = len(list(Path("/proc/self/fd").iterdir())), {"name": exr.chosen().name}
for path in sorted(files.glob("*.exr")):
    try:
        digest = hashlib.sha256()
        for name, pixels in exr.parts(path):
            digest.update(repr((name, pixels.dtype.str, pixels.shape)).encode())
            digest.update(np.ascontiguousarray(pixels).tobytes())
        found[path.name] = [digest.hexdigest(), repr(exr.header(path))]
    except ExrError as e:
        found[path.name] = ["refused", ""]
given = dict(np.load(files / "layers.npz"))
about = json.loads((files / "about.json").read_text())
for compression in ("NO", *exr.COMPRESSIONS):
    written = out / f"{compression}.exr"
    exr.write(written, given, about, "ACEScg", Window(2, True), compression=compression)
try:
    exr.write(out / "nan.exr", {"": np.full((2, 2), np.nan)})
except ExrError:
    found["nan"] = True
try:
    exr.choose(exr.OpenExr())
    exr.read(out / "ZIP.exr")
except ExrError as e:
    found["package"] = str(e)
found["left"] = len(list(Path("/proc/self/fd").iterdir())) - opened
(out / "found.json").write_text(json.dumps(found))
"""


@pytest.fixture(autouse=True)
def package():
    """Outside the program the package OpenEXR reads and writes."""
    before = exr.chosen()
    exr.choose(exr.OpenExr())
    yield
    exr.choose(before)


def test_files_go_in_and_out_of_the_program_as_they_are(program: Program, tmp_path: Path) -> None:
    files, out = tmp_path / "files", tmp_path / "out"
    files.mkdir(), out.mkdir()
    given = {name: pixels.astype("f2" if n % 2 else "f4") for n, (name, pixels) in enumerate(
        layers((70, 33)).items())}  # fmt: skip
    given["Depth"][:20] = given["Combined"][:20] = 0
    np.nan_to_num(given["ViewLayer.Combined_ARTO_0003_u2"], copy=False)
    about = {"arto.key": "ä", "arto.empty": "", "arto.n": 3, "arto.x": 0.5, "arto.i4": [1, 2, 3, 4]}
    np.savez(files / "layers.npz", **given)
    (files / "about.json").write_text(json.dumps(about))
    for compression in ("NO", *exr.COMPRESSIONS, "PIZ", "RLE", "PXR24", "B44", "DWAB"):
        exr.write(files / f"{compression}.exr", given, about, compression=compression)
    sound = [(files / f"{c}.exr").read_bytes() for c in ("ZIP", "NO", "PIZ", "ZIPS")]
    for n, data in enumerate(damaged(sound, 80)):
        (files / f"damaged_{n:03d}.exr").write_bytes(data)
    program.script(IN_PROGRAM, files, out)
    found = json.loads((out / "found.json").read_text())
    assert found["name"] == "OpenImageIO"
    assert "this program has an OpenEXR of its own" in found["package"]
    assert found["nan"] is True and found["left"] == 0
    refused = 0
    for path in sorted(files.glob("*.exr")):
        try:
            expected = digest(path)
        except ExrError:
            expected = ["refused", ""]
        assert expected[0] != "refused" or path.name.startswith("damaged")
        assert found[path.name] == expected, path.name
        refused += expected[0] == "refused"
    assert refused > 20
    for compression in ("NO", *exr.COMPRESSIONS):
        here = tmp_path / "here.exr"
        window = Window(2, True)
        exr.write(here, given, about, "ACEScg", window, compression=compression)
        assert headers_of(out / f"{compression}.exr") == headers_of(here)
        assert digest(out / f"{compression}.exr") == digest(here)
