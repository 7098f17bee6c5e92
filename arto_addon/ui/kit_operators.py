"""The operators of the light kit: lights added, removed, changed; presets."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

import math
from dataclasses import replace

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ...core.errors import KitError
from ...core.kit.light import Blend, Kind, Light
from ...core.kit.model import Base, BaseKind, Kit
from ...core.kit.presets import PRESETS, preset
from ..blender.markers import camera_of
from ..blender.nodes import new_world
from ..kit import kit as kits
from ..world.check import world_of
from .operators import Quick

KINDS = (
    ("RECTANGLE", "Rectangle", "A rectangular softbox", "MESH_PLANE", 0),
    ("ROUND", "Round", "A round softbox, or a beauty dish", "MESH_CIRCLE", 1),
    ("RING", "Ring", "A ring light", "MESH_TORUS", 2),
    ("STRIP", "Strip", "A bar with round ends, like a tube", "REMOVE", 3),
    ("SUN", "Sun", "A small round light whose strength is that of Blender's sun", "LIGHT_SUN", 4),
    ("PICTURE", "Picture", "A picture that shines: a window, a logo", "IMAGE_DATA", 5),
    ("FLAG", "Flag", "Takes light away", "MATPLANE", 6),
)
BLENDS = (
    ("ADD", "Add", "Adds to the light behind"),
    ("OVER", "Over", "Stands before the light behind"),
    ("MULTIPLY", "Multiply", "Filters the light behind"),
)
BASES = (
    ("BLACK", "Black", "No light behind the lights"),
    ("GRADIENT", "Gradient", "Three colours from the top to the bottom"),
    ("HDRI", "HDRI", "A picture of all directions"),
)
SWITCHES = (("ON", "On", ""), ("SOLO", "Solo", ""), ("LOCK", "Lock", ""))


def facing(scene: bpy.types.Scene) -> float:
    """The azimuth from the things to the camera, in degrees; from the front without a camera."""
    camera = camera_of(scene)
    if camera is None:
        return -90.0
    x, y, _ = (-part for part in camera.matrix_world.to_3x3().col[2])
    return math.degrees(math.atan2(-y, -x)) if math.hypot(x, y) > 1e-6 else -90.0


def world_to_change(scene: bpy.types.Scene) -> bpy.types.World:
    """The scene's world; a new black one where there is none."""
    world = world_of(scene)
    if world is None:
        world = scene.world = new_world("Light Kit")
        kits.write(world, Kit())
    return world


def chosen(world: bpy.types.World | None) -> bpy.types.Node | None:
    """The light that is chosen in the list; None without one."""
    if world is None or not kits.has(world):
        return None
    nodes = world.node_tree.nodes
    i = world.arto.kit_light
    node = nodes[i] if 0 <= i < len(nodes) else None
    return node if node and kits.is_light(node) else None


def choose(world: bpy.types.World, name: str) -> None:
    """Choose a light in the list."""
    node = kits.node_of(world, name)
    world.arto.kit_light = list(world.node_tree.nodes).index(node)


class OfLight(Quick):
    """An operator on the light that is chosen, or on the one that is named."""

    bl_options = {"REGISTER", "UNDO"}
    light: StringProperty(name="Light", description="Empty for the one that is chosen")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not kits.has(world_of(context.scene)):
            cls.poll_message_set("The world has no light kit yet: add a light")
            return False
        return True

    def found(self, context: bpy.types.Context) -> tuple[bpy.types.World, Kit, Light]:
        """The world, its kit, and the light. Raises KitError."""
        world = world_of(context.scene)
        if world is None or not kits.has(world):
            raise KitError("the world has no light kit: add a light first")
        kit = kits.read(world)
        node = chosen(world)
        name = self.light or (node.label if node else "")
        if not name:
            raise KitError("no light is chosen: click one in the list")
        return world, kit, kit.light(name)


class ARTO_OT_kit_add(Quick):
    """Add a light to the world's light kit. The world as it is becomes the base of the kit"""

    bl_idname = "arto.kit_add"
    bl_label = "Add Light"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(name="Kind", items=KINDS, default="RECTANGLE")
    picture: StringProperty(name="Picture", subtype="FILE_PATH")

    def work(self, context: bpy.types.Context) -> str:
        world = world_to_change(context.scene)
        kit = kits.put_in(world)
        light = new_light(kit, Kind(self.kind), facing(context.scene), self.picture)
        kits.write(world, replace(kit, lights=(*kit.lights, light)))
        choose(world, light.name)
        return f"added '{light.name}'"


def new_light(kit: Kit, kind: Kind, towards: float, picture: str = "") -> Light:
    """A light of a kind with a name that is free, to the right of the camera."""
    name = kit.free_name(next(k[1] for k in KINDS if k[0] == kind))
    at = (towards + 45 + 180) % 360 - 180
    if kind is Kind.PICTURE and not picture:
        raise KitError("a picture needs an image: choose a file")
    made = {
        Kind.SUN: Light(name, kind, width=0.53, strength=3.0),
        Kind.FLAG: Light(name, kind, Blend.MULTIPLY, softness=0.2, strength=0.0),
        Kind.STRIP: Light(name, kind, width=8.0, height=60.0, softness=0.3, stops=3.0),
        Kind.PICTURE: Light(name, kind, Blend.OVER, image=picture, stops=1.0),
    }
    plain = Light(name, kind, softness=0.2, stops=2.0, width=40.0, height=40.0)
    return replace(made.get(kind, plain), azimuth=at, elevation=40.0)


class ARTO_OT_kit_picture(bpy.types.Operator):
    """Add a picture that shines, from a file"""

    bl_idname = "arto.kit_picture"
    bl_label = "Add Picture"
    bl_options = {"REGISTER"}
    filepath: StringProperty(subtype="FILE_PATH")
    filter_image: BoolProperty(default=True, options={"HIDDEN"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, _context: bpy.types.Context) -> set[str]:
        return bpy.ops.arto.kit_add(kind="PICTURE", picture=self.filepath)


class ARTO_OT_kit_remove(OfLight):
    """Remove the light from the kit"""

    bl_idname = "arto.kit_remove"
    bl_label = "Remove Light"

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        if light.lock:
            raise KitError(f"'{light.name}' is locked: unlock it first")
        at = kit.lights.index(light)
        lights = tuple(one for one in kit.lights if one.name != light.name)
        kits.write(world, replace(kit, lights=lights))
        if lights:
            choose(world, lights[max(0, at - 1)].name)
        return f"removed '{light.name}'"


class ARTO_OT_kit_duplicate(OfLight):
    """Add a light like this one, beside it"""

    bl_idname = "arto.kit_duplicate"
    bl_label = "Duplicate Light"

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        name = kit.free_name(light.name)
        beside = light.azimuth + min(light.width * 1.2, 60.0)
        kits.write(world, kit.with_light(replace(light, name=name, azimuth=beside, lock=False)))
        choose(world, name)
        return f"added '{name}'"


class ARTO_OT_kit_move(OfLight):
    """Move the light before or behind the next one"""

    bl_idname = "arto.kit_move"
    bl_label = "Move Light"
    by: IntProperty(default=1, min=-1, max=1)

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        lights = list(kit.lights)
        at = lights.index(light)
        to = min(max(at + self.by, 0), len(lights) - 1)
        lights.insert(to, lights.pop(at))
        kits.write(world, replace(kit, lights=tuple(lights)))
        choose(world, light.name)
        return f"moved '{light.name}'"


class ARTO_OT_kit_switch(OfLight):
    """Switch the light on or off, show it alone, or lock it against tools"""

    bl_idname = "arto.kit_switch"
    bl_label = "Switch Light"
    what: EnumProperty(items=SWITCHES)

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        name = self.what.lower()
        value = not getattr(light, name)
        kits.write(world, kit.with_light(replace(light, **{name: value})))
        return f"'{light.name}': {name} {'yes' if value else 'no'}"


class ARTO_OT_kit_kind(OfLight):
    """Change what the light is; its values stay"""

    bl_idname = "arto.kit_kind"
    bl_label = "Kind"
    kind: EnumProperty(name="Kind", items=[k for k in KINDS if k[0] != "PICTURE"])

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        kits.write(world, kit.with_light(replace(light, kind=Kind(self.kind), image="")))
        return f"'{light.name}' is now a {self.kind.lower()}"


class ARTO_OT_kit_blend(OfLight):
    """Change what the light does with the light behind it"""

    bl_idname = "arto.kit_blend"
    bl_label = "Blend"
    blend: EnumProperty(name="Blend", items=BLENDS)

    def work(self, context: bpy.types.Context) -> str:
        world, kit, light = self.found(context)
        kits.write(world, kit.with_light(replace(light, blend=Blend(self.blend))))
        return f"'{light.name}': {self.blend.lower()}"


class ARTO_OT_kit_preset(Quick):
    """Set up lights to begin with, in place of those of the kit. The base stays, except for the \
tent, which is a base. Locked lights stay"""

    bl_idname = "arto.kit_preset"
    bl_label = "Preset"
    bl_options = {"REGISTER", "UNDO"}
    preset: EnumProperty(name="Preset", items=[(k, v[0], "") for k, v in PRESETS.items()])
    black: BoolProperty(name="Black Base", description="Put black behind the lights", default=False)

    def work(self, context: bpy.types.Context) -> str:
        world = world_to_change(context.scene)
        kit, new = kits.put_in(world), preset(self.preset, facing(context.scene))
        kept = [light for light in kit.lights if light.lock]
        names = {light.name for light in kept}
        lights = (*kept, *(light for light in new.lights if light.name not in names))
        base = kit.base
        if new.base.kind is not BaseKind.BLACK:
            base = new.base
        elif self.black:
            base = Base()
        kits.write(world, replace(kit, lights=tuple(lights), base=base))
        if lights:
            choose(world, lights[-1].name)
        return f"{PRESETS[self.preset][0]}: {len(lights)} lights"


class ARTO_OT_kit_base(Quick):
    """Choose what stands behind the lights, or what the camera sees in their place"""

    bl_idname = "arto.kit_base"
    bl_label = "Base"
    bl_options = {"REGISTER", "UNDO"}
    kind: EnumProperty(name="Base", items=BASES)
    image: StringProperty(name="HDRI", subtype="FILE_PATH")
    backdrop: BoolProperty(name="Backdrop", default=False)

    def work(self, context: bpy.types.Context) -> str:
        world = world_to_change(context.scene)
        kit = kits.put_in(world)
        was = (kit.backdrop if self.backdrop else kit.base) or Base()
        base = replace(was, kind=BaseKind(self.kind), image=self.image or was.image)
        new = replace(kit, backdrop=base) if self.backdrop else replace(kit, base=base)
        kits.write(world, new)
        return f"the {'backdrop' if self.backdrop else 'base'} is {self.kind.lower()}"


class ARTO_OT_kit_no_backdrop(Quick):
    """Let the camera see what lights the scene"""

    bl_idname = "arto.kit_no_backdrop"
    bl_label = "No Backdrop of Its Own"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context: bpy.types.Context) -> str:
        world = world_to_change(context.scene)
        kits.write(world, replace(kits.read(world), backdrop=None))
        return "the camera sees what lights the scene"


CLASSES = (
    ARTO_OT_kit_add,
    ARTO_OT_kit_picture,
    ARTO_OT_kit_remove,
    ARTO_OT_kit_duplicate,
    ARTO_OT_kit_move,
    ARTO_OT_kit_switch,
    ARTO_OT_kit_kind,
    ARTO_OT_kit_blend,
    ARTO_OT_kit_preset,
    ARTO_OT_kit_base,
    ARTO_OT_kit_no_backdrop,
)
