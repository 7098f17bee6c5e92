"""Live under suns: how often a sun's shadows follow the hand, how long until all is clean, and how
far a picture is off the finished one while the light moves."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import work
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight.relight import compute
from arto.core import exr

from . import worlds
from .building import noded
from .live import DRAG, FOLDER, Hand

# Changes that are waited for one by one, and those of them that are compared with a finished plate.
SINGLE, COMPARED = 4, 2

Turn = Callable[[int], None]


def _sun(scene: bpy.types.Scene) -> Turn:
    """An HDRI of a clear sky with its sun."""
    worlds.World("sky35").apply(scene)
    return lambda i: setattr(scene.world.arto, "rotation", 0.03 * i)


def _disc(scene: bpy.types.Scene) -> Turn:
    """Blender's own sky with its disc, which is another map for each place of the sun."""
    scene.world = noded(bpy.data.worlds.new("disc"))
    tree = scene.world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_disc = math.radians(35), True
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 0.1
    return lambda i: setattr(sky, "sun_rotation", 0.03 * i)


def _large(scene: bpy.types.Scene) -> Turn:
    """An HDRI of 8192 x 4096 texels in a file, whose colour is changed: a map for each change."""
    path = FOLDER / "sky35_8k.exr"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        fine = np.repeat(np.repeat(worlds.sky_map(35.0)[::-1], 8, 0), 8, 1)
        exr.write(path, {"": np.ascontiguousarray(fine, np.float32)})
    scene.world = noded(bpy.data.worlds.new("8k"))
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(path), check_existing=True)
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    world = scene.world
    return lambda i: setattr(world.arto, "tint", (1.0, 0.6 + 0.01 * (i % 40), 0.8))


CASES: dict[str, Callable[[bpy.types.Scene], Turn]] = {
    "sun, turn": _sun,
    "sky with a disc, turn": _disc,
    "8k HDRI with a sun, tint": _large,
}


def _plate(scene: bpy.types.Scene) -> np.ndarray:
    """The finished picture, (H, W, 3)."""
    work.run(compute(scene, scene.view_layers[0].name))
    return np.array(next(iter(exr.read(relit_file(scene)).values()))[..., :3])


def _off(picture: np.ndarray, plate: np.ndarray) -> float:
    """The mean difference, of the plate's mean."""
    return float(np.abs(picture[..., :3] - plate).mean() / plate.mean())


def _measured(scene: bpy.types.Scene, hand: Hand, turn: Turn) -> dict[str, float]:
    """Seconds of single changes, errors beside the finished plate, and updates of a drag."""
    suns = hand.live.asking.suns

    def of_suns() -> int:
        return id(suns.picture)

    first, clean, moving, rested = [], [], [], []
    begun = time.perf_counter()
    hand.rest()
    opened = time.perf_counter() - begun
    hand.clean()
    for i in range(SINGLE):
        before, begun = of_suns(), time.perf_counter()
        turn(9 * i + 5)
        while of_suns() == before:
            hand.tick()
        while not (hand.live.viewer.idle and hand.live.shows_suns):
            hand.tick()
        first.append(time.perf_counter() - begun)
        seen = hand.picture()
        hand.clean()
        clean.append(time.perf_counter() - begun)
        if i < COMPARED:
            plate = _plate(scene)
            moving.append(_off(seen, plate))
            rested.append(_off(hand.picture(), plate))
    hand.longest, pictures, cpu = 0.0, [], 0.0
    begun, i, last = time.perf_counter(), 0, of_suns()
    while time.perf_counter() - begun < DRAG:
        turn(i)
        hand.tick()
        i += 1
        if of_suns() != last and suns.picture is not None:
            last = of_suns()
            pictures.append(suns.picture)
            cpu += suns.picture.cpu
    spent = time.perf_counter() - begun
    return {
        "first_whole": opened,
        "latency": statistics.median(first),
        "clean_after": statistics.median(clean),
        "updates_per_second": len(pictures) / spent,
        "cpu_per_update": cpu / max(len(pictures), 1),
        "pixels_a_side": 1 / statistics.median([p.factor for p in pictures] or [math.inf]),
        "longest_tick": hand.longest,
        "off_while_moving": statistics.mean(moving),
        "off_at_rest": statistics.mean(rested),
        "resident_bytes": float(hand.live.asking.resident.bytes),
    }


def suns_rows(scene: bpy.types.Scene) -> list[dict[str, Any]]:
    """The rows of a shot that was captured."""
    settings, rows = scene.arto, []
    before = settings.lamps, settings.denoise
    settings.lamps = settings.denoise = True
    width, height = scene.render.resolution_x, scene.render.resolution_y
    for name, made in CASES.items():
        turn = made(scene)
        turn(0)
        hand = Hand(scene)
        try:
            found = _measured(scene, hand, turn)
        finally:
            hand.close()
        rows.append({"width": width, "height": height, "change": name, **found})
        print(
            f"{width}x{height} {name}: {found['updates_per_second']:.1f} suns a second "
            f"({found['cpu_per_update']:.2f} s of all threads each), {found['latency']:.2f} s, "
            f"clean after {found['clean_after']:.2f} s, off by {found['off_while_moving']:.1%} "
            f"while moving, {found['off_at_rest']:.1%} at rest, longest tick "
            f"{found['longest_tick']:.3f} s",
            flush=True,
        )
    settings.lamps, settings.denoise = before
    return rows
