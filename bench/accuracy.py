"""Error against time: ARTO, its baselines and re-rendering, on every scene under every world.

What is measured once a scene, seconds, is in `seconds`. Rows are written after each world, and a
run that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import arto
import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender import denoise
from arto.arto_addon.fit import fit
from arto.arto_addon.fit.guides import guides_of
from arto.arto_addon.relight import relight
from arto.arto_addon.shot import paths
from arto.arto_addon.world.bake import bake
from arto.core import exr, metrics
from arto.core.field.field import Field
from arto.core.files import whole, write_text
from arto.core.fit import matte
from arto.core.fit.choice import CHOICES
from arto.core.light import lamps
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.relight import relight as relight_field
from numpy.typing import NDArray

from . import reference, scenes, worlds
from .machine import write_rows
from .models import MATTE, STAGE, captured, fitted
from .seconds import (
    ARTO,
    NO_LAMPS,
    RAW,
    RENDER,
    RENDER_DENOISED,
    STAGE_DENOISED,
    Times,
    price,
    times,
)
from .worlds import World

SAMPLES = (8, 32, 128)  # of the renders that ARTO is held against
SEED = 3  # theirs; references have 1 and 2
RENDERS = reference.CACHE.with_name("renders")


def code_key() -> str:
    """A name for the state of everything that decides ARTO's pictures."""
    files = sorted(
        p for d in ("core", "arto_addon") for p in Path(arto.__file__).parent.glob(f"{d}/**/*.py")
    )
    return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()[:16]


def rerendered(scene_name: str, world: World, size: tuple[int, int], samples: int) -> NDArray:
    """A plain render and the same denoised -> (2, H, W, 3), kept by content."""
    key = reference.content_key(
        scene=scene_name, world=world.label, size=size, samples=samples, seed=SEED, both=True
    )
    path = RENDERS / f"{scene_name}_{world.label}_{samples}_{key}.npy"
    if path.is_file():
        return np.load(path)
    scene = reference.new_scene(scene_name, *size)
    world.apply(scene)
    scene.view_layers[0].cycles.denoising_store_passes = True
    parts, _ = reference.render_passes(scene, samples, SEED, denoise=True)
    both = np.stack([parts["Noisy Image"][..., :3], parts["Combined"][..., :3]])
    with whole(path) as partial, partial.open("wb") as file:
        np.save(file, both)
    return both


class Shot:
    """One scene, captured and fitted; lamp_samples: None for the add-on's default."""

    def __init__(
        self,
        scene_name: str,
        size: tuple[int, int],
        samples: int,
        lamp_samples: int | None = None,
    ) -> None:
        self.name, self.size, self.samples = scene_name, size, samples
        self.lamp_samples = lamp_samples
        there = captured(scene_name, size, samples)
        # the root of its shots' folders, and the scene that they are of
        self.folder = there.folder.parents[3].resolve()
        shot = there.head.shot
        self.scene_id = (shot.scene_id if shot else None) or ""
        scene = self.scene()
        work.run(fit.fit(scene))
        self.fields = {ARTO: Field(paths.field_folder(scene))}
        self.guides = guides_of(self.fields[ARTO])

    def fit_baselines(self, choices: Iterable[str]) -> None:
        """Fit every other method's field, of captures of the same samples."""
        options = {"patterns": "moments_uv", "grain": True, "adaptive": False}
        rich = captured(self.name, self.size, self.samples, **options)
        for choice in choices:
            self.fields[choice] = fitted(rich, choice)
        options = {"patterns": "white", "patches": 16, "adaptive": False}
        fine = captured(self.name, self.size, self.samples, **options)
        self.fields[STAGE] = fitted(fine, "whole")
        data = rich.read(0)
        basis = data.basis.reshape(*data.basis.shape[:2], -1, 3)
        self.caps = matte.fit(basis, rich.patterns, rich.hemicube)

    def scene(self) -> bpy.types.Scene:
        """The scene anew, with the folder of its capture."""
        scene = reference.new_scene(self.name, *self.size)
        scene.arto.samples, scene.arto.folder = self.samples, str(self.folder)
        scene.arto.scene_id = self.scene_id
        if self.lamp_samples is not None:
            scene.arto.lamp_samples = self.lamp_samples
        return scene

    def arto(self, world: World, **settings: Any) -> NDArray[np.float32]:
        """What the add-on's relight operator writes."""
        scene = self.scene()
        world.apply(scene)
        scene.render.film_transparent = True
        with tempfile.TemporaryDirectory() as folder:
            for name, value in {"output": str(Path(folder) / "relit.exr"), **settings}.items():
                setattr(scene.arto, name, value)
            path, _ = work.run(relight.relight(scene))
            return exr.read(path)[""][..., :3]

    def pictures(self, world: World, environment: Environment) -> dict[str, NDArray]:
        """Every method's picture under a world."""
        out: dict[str, NDArray] = {ARTO: self.arto(world), RAW: self.arto(world, denoise=False)}
        lights: dict[Any, PatchLight] = {}
        for name, field in self.fields.items():
            cube = field.hemicube
            if cube not in lights:
                lights[cube] = PatchLight(environment, cube)
            picture = relight_field(field, lights[cube])[..., :3]
            if name == ARTO:
                out[NO_LAMPS] = denoise.denoise(self.guides, picture, clean=True)
            else:
                out[name] = picture
            if name == STAGE:
                out[STAGE_DENOISED] = denoise.denoise(self.guides, picture, clean=True)
            if name == "auto":
                caps = matte.relight(self.caps, lights[cube])
                out[MATTE] = caps.reshape(*self.size[::-1], 3)
        return {name: np.maximum(p, 0) for name, p in out.items()}

    def bytes_of(self, method: str) -> float:
        base = method.split(",")[0].removesuffix(" denoised")
        if base == MATTE:
            return float(matte.BYTES_PER_PIXEL)
        return self.fields[base].bytes_per_pixel() if base in self.fields else 0.0


def shadow_edges(truth: NDArray, guides: dict[str, NDArray], seen: NDArray) -> NDArray[np.bool_]:
    """Pixels where the light changes and nothing else does: edges of shadows, caustics and mirror
    images. (H, W), from a reference (denoised here, so that its noise is no edge)."""
    clean = np.maximum(denoise.denoise(guides, truth.astype(np.float32)), 0)
    albedo, normal = guides["albedo"], guides["normal"]
    light = (clean / np.maximum(albedo, 0.05)).sum(axis=-1)
    light = np.log(light + 0.02 * light[seen].mean())
    found = np.zeros(seen.shape, bool)
    for axis in (0, 1):
        step = np.abs(np.diff(light, axis=axis)) > 0.2
        same = np.abs(np.diff(albedo, axis=axis)).max(axis=-1) < 0.05
        same &= np.linalg.norm(np.diff(normal, axis=axis), axis=-1) < 0.2
        edge = step & same
        first = [slice(None)] * 2
        first[axis] = slice(0, -1)
        second = [slice(None)] * 2
        second[axis] = slice(1, None)
        found[tuple(first)] |= edge
        found[tuple(second)] |= edge
    return found & seen


def flip(picture: NDArray, truth: NDArray) -> float:
    """HDR-FLIP's mean, 0 to 1."""
    import flip_evaluator

    return float(flip_evaluator.evaluate(truth, picture, "HDR", computeMeanError=True)[1])


def world_rows(
    shot: Shot, world: World, environment: Environment, many: int
) -> list[dict[str, Any]]:
    """The rows of one scene under one world, without seconds."""
    made = shot.scene
    one, two = (
        reference.reference(shot.name, world, shot.size, many, seed, made) for seed in (1, 2)
    )
    truth, seen = (one.rgb + two.rgb) / 2, one.alpha > 0.999
    edges = shadow_edges(truth, shot.guides, seen)
    groups = {m: seen & (one.index == i) for m, i in scenes.MATERIALS[shot.name].items()}
    split = lamps.split(environment)
    lamp_samples = 0
    if split.worth:
        lamp_samples = relight.lamp_samples(shot.scene(), split.share, shot.samples)
    found = [(n, shot.samples, p) for n, p in shot.pictures(world, environment).items()]
    for samples in SAMPLES:
        raw, clean = rerendered(shot.name, world, shot.size, samples)
        found += [(RENDER, samples, raw), (RENDER_DENOISED, samples, clean)]
    rows = []
    for method, samples, picture in found:
        is_render = method in (RENDER, RENDER_DENOISED)
        error = metrics.relative_error(picture, truth, seen).mean(axis=-1)
        both = metrics.relative_squares(picture, one.rgb, two.rgb, seen).mean(axis=-1)
        behind = np.where(seen[..., None], picture, truth).astype(np.float32)
        rows.append(
            {
                "scene": shot.name,
                "hdri": world.label,
                "method": method,
                "samples": samples,
                "mean_relative_error": float(error.mean()),
                "noise_floor": metrics.mean_relative_error(one.rgb, two.rgb, seen),
                "p95": float(np.percentile(error, 95)),
                "p99": float(np.percentile(error, 99)),
                "relmse": float(both.mean()),
                "relmse_trimmed": metrics.trimmed_mean(both),
                "flip": flip(behind, truth.astype(np.float32)),
                "by_material": {
                    m: metrics.mean_relative_error(picture, truth, here)
                    for m, here in groups.items()
                },
                "shadow_edge": metrics.mean_relative_error(picture, truth, edges)
                if edges.any()
                else None,
                "lamp_share": split.share,
                "lamp_samples": lamp_samples if method in (ARTO, RAW) else 0,
                "bytes_per_pixel": 0.0 if is_render else shot.bytes_of(method),
            }
        )
    return rows


def accuracy(
    out: Path,
    scene_names: Iterable[str],
    world_list: Iterable[World],
    size: tuple[int, int],
    time_size: tuple[int, int],
    samples: int,
    many: int,
    lamp_samples: int | None = None,
    choices: Sequence[str] = CHOICES,
) -> list[dict[str, Any]]:
    """All rows; those that `out` holds of the same code and options are kept."""
    setup = {"size": size, "time": time_size, "samples": samples, "many": many, "code": code_key()}
    setup |= {"lamp_samples": lamp_samples, "choices": choices}
    setup["scripts"] = [reference.content_key(scene=name) for name in scenes.SCENES]
    state = out.with_suffix(".state.json")
    text = json.dumps(setup)
    there = json.loads(state.read_text()) if state.is_file() else {}
    if there.get("setup") != text:
        there = {"setup": text, "rows": [], "times": {}}
    rows: list[dict[str, Any]] = there["rows"]
    done = {(r["scene"], r["hdri"]) for r in rows}
    maps: dict[World, Environment] = {}
    world_list = list(world_list)

    def keep() -> None:
        measured = {name: Times.from_json(t) for name, t in there["times"].items()}
        price([r for r in rows if r["scene"] in measured], measured, samples)
        write_text(state, json.dumps(there))
        write_rows(out, rows)

    scene_names = list(scene_names)
    for scene_name in scene_names:  # first, while nothing is in memory
        if scene_name not in there["times"]:
            there["times"][scene_name] = asdict(times(scene_name, time_size, samples))
            keep()
            print(f"{scene_name}: {there['times'][scene_name]}", flush=True)
    for scene_name in scene_names:
        missing = [w for w in world_list if (scene_name, w.label) not in done]
        if not missing:
            continue
        shot = Shot(scene_name, size, samples, lamp_samples)
        shot.fit_baselines(choices)
        for world in missing:
            if world not in maps:
                scene = shot.scene()
                world.apply(scene)
                maps[world] = bake(scene, scene.arto.environment_width)
            rows += world_rows(shot, world, maps[world], many)
            keep()
            print(f"{scene_name} {world.label} done", flush=True)
    return rows


def all_worlds(
    names: Iterable[str] | None = None, turns: Iterable[float] = (0.0, 45.0)
) -> list[World]:
    """Every world, first as it is, then turned."""
    return [World(n, t) for t in turns for n in (names or worlds.world_names())]
