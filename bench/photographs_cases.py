"""Captures by a simulated laboratory: what is rendered, photographed and fitted.

A scene is rendered once in the light of all patches or lamps. A simulated photographer takes
photographs of that, and they go the way that real ones go: exposures are put together, the monitor
is measured, noise is taken out, supports are fitted, and the field is relit under HDRIs. The truth
is Cycles' render under the same HDRI, black where no patch is.
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.photographer import lights
from arto.core.capture import capture_set
from arto.core.capture.capture_set import CaptureSet
from arto.core.field.field import Field
from arto.core.files import whole
from arto.core.fit.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment, directions, sample_directions
from arto.core.patterns import pattern_set
from arto.core.photographs import dome_set, monitor_set, simulate
from arto.core.photographs.description import Description, Monitors
from arto.core.photographs.opened import Photographs
from arto.core.photographs.photographer import DomeRig, Exposing, MonitorRig, spiral
from arto.core.photographs.screens import hemicube_of
from arto.core.photographs.shown import patterns_of
from numpy.typing import NDArray
from PIL import Image

from . import reference, worlds

OUT = Path("out/photographs")
SIDES = {
    4: ("top", "left", "right", "back"),
    5: ("top", "left", "right", "back", "front"),
    6: ("top", "left", "right", "back", "front", "bottom"),
}
QUALITY = 95


@dataclass(frozen=True)
class Case:
    """One capture. rig: `monitors` or `dome`; jpeg: whether files are JPEG, else exact values;
    distance: of the monitors in radii, 0 for infinity; falls: of their light with the angle."""

    rig: str = "monitors"
    patches: int = 4
    sides: int = 4
    patterns: str = "moments_uv"
    camera: simulate.Camera = field(default_factory=simulate.Camera)
    jpeg: bool = True
    exposing: Exposing = field(default_factory=Exposing)
    distance: float = 0.0
    falls: float = 0.0
    clean: bool = True

    @property
    def monitors(self) -> Monitors:
        return Monitors(SIDES[self.sides], self.patches, self.patterns, 1920, 1080)

    @property
    def hemicube(self) -> Hemicube:
        if self.rig == "monitors":
            return hemicube_of(self.monitors)
        x, y, z = spiral(self.patches).T.tolist()
        return Hemicube(lamps=tuple(zip(x, y, z, strict=True)))


@dataclass(frozen=True)
class HoledWorld:
    """One of Blender's HDRIs, black where a hemicube has no patch."""

    name: str
    hole: str
    hemicube: Hemicube

    @property
    def label(self) -> str:
        return f"{self.name}_{self.hole}"

    @property
    def environment(self) -> Environment:
        path = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
        found = Environment.load(path / f"{self.name}.exr")
        height, width = found.image.shape[:2]
        azimuth, latitude, _ = sample_directions(height, width, 1)
        there = self.hemicube.locate(directions(azimuth, latitude))[0] >= 0
        return Environment(np.where(there[..., None], found.image, np.float32(0)))

    def apply(self, scene: bpy.types.Scene) -> None:
        image = worlds._packed(self.label, self.environment.image[::-1])
        worlds._set_world(scene, image, 0.0, 1.0)


def rendered(
    scene_name: str, case: Case, size: tuple[int, int], samples: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The scene in each light, without a camera's faults, and its alpha; kept by content.

    Of monitors (K, 6, H, W, 3), of a dome (K, H, W, 3).
    """
    # four sides are among five, so one render does for both
    most = max(case.sides, 5 if case.patches == 4 else 4)
    every = replace(case.monitors, sides=SIDES[most], patterns="moments_uv")
    told = [case.rig, case.patches, most, case.distance, case.falls]
    key = reference.content_key(scene=scene_name, size=size, samples=samples, lights=told)
    path = OUT / f"{scene_name}_{case.rig}_{case.patches}_{key}.npz"
    if not path.is_file():
        scene = reference.new_scene(scene_name, *size)
        layer = scene.view_layers[0].name
        if case.rig == "dome":
            steps = lights.by_lamps(scene, layer, spiral(case.patches), samples)
        else:
            steps = lights.by_monitors(scene, layer, every, case.distance, samples, case.falls)
        lit = work.run(steps)
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as partial, partial.open("wb") as file:
            np.savez(file, light=lit.light, alpha=lit.alpha)
    with np.load(path) as there:
        light, alpha = there["light"], there["alpha"]
    if case.rig == "monitors":
        # of these sides, those that the laboratory has, in the order of the faces
        faces = [face for face, _, _ in hemicube_of(every).grid]
        light = light[[k for k, face in enumerate(faces) if face in case.monitors.sides]]
    return light, alpha


class _Files:
    """The photographs of a laboratory in memory, as files hold them."""

    def __init__(self, jpeg: bool, levels: int) -> None:
        self.jpeg, self.levels = jpeg, levels
        self._there: dict[str, Any] = {}

    def put(self, name: str, values: NDArray) -> None:
        if not self.jpeg:
            self._there[name] = values
            return
        packed = io.BytesIO()
        Image.fromarray(values).save(packed, "JPEG", quality=QUALITY)
        self._there[name] = packed.getvalue()

    def read(self, path: Path) -> _Kept:
        kept = self._there[path.as_posix()]
        if isinstance(kept, bytes):
            width, height = Image.open(io.BytesIO(kept)).size
            return _Kept(kept, (height, width), self.levels)
        return _Kept(kept, kept.shape[:2], self.levels)


@dataclass
class _Kept:
    """A photograph that is unpacked when it is looked at."""

    kept: Any
    shape: tuple[int, int]
    levels: int
    linear: bool = False
    exposure: float | None = None
    aperture: float | None = None
    iso: float | None = None
    focal: float | None = None

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        kept = self.kept
        values = np.asarray(Image.open(io.BytesIO(kept))) if isinstance(kept, bytes) else kept
        return np.asarray(values[first:last], np.float32) / np.float32(np.iinfo(values.dtype).max)


def photographed(
    case: Case, light: NDArray, alpha: NDArray, folder: Path, seed: int = 0
) -> tuple[Field, int]:
    """What becomes of the photographs of a case -> its field, and how many photographs it took."""
    camera = case.camera
    files = _Files(case.jpeg, 2**camera.bits - 1)
    said: Description
    if case.rig == "dome":
        dome = DomeRig(spiral(case.patches), camera, case.exposing, seed=seed)
        said = dome.photograph(light.__getitem__, files.put)
        photos = Photographs(Path(), said, files.read)
        steps = dome_set.write(folder, photos)
    else:
        rig = MonitorRig(case.monitors, camera, case.exposing, falls=case.falls, seed=seed)
        said = rig.photograph(light.__getitem__, files.put)
        photos = Photographs(Path(), said, files.read)

        def taken(group: Sequence[Any]) -> NDArray:
            return photos.measured(group)[0]

        steps = monitor_set.write(folder, photos.said, taken, clean=case.clean)
    for _ in steps:
        pass
    return fitted(folder), len(said.photographs)


def faultless(case: Case, light: NDArray, alpha: NDArray, samples: int, folder: Path) -> Field:
    """The field of the same capture by a camera and monitors without faults."""
    if case.rig == "dome":
        cube = case.hemicube
        basis = light[:, None] * cube.solid_angles[:, None, None, None, None].astype(np.float32)
        told = {"choice": "whole", "separate": False}
        capture_set.write(folder, cube, pattern_set("white"), basis, alpha=alpha, **told)
        return fitted(folder)
    patterns = patterns_of(case.monitors)
    shows = simulate.emissions(simulate.TrueScreen(np.zeros((3, 2))), case.hemicube, case.monitors)
    basis = np.empty((len(light), len(patterns), *light.shape[2:]), np.float32)
    for k in range(len(light)):
        for p, emission in enumerate(shows):
            basis[k, p] = simulate.basis_image(light[k], emission)
    # what is left of noise is that of the render
    told = {"choice": monitor_set.choice_of(patterns), "separate": False, "samples": samples}
    # a polynomial's picture may be below 0 by rounding
    np.maximum(basis, 0, out=basis)
    capture_set.write(folder, case.hemicube, patterns, basis, alpha=alpha, **told)
    return fitted(folder)


def fitted(folder: Path) -> Field:
    """The field of a capture set, fitted as it says."""
    source = CaptureSet(folder)
    choice, separate = source.head.told_choice
    out = folder.with_name(folder.name + "_field")
    shutil.rmtree(out, ignore_errors=True)
    for _ in fit(source, out, choice, separate):
        pass
    shutil.rmtree(folder, ignore_errors=True)
    return Field(out)
