"""What a laboratory's photographs are good for: a simulated capture against Cycles.

A scene is rendered once in the light of all patches or lamps. A simulated photographer takes
photographs of that, and they go the way that real ones go: exposures are put together, the monitor
is measured, noise is taken out, supports are fitted, and the field is relit under HDRIs. The truth
is Cycles' render under the same HDRI, black where no patch is.
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.photographer import lights
from arto.core import metrics
from arto.core.capture import capture_set
from arto.core.capture.capture_set import CaptureSet
from arto.core.field.field import Field
from arto.core.files import whole
from arto.core.fit.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.light.environment import Environment, directions, sample_directions
from arto.core.light.light import PatchLight
from arto.core.photographs import dome_set, monitor_set, simulate
from arto.core.photographs.description import Description, Monitors
from arto.core.photographs.opened import Photographs
from arto.core.photographs.photographer import DomeRig, Exposing, MonitorRig, spiral
from arto.core.photographs.reader import InMemory
from arto.core.photographs.screens import hemicube_of
from arto.core.photographs.shown import patterns_of
from arto.core.relight import relight
from numpy.typing import NDArray
from PIL import Image

from . import reference, scenes, worlds
from .machine import write_rows

OUT = Path("out/photographs")
SIDES = {
    4: ("top", "left", "right", "back"),
    5: ("top", "left", "right", "back", "front"),
    6: ("top", "left", "right", "back", "front", "bottom"),
}
HDRIS = ("courtyard", "interior", "sunset", "studio")
QUALITY = 95
MAP_HEIGHT = 512


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
        azimuth, latitude, _ = sample_directions(*found.image.shape[:2], 1)
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

    def read(self, path: Path) -> InMemory:
        return _Kept(self._there[path.as_posix()], self.levels)


class _Kept(InMemory):
    """A photograph that is unpacked when it is looked at."""

    def __init__(self, kept: Any, levels: int) -> None:
        super().__init__(np.zeros((1, 1, 3)), levels=levels)
        self._kept = kept
        if isinstance(kept, bytes):
            width, height = Image.open(io.BytesIO(kept)).size
            self._shape = height, width
        else:
            self._shape = kept.shape[:2]

    @property
    def shape(self) -> tuple[int, int]:
        return self._shape

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        kept = self._kept
        values = np.asarray(Image.open(io.BytesIO(kept))) if isinstance(kept, bytes) else kept
        return values[first:last] / np.float32(np.iinfo(values.dtype).max)


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


def faultless(case: Case, light: NDArray, alpha: NDArray, folder: Path) -> Field:
    """The field of the same capture by a camera and monitors without faults."""
    if case.rig == "dome":
        cube = case.hemicube
        basis = light[:, None] * cube.solid_angles[:, None, None, None, None].astype(np.float32)
        told = {"choice": "whole", "separate": False}
        capture_set.write(
            folder,
            cube,
            monitor_set.patterns_of(replace(case.monitors, patterns="white")),
            basis,
            alpha=alpha,
            **told,
        )
        return fitted(folder)
    patterns = patterns_of(case.monitors)
    shows = simulate.emissions(simulate.TrueScreen(np.zeros((3, 2))), case.hemicube, case.monitors)
    basis = np.empty((len(light), len(patterns), *light.shape[2:]), np.float32)
    for k in range(len(light)):
        for p, emission in enumerate(shows):
            basis[k, p] = simulate.basis_image(light[k], emission)
    told = {"choice": monitor_set.choice_of(patterns), "separate": False}
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


@lru_cache(maxsize=8)
def _light(world: HoledWorld, hemicube: Hemicube) -> PatchLight:
    return PatchLight(world.environment, hemicube)


def case_rows(
    scene_name: str,
    case: Case,
    hdris: Iterable[str],
    size: tuple[int, int],
    samples: int,
    many: int,
    keep: Callable[[str, NDArray, NDArray, NDArray], None] | None = None,
) -> list[dict[str, Any]]:
    """The rows of one case: of each world, all pixels and each material."""
    light, alpha = rendered(scene_name, case, size, samples)
    folder = OUT / "work"
    fields = {}
    for name in ("faults", "none"):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / "faults").mkdir(parents=True)
    fields["faults"], count = photographed(case, light, alpha, folder / "faults")
    (folder / "none").mkdir(parents=True)
    fields["none"] = faultless(case, light, alpha, folder / "none")
    hole = f"{case.sides}_sides" if case.rig == "monitors" else "whole"
    seen_cube = case.hemicube if case.rig == "monitors" else Hemicube()
    rows = []
    for hdri in hdris:
        world = HoledWorld(hdri, hole, seen_cube)
        truth = reference.reference(
            scene_name,
            world,  # type: ignore[arg-type]
            size,
            many,
            1,
            lambda: reference.new_scene(scene_name, *size),
            denoise=True,
        )
        seen = truth.alpha > 0.999
        pictures = {}
        for name, made in fields.items():
            shown = relight(made, _light(world, made.hemicube))[..., :3]
            if case.rig == "dome":
                # nothing of a dome's photographs tells their exposure
                shown = shown * (truth.rgb[seen].sum() / max(shown[seen].sum(), 1e-9))
            pictures[name] = shown
        if keep:
            keep(hdri, truth.rgb, pictures["faults"], pictures["none"])
        masks = {"all": seen}
        masks |= {m: seen & (truth.index == i) for m, i in scenes.MATERIALS[scene_name].items()}
        for material, mask in masks.items():
            found = {
                name: metrics.mean_relative_error(p, truth.rgb, mask)
                for name, p in pictures.items()
            }
            rows.append(
                {
                    "scene": scene_name,
                    "rig": case.rig,
                    "patches": case.patches,
                    "sides": case.sides if case.rig == "monitors" else 0,
                    "patterns": case.patterns if case.rig == "monitors" else "lamps",
                    "bits": case.camera.bits,
                    "jpeg": case.jpeg,
                    "exposures": case.exposing.count,
                    "stops": case.exposing.stops,
                    "noise": case.camera.electrons if np.isfinite(case.camera.electrons) else 0,
                    "clean": case.clean,
                    "distance": case.distance,
                    "photographs": count,
                    "world": hdri,
                    "material": material,
                    "error": found["faults"],
                    "error_without_faults": found["none"],
                }
            )
    return rows


def shown_cases() -> list[Case]:
    """The captures that are looked at: monitors on four and five sides, the paper's, a dome."""
    return [
        Case(),
        Case(sides=5),
        Case(patterns="paper"),
        Case(rig="dome", patches=64),
    ]


def sweep() -> list[Case]:
    """One thing at a time is changed of a capture by monitors on four sides."""
    plain = Case()
    still = simulate.Camera(14, np.inf, 0.0, "linear")
    out = [plain]
    out += [replace(plain, patches=n) for n in (1, 2, 8)]
    out += [replace(plain, patterns=n) for n in ("white", "linear", "packed", "paper")]
    out += [replace(plain, sides=n) for n in (5, 6)]
    out += [replace(plain, exposing=Exposing(n, s)) for n, s in ((1, 0), (2, 4), (5, 2))]
    out += [replace(plain, camera=replace(plain.camera, electrons=n)) for n in (1000, 5000, 80000)]
    out += [replace(plain, jpeg=False)]
    out += [
        replace(plain, jpeg=False, camera=replace(plain.camera, bits=b, curve="linear"))
        for b in (12, 14)
    ]
    out += [replace(plain, jpeg=False, camera=still), replace(plain, clean=False)]
    out += [replace(plain, distance=d) for d in (3.0, 10.0)]
    return out


def photographs(
    path: Path,
    scene_names: Sequence[str],
    hdris: Sequence[str],
    size: tuple[int, int],
    samples: int,
    many: int,
    cases: Sequence[Case],
    sheet: Path | None = None,
) -> list[dict[str, Any]]:
    """All rows, written after each case."""
    rows: list[dict[str, Any]] = []
    shown: list[tuple[str, list[NDArray]]] = []
    for scene_name in scene_names:
        for case in cases:

            def keep(hdri: str, *pictures: NDArray, of: Case = case) -> None:
                if hdri == hdris[0]:
                    name = (
                        f"{of.rig} {of.patterns if of.rig == 'monitors' else ''}, {of.sides} sides"
                    )
                    shown.append((name, list(pictures)))

            rows += case_rows(scene_name, case, hdris, size, samples, many, keep)
            write_rows(path, rows)
            last = [r for r in rows[-len(hdris) * 8 :] if r["material"] == "all"]
            print(
                json.dumps({k: last[-1][k] for k in ("rig", "patches", "sides", "patterns")}),
                flush=True,
            )
    if sheet:
        _sheet(sheet, shown)
    return rows


def _sheet(path: Path, shown: list[tuple[str, list[NDArray]]]) -> None:
    """The truth, the relit photographs and the same without faults, a row for each case."""
    from .pictures import display, exposure_for, plt

    figure, axes = plt.subplots(
        len(shown), 3, figsize=(12, 3.2 * len(shown)), layout="constrained", squeeze=False
    )
    for row, (name, pictures) in zip(axes, shown, strict=True):
        exposure = exposure_for(pictures[0])
        for axis, picture, title in zip(
            row, pictures, ("Cycles", f"photographs: {name}", "without faults"), strict=True
        ):
            axis.imshow(display(picture, exposure), interpolation="nearest")
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a line for each case, the mean over worlds; mirror, gloss and diffuse apart."""
    materials = ["all", "mirror", "glossy", "diffuse", "glass", "floor"]
    there = [m for m in materials if any(r["material"] == m for r in rows)]
    keys = (
        "rig",
        "patches",
        "sides",
        "patterns",
        "bits",
        "jpeg",
        "exposures",
        "noise",
        "clean",
        "distance",
    )
    lines = [
        "| rig | patches | sides | patterns | files | exposures | electrons | photographs | "
        + " | ".join(there)
        + " |",
        "|---" * (8 + len(there)) + "|",
    ]
    for key in dict.fromkeys(tuple(r[k] for k in keys) for r in rows):
        mine = [r for r in rows if tuple(r[k] for k in keys) == key]
        r = mine[0]
        files = f"{r['bits']} bits" + (", JPEG" if r["jpeg"] else "")
        more = "" if r["clean"] else ", noise left in"
        more += f", at {r['distance']:g} radii" if r["distance"] else ""
        cells = []
        for m in there:
            some = [x for x in mine if x["material"] == m]
            error, none = (np.mean([x[k] for x in some]) for k in ("error", "error_without_faults"))
            cells.append(f"{error:.3f} ({none:.3f})" if some else "")
        sides = r["sides"] or "all"
        lines.append(
            f"| {r['rig']}{more} | {r['patches']} | {sides} | {r['patterns']} | {files} | "
            f"{r['exposures']} | {r['noise'] or 'no noise'} | {r['photographs']} | "
            + " | ".join(cells)
            + " |"
        )
    return "\n".join(lines)
