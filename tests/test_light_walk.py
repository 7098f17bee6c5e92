"""Light from nothing in the window: from a black world to a lit product, by clicks on the picture.

A picture of each step goes into the folder that ARTO_WALK names (`python -m tools.walk`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from program_tools import Program
from walk_tools import ARRANGE, TAB, Walk
from window_tools import windows

SIZE, SAMPLES = (480, 360), 64
BUILD = f"""
import math
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)


def material(name, **inputs):
    out = bpy.data.materials.new(name)
    if out.node_tree is None:
        out.use_nodes = True
    shader = out.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return out


def put(name, made, look):
    thing = bpy.context.object
    thing.name = name
    thing.data.materials.append(look)
    if name != "Floor":
        bpy.ops.object.shade_smooth()


bpy.ops.mesh.primitive_plane_add(size=14)
put("Floor", 0, material("Floor", Base_Color=(0.2, 0.2, 0.2, 1), Roughness=0.4))
bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, location=(-1.3, 0, 1))
put("Chrome", 0, material("Chrome", Metallic=1.0, Roughness=0.0))
bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, location=(1.3, 0, 1))
put("Matt", 0, material("Matt", Base_Color=(0.7, 0.2, 0.1, 1), Roughness=0.9))
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
scene = bpy.context.scene
scene.collection.objects.link(camera)
camera.location, camera.rotation_euler = (0, -9, 2.4), (math.radians(82), 0, 0)
camera.data.lens = 60
scene.camera = camera
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = {SIZE[0]}, {SIZE[1]}
scene.render.resolution_percentage = 100
scene.render.film_transparent = True
scene.arto.samples, scene.arto.live_finish = {SAMPLES}, False
bpy.data.worlds.remove(scene.world)
"""
LIVE = "next(m for n, m in __import__('sys').modules.items() if n.endswith('.live.live'))"
LIGHTS = (
    "[n.label for n in next(m for n, m in __import__('sys').modules.items() "
    "if n.endswith('.arto_addon.kit.kit')).nodes_of(bpy.context.scene.world)]"
)
# The value of a light's input.
VALUE = (
    "next(m for n, m in __import__('sys').modules.items() if n.endswith('.arto_addon.kit.kit'))"
    ".node_of(bpy.context.scene.world, {light!r}).inputs[{name!r}].default_value"
)


# The chrome ball's middle in the viewport, on the display.
VIEW = (
    "(lambda r, v: [int(r[2].x + v.x), int(r[0].height - r[2].y - v.y)])("
    "region_of('VIEW_3D', 'WINDOW'), "
    "__import__('bpy_extras.view3d_utils', fromlist=['x']).location_3d_to_region_2d("
    "region_of('VIEW_3D', 'WINDOW')[2], "
    "region_of('VIEW_3D', 'WINDOW')[1].spaces.active.region_3d, "
    "bpy.data.objects['Chrome'].location))"
)


@pytest.fixture
def walk(program: Program, tmp_path: Path) -> Iterator[Walk]:
    if not os.environ.get("ARTO_WALK"):
        pytest.skip("ARTO_WALK is not set: this walk is for its pictures (python -m tools.walk)")
    folder = Path(os.environ["ARTO_WALK"]) / "light"
    folder.mkdir(parents=True, exist_ok=True)
    blend = tmp_path / "product.blend"
    script = tmp_path / "make.py"
    script.write_text(
        f"import bpy\n{BUILD}\nbpy.ops.wm.save_as_mainfile(filepath={str(blend)!r})\n"
    )
    done = program.run("-b", "--python-exit-code", "1", "--python", str(script))
    assert blend.is_file(), done.stdout + done.stderr
    with windows(program, tmp_path) as opener:
        yield Walk(opener, blend, folder)


def tool(walk: Walk, what: str) -> None:
    walk.w.do(f"bpy.ops.arto.put_there('INVOKE_DEFAULT', what='{what}')")


def value(walk: Walk, light: str, name: str) -> float:
    return walk.w.get(VALUE.format(light=light, name=name))


def test_light_from_nothing(walk: Walk) -> None:
    w = walk.w
    w.do(ARRANGE)
    w.wait(TAB)
    # a black world, and the capture of the shot
    w.do("bpy.ops.arto.kit_base(kind='BLACK')")
    w.do("bpy.ops.arto.shoot('INVOKE_DEFAULT')")
    level, text = w.idle()
    assert level == "INFO", text
    walk.shot("black")

    # a click on the chrome ball: the softbox is seen there
    tool(walk, "REFLECT")
    chrome = walk.picture(0.305, 0.60)
    w.click(*chrome)
    w.wait(f"{LIGHTS} == ['Reflection']")
    w.wait(f"{LIVE}.current is not None and {LIVE}.current.viewer.made > 0")
    azimuth = value(walk, "Reflection", "Azimuth")
    walk.shot("reflected")
    # drag moves, the wheel sizes, Ctrl changes the strength
    w.point(*chrome)
    w.hold()
    w.point(chrome[0] - 12, chrome[1] - 6)
    w.let_go()
    assert value(walk, "Reflection", "Azimuth") != azimuth
    width = value(walk, "Reflection", "Width")
    w._gesture("click", "4")
    assert value(walk, "Reflection", "Width") > width
    stops = value(walk, "Reflection", "Stops")
    w._gesture("keydown", "ctrl")
    w.point(*chrome)
    w.hold()
    w.point(chrome[0], chrome[1] - 40)
    w.let_go()
    w._gesture("keyup", "ctrl")
    assert value(walk, "Reflection", "Stops") > stops
    w.key("Return")
    walk.shot("sized")

    # ESC puts back; the click is into the camera's view here
    tool(walk, "LIGHT")
    w.click(*w.get(VIEW))
    w.wait(f"{LIGHTS} == ['Reflection', 'Light']")
    w.key("Escape")
    w.wait(f"{LIGHTS} == ['Reflection']")

    # the matt ball is lit, and gets a rim
    for what, at in (("LIGHT", (0.66, 0.60)), ("RIM", (0.755, 0.58))):
        tool(walk, what)
        w.click(*walk.picture(*at))
        w.wait(f"len({LIGHTS}) > {1 if what == 'LIGHT' else 2}")
        w.key("Return")
    assert w.get(LIGHTS) == ["Reflection", "Light", "Rim"]
    w.wait(f"{LIVE}.current.settled")
    walk.shot("lit")

    # undo takes the last light back, and redo brings it
    w.do("bpy.ops.ed.undo()")
    assert w.get(LIGHTS) == ["Reflection", "Light"]
    w.do("bpy.ops.ed.redo()")
    assert w.get(LIGHTS) == ["Reflection", "Light", "Rim"]
    # a flag on the floor
    tool(walk, "SHADE")
    w.click(*walk.picture(0.5, 0.2))
    w.wait(f"{LIGHTS}[-1] == 'Flag'")
    w.key("Return")
    w.wait(f"{LIVE}.current.settled and not {LIVE}.current.trouble")
    walk.shot("shaded")
    w.do("bpy.ops.wm.save_mainfile()")
    again = walk.again()
    again.wait(f"len({LIGHTS}) == 4")
