"""Pictures of one kind each, and what they are made of, as digests: whether two checkouts make the
same ones, bit for bit.

`python tools/same_pictures.py FOLDER` in one checkout, then, in the other, `--against FOLDER`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import arto
import numpy as np
from arto.arto_addon.ui.cli import main as command
from arto.core import exr

from bench import reference
from bench.worlds import World

SIZE = (160, 120)
Change = Callable[[Any], None]


def _shot(
    folder: Path, source: Path | None, change: Callable[[Any], None], **settings: Any
) -> None:
    """The product under an HDRI, saved; or the very scene that another checkout has made, whose
    meshes are then the same to the last bit."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder.resolve() / f"{folder.name}.blend"
    if source:
        shutil.copyfile(source / folder.name / path.name, path)
        bpy.ops.wm.open_mainfile(filepath=str(path))
    else:
        scene = reference.new_scene("product", *SIZE)
        World("courtyard").apply(scene)
        scene.arto.samples, scene.render.film_transparent = 16, True
        for key, value in settings.items():
            setattr(scene.arto, key, value)
        change(scene)
    bpy.context.scene.arto.output = str(path.with_suffix(".exr"))
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def _commands(*lines: list[str]) -> None:
    for line in lines:
        if code := command(line):
            raise SystemExit(f"{' '.join(line)} ended with {code}")


def demo(folder: Path, source: Path | None) -> None:
    """An opaque film, denoised, with the HDRI's lamps rendered."""

    def opaque(scene: Any) -> None:
        scene.render.film_transparent = False

    _shot(folder, source, opaque)
    _commands(["capture"], ["fit"], ["relight"])


def layers(folder: Path, source: Path | None) -> None:
    """Layers by face, data, and kept images fitted afterwards."""
    _shot(folder, source, lambda _: None, keep="always", layers="FACES", write_data=True)
    _commands(["capture"], ["fit"], ["relight"])


def catcher(folder: Path, source: Path | None) -> None:
    """A plate with a shadow catcher: three takes."""

    def catching(scene: Any) -> None:
        things = [thing for thing in scene.objects if thing.type == "MESH"]
        min(things, key=lambda thing: thing.bound_box[0][2]).is_shadow_catcher = True

    _shot(folder, source, catching)
    _commands(["capture"], ["fit"], ["relight"])


def farm(folder: Path, source: Path | None) -> None:
    """The same by a farm, in two tiles."""
    _shot(folder, source, lambda _: None, keep="never")
    job = str((folder / "job").resolve())
    _commands(["plan", "--job", job, "--tiles", "2"])
    for part in range(2):
        _commands(["part", str(part), "--job", job])
    _commands(["gather", "--job", job], ["relight"])


def sequence(folder: Path, source: Path | None) -> None:
    """Two frames of a camera that moves, and a turntable of the first."""

    def moving(scene: Any) -> None:
        for frame, x in ((1, 0.0), (2, 0.1)):
            scene.camera.location.x += x
            scene.camera.keyframe_insert("location", frame=frame)

    _shot(folder, source, moving, keep="never")
    _commands(
        ["capture", "--frames", "1-2"],
        ["relight", "--frames", "1-2"],
        ["relight", "--turntable", "3"],
    )


KINDS = (demo, layers, catcher, farm, sequence)


def digests(folder: Path) -> dict[str, str]:
    """Of each picture that was written into a folder, and of each of its layers."""
    found = {}
    for path in sorted(folder.glob("*.exr")):
        for name, pixels in sorted(exr.read(path).items()):
            told = hashlib.sha256(np.ascontiguousarray(pixels).tobytes()).hexdigest()[:16]
            found[f"{folder.name}/{path.name}:{name}"] = f"{pixels.dtype}{pixels.shape} {told}"
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--against", type=Path, help="the folder that another checkout filled")
    parser.add_argument("--only", nargs="*", help="kinds of pictures")
    options = parser.parse_args()
    arto.register()
    found: dict[str, str] = {}
    for kind in KINDS:
        if not options.only or kind.__name__ in options.only:
            kind(options.folder / kind.__name__, options.against)
        found |= digests(options.folder / kind.__name__)
    (options.folder / "digests.json").write_text(json.dumps(found, indent=1))
    if not options.against:
        print(f"{len(found)} layers of pictures")
        return 0
    other = json.loads((options.against / "digests.json").read_text())
    differ = sorted(k for k in found.keys() | other.keys() if found.get(k) != other.get(k))
    print("\n".join(f"DIFFERS {name}" for name in differ))
    print(f"{len(found) - len(differ)} of {len(found)} layers of pictures are the same bit for bit")
    return bool(differ)


if __name__ == "__main__":
    sys.exit(main())
