"""The real program for tests: Blender with the extension installed, with its window or without."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

from tools import package

ROOT = Path(package.ROOT)
WIDTH, HEIGHT = 64, 48
MAKE_SCENE = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
import bpy
from bench import scenes, worlds

path, camera = sys.argv[-2:]
scene = scenes.product_shot(width={WIDTH}, height={HEIGHT})
bpy.data.objects.remove(bpy.data.objects["bottle"])  # its caustics would need many samples
worlds.set_world_hdri(scene, "sunset")
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.arto")
scene.arto.patches = 2
scene.arto.samples = 256
if camera == "none":
    bpy.data.objects.remove(scene.camera)
bpy.ops.wm.save_as_mainfile(filepath=path)
if camera != "none":
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = path + ".reference.exr"
    scene.cycles.samples = 256
    bpy.ops.render.render(write_still=True)
"""

# The beginning of a script that saves a shot with a shadow catcher, small and quick.
MAKE_CATCHER = """
import bpy, sys
bpy.ops.wm.read_factory_settings()
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.arto")
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = 48, 36
scene.render.resolution_percentage = 100
scene.render.film_transparent = True
bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
bpy.context.object.is_shadow_catcher = True
"""


class Program:
    """Blender with the extension installed, and its user's files in `home`."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.environment = {**os.environ, "BLENDER_USER_RESOURCES": str(home)}
        self.command = shlex.split(os.environ["BLENDER"])

    def run(self, *arguments: str | Path, screen: bool = False) -> subprocess.CompletedProcess[str]:
        """Run it to its end; screen: in its window, on a display of its own."""
        line = [*self.command, *map(str, arguments)]
        environment = self.environment
        if screen:
            line = ["xvfb-run", "-a", "-s", "-screen 0 1600x900x24", *line]
        return subprocess.run(
            line, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300
        )

    def script(self, text: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a script in it, without a window; it must succeed."""
        done = self.run("-b", "--python-exit-code", "1", "--python-expr", text, "--", *arguments)
        assert done.returncode == 0, said(done)
        return done


def said(done: subprocess.CompletedProcess[str]) -> str:
    return f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
