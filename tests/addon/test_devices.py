"""What Cycles renders with, on machines of which the device list is faked: none here has a GPU."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from arto.arto_addon import work
from arto.arto_addon.blender import devices
from arto.arto_addon.blender.devices import Devices
from arto.arto_addon.capture.capture import capture
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import DeviceMemoryError, SceneError
from scene_tools import small_scene


class Preferences:
    """Cycles' preferences, on a machine with these devices: (name, kind, ID)."""

    def __init__(self, *there: tuple[str, str, str], kind: str = "NONE") -> None:
        self.there, self.devices = there, []
        self.compute_device_type = kind

    def refresh_devices(self) -> None:
        known = {device.id for device in self.devices}
        for name, kind, uid in self.there:
            if uid not in known:
                one = SimpleNamespace(name=name, type=kind, id=uid, use=kind != "CPU")
                self.devices.append(one)


@pytest.fixture
def machine(monkeypatch):
    """Make a machine of devices -> its preferences."""

    def made(*there: tuple[str, str, str], kind: str = "NONE") -> Preferences:
        found = Preferences(*there, kind=kind)
        monkeypatch.setattr(devices, "_preferences", lambda: found)
        monkeypatch.setattr(
            devices, "available", lambda kind: [uid for _, k, uid in there if k == kind]
        )
        return found

    return made


CARD = (("Processor", "CPU", "cpu"), ("Card", "CUDA", "card"), ("Card", "OPTIX", "card+rays"))


def test_a_job_uses_the_gpu_where_the_preferences_were_never_saved(machine):
    machine(*CARD, kind="OPTIX")
    told = devices.chosen()
    assert told == Devices("OPTIX", {"cpu": False, "card": True, "card+rays": True})
    of_job = machine(*CARD)  # another Blender: nothing was saved, so its list is empty
    devices.use(told)
    scene = SimpleNamespace(cycles=SimpleNamespace(device="GPU"))
    assert of_job.compute_device_type == "OPTIX" and devices.used(scene) == "OPTIX: Card"


def test_a_part_takes_the_quickest_gpu_that_is_there_and_says_which(machine):
    scene = SimpleNamespace(cycles=SimpleNamespace(device="CPU"))
    machine(*CARD)
    devices.render_with(scene, "GPU")
    assert scene.cycles.device == "GPU" and devices.used(scene) == "OPTIX: Card"
    devices.render_with(scene, "CUDA")
    assert devices.used(scene) == "CUDA: Card"
    devices.render_with(scene, "CPU")
    assert devices.used(scene) == "CPU"
    for name in ("GPU", "HIP"):
        machine(CARD[0])
        with pytest.raises(SceneError, match="--device CPU"):
            devices.render_with(scene, name)


def test_a_device_that_was_taken_out_is_not_named(machine):
    found = machine(*CARD, kind="CUDA")
    found.refresh_devices()
    scene = SimpleNamespace(cycles=SimpleNamespace(device="GPU"))
    assert devices.used(scene) == "CUDA: Card"
    devices.available = lambda _: []  # undone by the fixture
    assert devices.used(scene) == "CPU"


def test_a_render_without_memory_is_tried_again_in_smaller_tiles(tmp_path):
    scene = small_scene(tmp_path)
    scene.arto.samples, scene.arto.far, scene.render.resolution_y = 1, False, 48
    steps, tries, warned = capture(scene, scene.view_layers[0].name), [], []

    def do(step):
        if isinstance(step, work.Warned):
            warned.append(step.text)
        if isinstance(step, work.Render):
            tries.append(step.text)
            if len(tries) == 1:
                step.state, step.trouble = "no memory", "out of memory in a fake"
            else:
                work.blocking_render(step)

    there = CaptureSet(work.driven(steps, do))
    assert len(tries) == 3 and len(there.head.tiles) == 2
    assert sum(tile.region.height for tile in there.head.tiles) == 48
    assert len(warned) == 1 and "smaller tiles" in warned[0]
    # a tile of a few rows is not cut again
    scene.arto.seed, scene.render.resolution_y = 7, 12

    def never(step):
        if isinstance(step, work.Render):
            step.state = "no memory"

    with pytest.raises(DeviceMemoryError, match="render on the CPU"):
        work.driven(capture(scene, scene.view_layers[0].name), never)
