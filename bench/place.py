"""Put it there: how near to the click a light shines, in Cycles' render of the same world."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon import shoot, work
from arto.arto_addon.kit import kit as kits
from arto.arto_addon.live import live, placing
from arto.arto_addon.live.image import put_away, view_of
from arto.arto_addon.shot import paths
from arto.core.kit.light import Kind, Light
from arto.core.kit.model import Base, BaseKind, Kit
from arto.core.place.place import Placed, What
from mathutils import Vector
from numpy.typing import NDArray

from . import place_scenes, reference
from .machine import write_rows

FOLDER = Path(__file__).resolve().parent.parent / "out" / "place"
SAMPLES = 64
# Clicks on each thing, in parts of its size to the right and up from its middle, as far as the
# thing shows something from there that no other thing hides.
CLICKS: dict[str, tuple[What, list[tuple[float, float]]]] = {
    "chrome": (What.REFLECT, [(0.0, 0.4), (-0.1, 0.15), (0.25, 0.45)]),
    "mirror": (What.REFLECT, [(0.0, 0.0), (-0.4, 0.1), (0.35, -0.1)]),
    "coat": (What.REFLECT, [(0.0, 0.4), (0.15, 0.55), (-0.15, 0.3)]),
    "brushed": (What.REFLECT, [(0.0, 0.2), (-0.3, 0.0), (0.3, 0.4)]),
    "matt": (What.LIGHT, [(0.0, 0.5), (0.3, 0.3), (0.1, 0.7)]),
}
# Degrees of the light that is looked for in Cycles' picture.
SIZE = 3.0


def shot(width: int, height: int, samples: int) -> bpy.types.Scene:
    """The scene, captured; what is there of an earlier call is used."""
    scene = place_scenes.place_shot(width=width, height=height)
    reference.registered()
    scene.world = bpy.data.worlds.new("Place")
    kits.write(scene.world, Kit((), Base(BaseKind.GRADIENT)))
    scene.render.film_transparent = True
    folder = FOLDER / f"{width}x{height}_{samples}"
    settings = scene.arto
    settings.samples, settings.keep, settings.live_finish = samples, "never", False
    settings.folder, settings.output = str(folder), str(folder / "relit.exr")
    there = folder / "scene_id"
    if there.is_file():
        settings.scene_id = there.read_text()
    layer = scene.view_layers[0].name
    if not (paths.field_folder(scene, layer) / "field.json").is_file():
        work.run(shoot.shoot(scene, layer))
        there.write_text(settings.scene_id)
    return scene


def pixel_of(scene: bpy.types.Scene, name: str, across: float, up: float) -> tuple[int, int]:
    """The pixel, from the left and the top, of a place on a thing."""
    from bpy_extras.object_utils import world_to_camera_view

    thing = scene.objects[name]
    half = thing.dimensions / 2
    at = thing.matrix_world.translation + Vector((across * half.x, 0.0, up * half.z))
    seen = world_to_camera_view(scene, scene.camera, at)
    width, height = scene.render.resolution_x, scene.render.resolution_y
    return int(seen.x * width), int((1 - seen.y) * height)


def truth_at(
    scene: bpy.types.Scene, name: str, view: NDArray, x: int, y: int
) -> tuple[NDArray, NDArray]:
    """The direction that a thing mirrors at a pixel, and its normal there, by geometry."""
    thing = scene.objects[name]
    inverse = thing.matrix_world.inverted()
    ahead = Vector(view[y, x]).normalized()
    start = inverse @ scene.camera.matrix_world.translation
    hit, at, normal, _ = thing.ray_cast(start, (inverse.to_3x3() @ ahead).normalized())
    if not hit:
        raise ValueError(f"{name} is not at {x}, {y}")
    if name in ("chrome", "coat", "matt"):
        normal = at.normalized()
    elif name == "brushed":
        normal = Vector((at.x, at.y, 0)).normalized()
    normal = (thing.matrix_world.to_3x3() @ normal).normalized()
    mirrored = ahead - 2 * ahead.dot(normal) * normal
    return np.array(mirrored), np.array(normal)


def render(scene: bpy.types.Scene, kit: Kit, samples: int) -> tuple[NDArray, NDArray]:
    """Cycles' picture under a kit (H, W, 3), and the index of the thing in each pixel."""
    kits.write(scene.world, kit)
    copy = scene.copy()
    try:
        found = reference.render(copy, samples, 7)
    finally:
        bpy.data.scenes.remove(copy)
    return found.rgb, found.index


def _smooth(image: NDArray, by: int) -> NDArray:
    out = image.astype(np.float64)
    for _ in range(by):
        for axis in (0, 1):
            out = (np.roll(out, 1, axis) + 2 * out + np.roll(out, -1, axis)) / 4
    return out


def off_the_click(
    picture: NDArray, mask: NDArray, level: float, smooth: int, click: tuple[int, int]
) -> float:
    """Pixels from a click to the middle of the brightest place of a thing.

    The image of a light on a brushed cylinder is a line. Along it the light has no place, so the
    distance to the line counts.
    """
    grey = _smooth(picture.mean(axis=-1) * mask, smooth)
    bright = grey >= level * grey.max()
    rows, columns = np.nonzero(bright)
    # the piece around the brightest pixel alone
    top = np.unravel_index(int(grey.argmax()), grey.shape)
    near = np.hypot(rows - top[0], columns - top[1]) < 40
    weight = grey[rows[near], columns[near]]
    places = np.stack([columns[near], rows[near]]).astype(np.float64)
    middle = places @ weight / weight.sum()
    away = places - middle[:, None]
    sizes, axes = np.linalg.eigh((away * weight) @ away.T / weight.sum())
    off = middle - click
    if sizes[1] > 6 * max(sizes[0], 0.5):
        return float(abs(off @ axes[:, 0]))
    return float(np.hypot(*off))


def apart(a: NDArray, b: NDArray) -> float:
    """Degrees between two directions."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


def light_at(placed: Placed, size: float) -> Light:
    """A round light where a placement says."""
    from arto.core.kit.shine import aimed

    azimuth, elevation = aimed(placed.direction)
    return Light("here", Kind.ROUND, azimuth=azimuth, elevation=elevation, width=size, height=size,
                 strength=100.0)  # fmt: skip


def place(
    out: Path,
    size: tuple[int, int] = (480, 360),
    samples: int = SAMPLES,
    picture: Path | None = None,
) -> list[dict[str, Any]]:
    """All rows; written to `out` at the end. picture: of all clicks and what Cycles shows there."""
    scene = shot(*size, samples)
    placer = placing.Placer(scene)
    view = view_of(scene, placer.shape, placer.field.region)
    assert view is not None
    rows: list[dict[str, Any]] = []
    sheet: list[NDArray] = []
    speed = updates(scene, placer)
    for name, (what, clicks) in CLICKS.items():
        for across, up in clicks:
            x, y = pixel_of(scene, name, across, up)
            mirrored, normal = truth_at(scene, name, view, x, y)
            placed = placer.at(x, y, what)
            width = SIZE if what is What.REFLECT else 20.0
            many = 128 if name == "matt" else 32
            shown, index = render(scene, Kit((light_at(placed, width),)), many)
            front = "pane" if name == "mirror" else name  # the mirror stands behind the pane
            mask = index == scene.objects[front].pass_index
            rough = name in ("brushed", "matt")
            level, smooth = (0.8, 3) if rough else (0.5, 1)
            level = 0.985 if name == "matt" else level
            off = off_the_click(shown, mask, level, smooth, (x, y))
            grey = _smooth(shown.mean(axis=-1) * mask, 3)
            aim = mirrored if what is What.REFLECT else normal
            rows.append(
                {
                    **{"scene": name, "what": what.value.lower(), "x": x, "y": y},
                    "pixels_off": off,
                    "degrees_off": apart(placed.direction, aim),
                    # the brightness of the place, of the brightest one of the thing
                    "of_brightest": float(grey[y, x] / grey.max()),
                    **{"by": placed.by, "updates_per_second": speed},
                }
            )
            print(rows[-1], flush=True)
            sheet.append(_marked(shown, x, y))
    rows += _rim_and_shade(scene, placer, speed, sheet)
    placer.close()
    write_rows(out, rows)
    if picture is not None:
        _write(picture, sheet)
    return rows


def _rim_and_shade(
    scene: bpy.types.Scene, placer: placing.Placer, speed: float, sheet: list[NDArray]
) -> list[dict[str, Any]]:
    """A rim light on the matt ball, and a flag between the ball and the light on it."""
    rows = []
    view = view_of(scene, placer.shape, placer.field.region)
    assert view is not None
    x, y = pixel_of(scene, "matt", -0.75, 0.45)
    _, normal = truth_at(scene, "matt", view, x, y)
    placed = placer.at(x, y, What.RIM)
    shown, index = render(scene, Kit((light_at(placed, 20.0),)), 32)
    mask = index == scene.objects["matt"].pass_index
    grey = _smooth(shown.mean(axis=-1) * mask, 2)
    lit = np.argwhere(grey > 0.4 * grey.max())
    off = float(np.hypot(lit[:, 1] - x, lit[:, 0] - y).min())
    about = {"updates_per_second": speed, "x": x, "y": y, "by": placed.by}
    rows.append({"scene": "matt", "what": "rim", "pixels_off": off,
                 "degrees_off": 90 - apart(placed.direction, normal), **about})  # fmt: skip
    sheet.append(_marked(shown, x, y))
    x, y = pixel_of(scene, "matt", 0.1, 0.5)
    sun = Light("key", Kind.ROUND, azimuth=-60.0, elevation=50.0, width=6.0, height=6.0,
                strength=100.0)  # fmt: skip
    key = np.array([np.cos(np.radians(-60)), np.sin(np.radians(-60)), 0]) * np.cos(np.radians(50))
    key[2] = np.sin(np.radians(50))
    before, _ = render(scene, Kit((sun,)), 32)
    other = placing.Placer(scene)
    placed = other.at(x, y, What.SHADE)
    other.close()
    flag = replace(light_at(placed, 12.0), name="flag", kind=Kind.FLAG, strength=0.0)
    flag = replace(flag, blend=type(flag.blend).MULTIPLY)
    shown, index = render(scene, Kit((sun, flag)), 32)
    left = _smooth(shown.mean(axis=-1), 1)[y, x] / _smooth(before.mean(axis=-1), 1)[y, x]
    about = {
        "updates_per_second": speed,
        "x": x,
        "y": y,
        "by": placed.by,
        "light_left": float(left),
    }
    rows.append({"scene": "matt", "what": "shade", "pixels_off": 0.0 if left < 0.1 else 99.0,
                 "degrees_off": apart(placed.direction, key), **about})  # fmt: skip
    sheet.append(_marked(before, x, y))
    for row in rows:
        print(row, flush=True)
    return rows


def updates(scene: bpy.types.Scene, placer: placing.Placer, seconds: float = 5.0) -> float:
    """How many live pictures a second are shown while a light is dragged over the things."""
    kits.write(scene.world, Kit((Light("here", Kind.ROUND, width=14.0, height=14.0),)))
    shown = [0]
    wrapped = live.push

    def push(picture: Any, name: str) -> Any:
        shown[0] += 1
        return wrapped(picture, name)

    live.push = push
    hand = live.Live(scene)
    try:
        until = time.perf_counter() + 60
        while not shown[0]:
            _tick(hand)
            if time.perf_counter() > until:
                raise RuntimeError(f"live shows nothing: {hand.trouble or hand.line}")
        path = [(what, pixel_of(scene, name, *clicks[0])) for name, (what, clicks)
                in CLICKS.items()]  # fmt: skip
        begun, count, i = time.perf_counter(), shown[0], 0
        while time.perf_counter() - begun < seconds:
            what, (x, y) = path[(i // 20) % len(path)]
            placing.put_there(scene, "here", placer.at(x + i % 20 - 10, y, what))
            _tick(hand)
            i += 1
        return (shown[0] - count) / (time.perf_counter() - begun)
    finally:
        live.push = wrapped
        hand.close()
        put_away(hand.name)


def _tick(hand: live.Live) -> None:
    begun = time.perf_counter()
    hand.dirty = True
    hand.tick()
    time.sleep(max(0.0, live.EVERY - (time.perf_counter() - begun)))


def _marked(picture: NDArray, x: int, y: int) -> NDArray:
    """A picture for the eye, with a ring around the click."""
    out = np.clip(picture / max(float(np.percentile(picture.max(axis=-1), 99.7)), 1e-6), 0, 1)
    out = out ** (1 / 2.2)
    rows, columns = np.indices(out.shape[:2])
    ring = np.abs(np.hypot(rows - y, columns - x) - 12) < 0.8
    out[ring] = (0.1, 1.0, 0.2)
    return out


def _write(path: Path, sheet: list[NDArray], columns: int = 3) -> None:
    from arto.arto_addon.blender.pictures import put

    while len(sheet) % columns:
        sheet.append(np.zeros_like(sheet[0]))
    lines = [np.concatenate(sheet[i : i + columns], 1) for i in range(0, len(sheet), columns)]
    whole = np.concatenate(lines)
    image = put("ARTO Sheet", np.concatenate([whole, np.ones((*whole.shape[:2], 1))], -1), True)
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    lines = ["| scene | what | pixels off | degrees off | by | updates a second |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    for r in rows:
        lines.append(
            f"| {r['scene']} | {r['what']} | {r['pixels_off']:.1f} | {r['degrees_off']:.1f} "
            f"| {r['by']} | {r['updates_per_second']:.1f} |"
        )
    return "\n".join(lines)
