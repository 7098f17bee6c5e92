"""Picture of a shot with a shadow catcher and layers, mixed in the compositor:
`python -m tools.screenshot docs/mixer.png`. (Those of an artist's hour are of `tools.walk`.)

Builds the extension, installs it into a Blender of no person's own, captures and relights the shot
at few samples, and shows its panel, the relit picture and the compositor. Needs Linux, xvfb-run,
xdotool, and BLENDER, the command line of the Blender executable.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from . import package

SCREEN = (1600, 900)

# Blender's own screenshot is black on some displays: so the display itself is photographed.
PHOTOGRAPH = """
xdotool mousemove 5 895
(until [ -e "$SHOT.ready" ]; do sleep 0.2; done; import -window root "$SHOT"; rm "$SHOT.ready") &
"$@"
code=$?
kill $! 2>/dev/null
exit $code
"""

PLATE = """
import sys
sys.path.insert(0, sys.argv[-2])
import bpy
from bench import scenes, worlds

scene = scenes.four_spheres(width=400, height=300)
scene.objects["floor"].is_shadow_catcher = scene.render.film_transparent = True
worlds.set_world_hdri(scene, "sunset")
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.arto")
settings = scene.arto
settings.samples, settings.layers = 64, "GROUPS"
for name, azimuth, elevation in (("key", 0.4, 0.5), ("fill", 2.6, 0.3)):
    bpy.ops.arto.add_group()
    group = settings.groups[-1]
    group.name, group.azimuth, group.elevation = name, azimuth, elevation
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
bpy.ops.arto.capture()
bpy.ops.arto.relight()
bpy.ops.wm.save_mainfile()
"""

# The relit picture, the compositor, and the render properties, scrolled to their end.
SHOW = """
import os
import sys
import bpy


def override(window, area):
    region = next(r for r in area.regions if r.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def arrange(window):
    screen = window.screen
    for kind in ("OUTLINER", "DOPESHEET_EDITOR"):
        for area in [a for a in screen.areas if a.type == kind]:
            with override(window, area):
                bpy.ops.screen.area_close()
    # so wide that no label is cut off
    properties = next(a for a in screen.areas if a.type == "PROPERTIES")
    with bpy.context.temp_override(window=window):
        bpy.ops.screen.area_move(x=properties.x, y=properties.y + 300, delta=-120)
    view = next(a for a in screen.areas if a.type == "VIEW_3D")
    with override(window, view):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.55)


def choose_tab(window):
    properties = next(a for a in window.screen.areas if a.type == "PROPERTIES")
    properties.spaces.active.context = "RENDER"


def fill(window):
    left, right = sorted((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
    left.ui_type = "IMAGE_EDITOR"
    left.spaces.active.image = bpy.data.images["ARTO Relit"]
    left.spaces.active.show_gizmo = False
    right.ui_type = "CompositorNodeTree"
    right.spaces.active.show_backdrop = False


def tidy(window):
    for area in window.screen.areas:
        if area.type in {"IMAGE_EDITOR", "NODE_EDITOR"}:
            area.spaces.active.show_region_ui = False
            area.spaces.active.show_region_toolbar = False
        if area.type == "NODE_EDITOR":
            area.spaces.active.show_region_asset_shelf = False


def frame(window):
    for area in window.screen.areas:
        with override(window, area):
            if area.type == "IMAGE_EDITOR":
                bpy.ops.image.view_all(fit_view=True)
            elif area.type == "NODE_EDITOR":
                bpy.ops.node.select_all(action="DESELECT")
                bpy.ops.node.view_all()
            elif area.type == "PROPERTIES":
                for _ in range(200):
                    bpy.ops.view2d.scroll_down(deltay=100)


def ready(window):
    open(sys.argv[-1] + ".ready", "w").close()


def leave(window):
    if os.path.exists(sys.argv[-1] + ".ready"):
        steps.append(leave)  # the picture is still being taken
    else:
        bpy.ops.wm.quit_blender()


# each is drawn before the next
steps = [choose_tab, arrange, fill, tidy, frame, frame, ready, leave]


def step():
    try:
        steps.pop(0)(bpy.context.window_manager.windows[0])
    except BaseException:
        import traceback

        traceback.print_exc()
        bpy.ops.wm.quit_blender()
    return 1.0


# every part of the panel open, whatever is the default
for name in sys.argv[-2].split(","):
    panel = getattr(bpy.types, name)
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()
    bpy.utils.register_class(panel)
bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(step, first_interval=1.0)
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.screenshot")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    options = parser.parse_args()
    picture, panels = options.picture.resolve(), "ARTO_PT_layers_render"
    blender = shlex.split(os.environ.get("BLENDER", ""))
    if not blender:
        print("screenshot: BLENDER is not set, the command line of Blender", file=sys.stderr)
        return 1
    width, height = SCREEN
    display = ["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24"]
    display += ["bash", "-c", PHOTOGRAPH, "-"]
    zipped = package.build()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}
        environment["SHOT"] = str(folder / "shot.png")

        def run(*command: str | Path) -> None:
            subprocess.run(list(map(str, command)), cwd=package.ROOT, env=environment, check=True)

        install = ("--command", "extension", "install-file", "-r", "user_default", "--enable")
        run(*blender, *install, zipped)
        (folder / "work.py").write_text(PLATE)
        (folder / "show.py").write_text(SHOW)
        scene, work, shot = folder / "product.blend", folder / "work.py", folder / "shot.png"
        run(*blender, "-b", "--python-exit-code", "1", "--python", work, "--", package.ROOT, scene)
        window = ("-p", "0", "0", str(width), str(height))
        run(*display, *blender, *window, scene, "--python", folder / "show.py", "--", panels, shot)
        if not shot.is_file():
            print("screenshot: Blender took no picture", file=sys.stderr)
            return 1
        picture.parent.mkdir(parents=True, exist_ok=True)
        picture.write_bytes(shot.read_bytes())
    print(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
