"""Live: updates a second and latency while an artist's hand is on the light, without a window.

The shot is the product, captured once a size and kept. What drives it is what drives the window:
`live.Live`, thirty ticks a second; here they change the world, too.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import shoot, work
from arto.arto_addon.live import live
from arto.arto_addon.live.image import IMAGE, put_away
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.resident import resident
from arto.core import exr

from . import scenes, worlds
from .machine import write_rows
from .reference import registered

SIZES = ((480, 270), (960, 540), (1920, 1080))
# Seconds that each change is dragged for, and changes that are waited for one by one.
DRAG, SINGLE = 5.0, 5
FOLDER = Path(__file__).resolve().parent.parent / "out" / "live"


def shot(width: int, height: int, samples: int) -> bpy.types.Scene:
    """The product shot, captured."""
    scene = scenes.product_shot(width=width, height=height)
    registered()
    worlds.set_world_hdri(scene, "sunset")
    # what is looked at is the light on the things: behind them is what a camera sees of the world
    scene.render.film_transparent = True
    folder = FOLDER / f"{width}x{height}_{samples}"
    settings = scene.arto
    settings.samples, settings.live_finish = samples, False
    settings.folder, settings.output = str(folder), str(folder / "relit.exr")
    settings.denoise = settings.lamps = False
    layer = scene.view_layers[0].name
    work.run(shoot.shoot(scene, layer))
    return scene


def _changes(scene: bpy.types.Scene) -> dict[str, Callable[[int], None]]:
    """By name: what makes the i-th change."""
    world = scene.world
    images = [
        bpy.data.images.load(str(p), check_existing=True)
        for p in sorted(worlds._hdri_folder().glob("*.exr"))
    ]
    texture = next(n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeTexEnvironment")

    def turn(i: int) -> None:
        world.arto.rotation = 0.02 * i

    def strength(i: int) -> None:
        world.arto.strength = 1 + 0.01 * (i % 50)

    def node(i: int) -> None:
        world.arto.tint = (1.0, 0.5 + 0.005 * (i % 100), 0.6)

    def another(i: int) -> None:
        texture.image = images[i % len(images)]

    return {"turn": turn, "strength": strength, "node": node, "another HDRI": another}


class Hand:
    """Ticks as the window's timer does, and counts the pictures that were shown."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.live = live.Live(scene)
        self.shown: list[tuple[float, int]] = []
        self.longest = 0.0
        wrapped = live.push

        def push(picture: Any, name: str) -> Any:
            out = wrapped(picture, name)
            self.shown.append((time.perf_counter(), 0))
            return out

        self._wrapped, live.push = wrapped, push

    def tick(self) -> None:
        begun = time.perf_counter()
        self.live.dirty = True
        self.live.tick()
        spent = time.perf_counter() - begun
        self.longest = max(self.longest, spent)
        time.sleep(max(0.0, live.EVERY - spent))

    def clean(self) -> None:
        """Until the picture is whole and denoised."""
        self.rest()
        until = time.perf_counter() + 120
        while not self.live.is_clean:
            self.tick()
            if self.live.trouble or time.perf_counter() > until:
                raise RuntimeError(self.live.trouble or f"not denoised: {self.live.line}")

    def picture(self) -> np.ndarray:
        """What is shown, (H, W, 4), rows top-down."""
        image = bpy.data.images[IMAGE]
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(image.size[1], image.size[0], 4)[::-1]

    def rest(self) -> None:
        """Until the whole picture is shown."""
        until = time.perf_counter() + 120
        while True:
            self.tick()
            if self.live.trouble:
                raise RuntimeError(self.live.trouble)
            if self.live.settled:
                return
            if time.perf_counter() > until:
                raise RuntimeError(f"live came to no rest: {self.live.line}")

    def close(self) -> None:
        live.push = self._wrapped
        self.live.close()
        put_away(self.live.name)
        resident.end(wait=True)


def _measured(hand: Hand, change: Callable[[int], None]) -> dict[str, float]:
    """Updates a second of a drag, seconds from a single change to its picture, and to the whole
    one."""
    first, whole = [], []
    for i in range(SINGLE):
        hand.rest()
        count = len(hand.shown)
        begun = time.perf_counter()
        change(7 * i + 3)
        hand.tick()
        while len(hand.shown) == count:
            hand.tick()
        first.append(hand.shown[count][0] - begun)
        hand.rest()
        whole.append(time.perf_counter() - begun)
    hand.rest()
    hand.longest = 0.0
    begun, count, i = time.perf_counter(), len(hand.shown), 0
    while time.perf_counter() - begun < DRAG:
        change(i)
        hand.tick()
        i += 1
    spent = time.perf_counter() - begun
    updates = (len(hand.shown) - count) / spent
    return {
        "updates_per_second": updates,
        "latency": statistics.median(first),
        "whole_after": statistics.median(whole),
        "longest_tick": hand.longest,
    }


def difference(scene: bpy.types.Scene) -> float:
    """How far the whole picture that is shown live is off the plate that a relight writes, not
    denoised: the largest difference, of the plate's mean."""
    from arto.arto_addon.relight.relight import compute

    work.run(compute(scene, scene.view_layers[0].name))
    plate = next(iter(exr.read(relit_file(scene)).values()))
    hand = Hand(scene)
    try:
        hand.rest()
        seen = hand.picture()
    finally:
        hand.close()
    # the plate's file has half floats
    seen = seen.astype(np.float16).astype(np.float32)
    off = np.abs(seen[..., :3] - plate[..., :3]).max()
    return float(off / plate[..., :3].mean())


def live_bench(sizes: list[str] | None, samples: int, out: Path) -> None:
    """Write the rows, and print them."""
    rows: list[dict[str, Any]] = []
    wanted = [tuple(map(int, s.split("x"))) for s in sizes] if sizes else list(SIZES)
    from .live_suns import suns_rows

    for width, height in wanted:
        # a capture of full HD is of fewer samples: how long a picture takes hangs little on them
        scene = shot(width, height, samples if width < 1900 else max(4, samples // 4))
        off = difference(scene)
        hand = Hand(scene)
        try:
            hand.rest()
            for name, change in _changes(scene).items():
                found = _measured(hand, change)
                rows.append({"width": width, "height": height, "change": name, **found})
                rows[-1]["off_plate"] = off
                print(
                    f"{width}x{height} {name}: {found['updates_per_second']:.1f} a second, "
                    f"{found['latency']:.3f} s, whole after {found['whole_after']:.2f} s, longest "
                    f"tick {found['longest_tick']:.3f} s",
                    flush=True,
                )
        finally:
            hand.close()
        rows += suns_rows(scene)
        print(f"{width}x{height}: off the plate by {off:.1e} of its mean at most", flush=True)
    write_rows(out, rows)
