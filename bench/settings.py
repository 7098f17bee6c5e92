"""The sweep: every setting of a scene set to its other values, one at a time, against Cycles.

It goes over what Blender has and not over a list, so that a new version's settings are swept too.
The scene is small, its world one colour in a map, under which a field is exact: what differs by
more than noise comes from the setting.
"""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.blender.colour import working_space
from arto.arto_addon.blender.nodes import new_world
from arto.arto_addon.blender.output import float_exr, write_to
from arto.arto_addon.capture import capture
from arto.arto_addon.fit import fit
from arto.arto_addon.relight import relight
from arto.core import exr
from arto.core.capture.agreement import agreement
from arto.core.errors import ArtoError

from . import reference

SIZE = (36, 27)
SAMPLES = 48
# Times as many samples for what is looked at again.
FINE = 8
RADIANCE = 0.8
# What a region of the picture, and the whole of it, may be off by beyond the noise. Under a world
# of one colour a field is exact, so a setting that takes a few hundredths of the light is seen.
DIFFERENT, BIAS = 0.04, 0.01
# Settings whose other values only say where or how the artist's own picture is kept, shown or
# computed, each with the reason; they are swept all the same, and must be right.
ON_PURPOSE: dict[tuple[str, str], str] = {
    ("cycles", "sample_clamp_direct"): "light is captured without clamping, which is not linear",
    ("cycles", "sample_clamp_indirect"): "light is captured without clamping, which is not linear",
    ("cycles", "use_fast_gi"): "Fast GI replaces bounces by the world's own light: not captured",
    ("cycles", "fast_gi_method"): "Fast GI is not captured",
    ("cycles", "ao_bounces_render"): "Fast GI is not captured",
    **{
        ("world.cycles_visibility", rays): (
            "a world that is hidden from one kind of rays lights them all the same: it is said"
        )
        for rays in ("diffuse", "glossy", "transmission", "scatter")
    },
}
# Not touched: what makes the scene another one, or needs what a small scene has not.
_NOT = {
    ("render", "resolution_x"), ("render", "resolution_y"), ("render", "engine"),
    ("render", "filepath"), ("camera", "lens"), ("camera", "clip_end"), ("camera", "clip_start"),
    ("cycles", "samples"), ("render", "resolution_percentage"),
}  # fmt: skip


def make() -> bpy.types.Scene:
    """The scene of the sweep: diffuse and glossy things, a lamp, motion, a world of one colour."""
    scene = reference.new_scene("four_spheres", *SIZE)
    scene.render.film_transparent = False
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "SUN"))
    lamp.data.energy, lamp.data.angle = 1.0, 0.2
    lamp.rotation_euler = (0.7, 0.2, 0)
    scene.collection.objects.link(lamp)
    image = bpy.data.images.new("one colour", 8, 4, float_buffer=True)
    image.colorspace_settings.name = working_space()
    image.pixels.foreach_set(np.tile([RADIANCE, RADIANCE, RADIANCE, 1], 32).astype(np.float32))
    image.pack()
    world = scene.world or new_world("World")
    scene.world = world
    nodes = world.node_tree.nodes
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    background = next(n for n in nodes if n.bl_idname == "ShaderNodeBackground")
    world.node_tree.links.new(texture.outputs[0], background.inputs["Color"])
    scene.cycles.samples = SAMPLES
    s = scene.arto
    s.samples, s.patches, s.adaptive, s.denoise, s.lamps = 96, 1, False, False, False
    s.environment_width = 64
    return scene


def owners(scene: bpy.types.Scene) -> dict[str, Any]:
    """What is swept, by name."""
    layer = scene.view_layers[0]
    thing = next(o for o in scene.objects if o.type == "MESH" and o.name == "diffuse")
    return {
        "render": scene.render,
        "cycles": scene.cycles,
        "cycles_curves": scene.cycles_curves,
        "image_settings": scene.render.image_settings,
        "view_layer": layer,
        "view_layer.cycles": layer.cycles,
        "camera": scene.camera.data,
        "camera.dof": scene.camera.data.dof,
        "world.cycles": scene.world.cycles,
        "world.cycles_visibility": scene.world.cycles_visibility,
        "object": thing,
        "object.cycles": thing.cycles,
        "view_settings": scene.view_settings,
        "display_settings": scene.display_settings,
    }


def other_values(owner: Any, prop: Any) -> list[Any]:
    """Values to try that a property does not have now."""
    name = prop.identifier
    if prop.is_readonly or name in {"rna_type", "name"} or name.startswith("bl_"):
        return []
    try:
        now = getattr(owner, name)
    except AttributeError:
        return []
    if prop.type == "BOOLEAN" and not prop.is_array:
        return [not now]
    if prop.type == "ENUM" and not prop.is_enum_flag:
        return [i.identifier for i in prop.enum_items if i.identifier != now][:6]
    if prop.type in {"INT", "FLOAT"} and not prop.is_array:
        low, high = prop.soft_min, prop.soft_max
        tries = {now * 2, now / 2, now + 1, low, min(high, now + 2)}
        kind = int if prop.type == "INT" else float
        good = {kind(t) for t in tries if math.isfinite(t) and low <= t <= min(high, 1e4)}
        good.discard(now)
        # the nearest and the lowest: enough to see whether it is minded
        return sorted(good, key=lambda t: abs(t - now))[:1] + sorted(good)[:1]
    return []


def swept(scene: bpy.types.Scene) -> list[tuple[str, str, Any]]:
    """(owner, property, value) of every try."""
    out = []
    for owner_name, owner in owners(scene).items():
        only = owner_name == "object"
        for prop in owner.bl_rna.properties:
            name = prop.identifier
            if (owner_name, name) in _NOT or name.startswith("show_"):
                continue
            if only and not name.startswith(("visible_", "is_", "hide_render", "use_")):
                continue
            out += [(owner_name, name, v) for v in dict.fromkeys(other_values(owner, prop))]
    return out


def _cycles(scene: bpy.types.Scene, seed: int, folder: Path) -> np.ndarray:
    """What F12 renders, (H, W, 4), with only its file and its seed chosen here."""
    copy = scene.copy()
    try:
        copy.cycles.seed = seed
        float_exr(copy.render, multilayer=False)
        copy.render.use_compositing = False
        write_to(copy.render, folder / "cycles.exr")
        for layer in list(copy.view_layers)[1:]:
            copy.view_layers.remove(layer)
        # without any layer to render Blender as a module crashes
        copy.view_layers[0].use = True
        request = work.Render(copy.name, 0, "")
        work.blocking_render(request)
        request.check()
        return next(iter(exr.read(folder / "cycles.exr").values()))
    finally:
        bpy.data.scenes.remove(copy)


def one(scene: bpy.types.Scene, folder: Path) -> dict[str, Any]:
    """Capture, fit and relight the scene as it stands, and hold it against Cycles."""
    scene.arto.folder, scene.arto.output = str(folder / "arto"), str(folder / "relit.exr")
    layer = scene.view_layers[0].name
    try:
        work.run(capture.capture(scene, layer))
        work.run(fit.fit(scene, layer))
        path, _ = work.run(relight.relight(scene, layer))
    except ArtoError as e:
        return {"status": "refused", "text": str(e).splitlines()[0]}
    found = next(iter(exr.read(path).values()))
    expected = np.stack([_cycles(scene, seed, folder) for seed in (11, 12)])
    if expected.shape[1:3] != found.shape[:2]:
        shapes = (
            f"{found.shape[1]}x{found.shape[0]}, Cycles {expected.shape[2]}x{expected.shape[1]}"
        )
        return {"status": "wrong", "text": f"its size is {shapes}"}
    seen = agreement(found[..., :3], expected[..., :3], different=DIFFERENT)
    alpha = float(np.abs(found[..., 3] - expected[..., 3].mean(axis=0)).mean())
    dark = max(float(found[..., :3].max()), float(expected[..., :3].max())) == 0
    # what two renders of Cycles' own differ by says nothing
    noise = 2 * abs(float(expected[0].mean() / max(expected[1].mean(), 1e-9)) - 1)
    right = seen.agrees and alpha < 0.03 and (dark or abs(seen.ratio - 1) < BIAS + noise)
    return {
        "status": "right" if right else "wrong",
        "text": ""
        if right
        else f"ratio {seen.ratio:.3f}, differs in {seen.share:.0%}, alpha {alpha:.3f}",
    }


def settings(part: float = 1.0, seed: int = 0, wanted: list[str] | None = None) -> Iterator[dict]:
    """Rows `owner, setting, value, status, text`, one by one.

    part: a random share of all tries; wanted: only owners of these names.
    """
    tries = swept(make())
    if wanted:
        tries = [t for t in tries if t[0] in wanted or f"{t[0]}.{t[1]}" in wanted]
    if part < 1:
        rng = np.random.default_rng(seed)
        some = rng.permutation(len(tries))[: max(1, round(len(tries) * part))]
        tries = [tries[i] for i in sorted(some)]
    for owner, name, value in tries:
        begun = time.perf_counter()
        scene = make()
        row: dict[str, Any] = {"owner": owner, "setting": name, "value": value}
        try:
            setattr(owners(scene)[owner], name, value)
        except (TypeError, ValueError, AttributeError, RuntimeError):
            continue  # not to be had in this Blender, or in this state
        if getattr(owners(scene)[owner], name) != value and not isinstance(value, float):
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                row |= one(scene, Path(folder))
                if row["status"] == "wrong" and (owner, name) not in ON_PURPOSE:
                    # more samples tell noise from a fault
                    scene.cycles.samples *= FINE
                    scene.arto.samples *= FINE
                    row |= one(scene, Path(folder))
            except Exception as e:  # a traceback is what the sweep is there to find
                row |= {"status": "wrong", "text": f"{type(e).__name__}: {e}"[:200]}
        if row["status"] == "wrong" and (owner, name) in ON_PURPOSE:
            row |= {"status": "differs on purpose", "text": ON_PURPOSE[owner, name]}
        row["seconds"] = round(time.perf_counter() - begun, 2)
        yield row


def table(rows: list[dict[str, Any]]) -> str:
    """How many rows there are of each status, and all that are not simply right, in Markdown."""
    count: dict[str, int] = {}
    for row in rows:
        count[row["status"]] = count.get(row["status"], 0) + 1
    lines = [", ".join(f"{n} {status}" for status, n in sorted(count.items())), ""]
    lines += ["| owner | setting | value | status | |", "|---|---|---|---|---|"]
    for r in rows:
        if r["status"] != "right":
            lines.append(
                f"| {r['owner']} | {r['setting']} | {r['value']} | {r['status']} | {r['text']} |"
            )
    return "\n".join(lines)


def page(rows: list[dict[str, Any]]) -> str:
    """docs/settings.md, of the rows of a whole sweep."""
    owners: dict[str, list[int]] = {}
    for row in rows:
        tried = owners.setdefault(row["owner"], [0, 0])
        tried[0] += 1
        tried[1] += row["status"] == "right"
    return "\n".join(
        [
            "# Every setting, against Cycles",
            "",
            "Each property of a scene that decides a picture was set to its other values, one",
            "at a time. Under each value the scene was captured, fitted and relit, and the",
            "picture was compared with Cycles' own under that value, with two seeds. (`python",
            "-m bench settings --json FILE --page docs/settings.md`; a random part of it is a",
            "test.)",
            "",
            f"Blender {bpy.app.version_string}, {len(rows)} tries: {table(rows)}",
            "",
            "| owner | tried | right |",
            "|---|---|---|",
            *(f"| {name} | {all_} | {right} |" for name, (all_, right) in owners.items()),
            "",
            "## What differs on purpose",
            "",
            "| owner | setting | why |",
            "|---|---|---|",
            *(f"| {o} | {s} | {why} |" for (o, s), why in sorted(ON_PURPOSE.items())),
            "",
        ]
    )


def run(out: Path | None, part: float, seed: int, wanted: list[str] | None) -> list[dict[str, Any]]:
    """Sweep, printing each row that is not right as it is found; write them all to `out`."""
    from .machine import write_rows

    rows = []
    for row in settings(part, seed, wanted):
        rows.append(row)
        if row["status"] != "right":
            print(json.dumps(row, default=str), flush=True)
        if out:
            write_rows(out, [{**r, "value": str(r["value"])} for r in rows])
    return rows
