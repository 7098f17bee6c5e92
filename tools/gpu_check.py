"""Whether a GPU captures and relights as the CPU does: `python tools/gpu_check.py`.

The product of `bench` is captured three times, twice on the CPU with two seeds and once on the GPU,
and each field is relit. Two pictures of the CPU differ by their noise. The picture of the GPU is to
differ from each of them by no more. `--device` names a kind of GPU, or `CPU` for a try without one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import arto
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender import devices
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.relight import relight
from arto.core import exr
from numpy.typing import NDArray

from bench import reference
from bench.worlds import World

# How many times their noise two pictures of different devices may differ.
MOST = 1.2


def picture(folder: Path, device: str, seed: int, samples: int, width: int) -> NDArray[np.float32]:
    """Capture on a device and relight -> (H, W, 3)."""
    scene = reference.new_scene("product", width, width * 3 // 4)
    World("courtyard").apply(scene)
    devices.render_with(scene, device)
    settings = scene.arto
    settings.folder, settings.output = str(folder / "arto"), str(folder / "relit.exr")
    settings.quality, settings.samples, settings.seed = "CUSTOM", samples, seed
    settings.keep, settings.denoise, settings.depth = "never", False, "FLOAT"
    # the same patches for all: those that a probe asks for hang on its noise
    settings.adaptive = False
    begun = time.perf_counter()
    work.run(capture(scene, scene.view_layers[0].name))
    path, _ = work.run(relight.relight(scene))
    seconds = time.perf_counter() - begun
    print(f"{devices.used(scene)}, seed {seed}: {seconds:.1f} s", flush=True)
    return exr.read(path)[""][..., :3]


def apart(a: NDArray, b: NDArray) -> float:
    """The mean relative difference of two pictures."""
    floor = 0.01 * float(a.mean())
    return float((np.abs(a - b) / (np.abs(a) + np.abs(b) + floor)).mean())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="GPU", choices=("GPU", "CPU", *devices.KINDS))
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--width", type=int, default=320)
    options = parser.parse_args()
    arto.register()
    pictures = []
    with tempfile.TemporaryDirectory() as root:
        for i, device in enumerate(("CPU", "CPU", options.device)):
            folder = Path(root) / str(i)
            folder.mkdir()
            pictures.append(picture(folder, device, i, options.samples, options.width))
    one, two, other = pictures
    noise, found = apart(one, two), (apart(one, other) + apart(two, other)) / 2
    brighter = float(other.mean() / ((one.mean() + two.mean()) / 2))
    print(f"CPU and CPU differ by {noise:.4f}, CPU and {options.device} by {found:.4f}")
    print(f"the light of {options.device} is {brighter:.4f} of that of the CPU")
    good = found <= MOST * noise and abs(brighter - 1) < 0.01
    print("the same within noise" if good else "NOT the same")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
