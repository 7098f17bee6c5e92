"""The light kit from and to others: an HDRI's suns, preset files, an HDRI, lamps."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import FloatProperty, StringProperty

from ...core.errors import SceneError
from ...core.kit import kit_file
from ..kit import kit as kits
from ..relight import kit_out
from ..shot.home import check_outside
from ..world.check import world_of
from .kit_operators import OfLight, choose, world_to_change
from .operators import Quick


class ARTO_OT_kit_from_hdri(Quick):
    """Make lights of the suns and lamps in the world's HDRI. The HDRI is written anew beside the \
plate, with their places filled from around, so that each can be moved alone"""

    bl_idname = "arto.kit_from_hdri"
    bl_label = "Suns and Lamps to Lights"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context: bpy.types.Context) -> str:
        names = kit_out.suns_to_lights(context.scene)
        world = world_of(context.scene)
        if not names or world is None:
            return "this light has no suns or lamps"
        choose(world, names[0])
        return f"{len(names)} lights: {', '.join(names[:4])}"


class _File(bpy.types.Operator):
    """An operator that asks for a file."""

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class ARTO_OT_kit_save(_File, OfLight):
    """Write the light kit into a preset file"""

    bl_idname = "arto.kit_save"
    bl_label = "Save Kit"
    bl_options = {"REGISTER"}

    def work(self, context: bpy.types.Context) -> str:
        world = world_of(context.scene)
        if world is None:
            raise SceneError("the scene has no world")
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".json"))
        check_outside(path, "a kit")
        if path.exists():
            kit_file.load(path)  # no file of another kind is written over
        kit_file.save(kit_out.portable(kits.read(world)), path)
        return f"wrote {path}"


class ARTO_OT_kit_load(_File, Quick):
    """Read a light kit from a preset file, in place of the world's"""

    bl_idname = "arto.kit_load"
    bl_label = "Load Kit"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context: bpy.types.Context) -> str:
        kit = kit_file.load(Path(bpy.path.abspath(self.filepath)))
        world = world_to_change(context.scene)
        kits.write(world, kit)
        if kit.lights:
            choose(world, kit.lights[-1].name)
        return f"{len(kit.lights)} lights"


class ARTO_OT_kit_to_hdri(_File, Quick):
    """Write the world's light as an HDRI (EXR), large enough for the smallest light"""

    bl_idname = "arto.kit_to_hdri"
    bl_label = "Light to HDRI"
    bl_options = {"REGISTER"}
    filter_glob: StringProperty(default="*.exr", options={"HIDDEN"})

    def work(self, context: bpy.types.Context) -> str:
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".exr"))
        width, height = kit_out.to_hdri(context.scene, path)
        return f"wrote {path}, {width} x {height}"


class ARTO_OT_kit_to_lamps(Quick):
    """Put the lights of the kit into the scene as area lamps and suns, and take them out of the \
world. The base stays in the world"""

    bl_idname = "arto.kit_to_lamps"
    bl_label = "Lights to Lamps"
    bl_options = {"REGISTER", "UNDO"}
    distance: FloatProperty(
        name="Distance", description="0: a thousand times the size of the scene, where lamps light "
        "as the kit does", min=0.0, unit="LENGTH",
    )  # fmt: skip

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return kits.has(world_of(context.scene))

    def work(self, context: bpy.types.Context) -> str:
        names = kit_out.to_lamps(context.scene, self.distance)
        return f"{len(names)} lamps" if names else "the kit has no lights"


CLASSES = (
    ARTO_OT_kit_from_hdri,
    ARTO_OT_kit_save,
    ARTO_OT_kit_load,
    ARTO_OT_kit_to_hdri,
    ARTO_OT_kit_to_lamps,
)
