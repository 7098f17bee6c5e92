"""The strip of HDRIs in the panel Light: those used last, and those of asset libraries."""

# pyright: reportInvalidTypeForm=false
# Blender reads properties from annotations.
from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from ...core.errors import SceneError
from ..shot import watch
from ..world import controls, hdris, shelf
from ..world.check import world_of
from . import thumbnails
from .operators import Quick

# How many are shown at a time.
ACROSS = 4
# Seconds after which it is looked whether the libraries were looked through.
WAIT = 0.5
# The custom property of a world that says which asset it was appended from.
FROM = "arto_asset"


def draw(
    column: bpy.types.UILayout, context: bpy.types.Context, world: bpy.types.World | None
) -> None:
    """Draw a row of thumbnails. A click on the name below one lights the scene with it."""
    if not bpy.app.background:
        shelf.look(lambda: None)
        if shelf.looking() and not bpy.app.timers.is_registered(_found):
            bpy.app.timers.register(_found, first_interval=WAIT)
    items, now = shelf.items(), _shown_by(world) if world else None
    if all(item == now for item in items):  # nothing to choose
        return
    switch = context.window_manager.arto
    first = min(switch.strip, (len(items) - 1) // ACROSS) * ACROSS
    shown = [*items[first : first + ACROSS]]
    row = column.row(align=True)
    if len(items) > ACROSS:
        _turn(row, "TRIA_LEFT", -1, first > 0)
    for item in shown:
        cell = row.column(align=True)
        cell.template_icon(thumbnails.of_file(item.path, item.world), scale=2.2)
        button = cell.operator(
            "arto.use_hdri", text=item.title, translate=False, depress=item == now
        )
        button.filepath, button.world = item.path, item.world
    for _ in range(ACROSS - len(shown)):
        row.column().label(text="")
    if len(items) > ACROSS:
        _turn(row, "TRIA_RIGHT", 1, first + ACROSS < len(items))


def _turn(row: bpy.types.UILayout, icon: str, by: int, enabled: bool) -> None:
    cell = row.column()
    cell.scale_y, cell.enabled = 3.2, enabled
    cell.operator("arto.more_hdris", text="", icon=icon, emboss=False).by = by


def _found() -> float | None:
    """Redraw the panels once the asset libraries were looked through."""
    if shelf.looking():
        return WAIT
    watch.redraw()
    return None


def _shown_by(world: bpy.types.World) -> shelf.Item | None:
    if path := world.get(FROM, ""):
        return shelf.Item(path, world.name)
    image = controls.hdri(world)
    if image is None or not image.filepath:
        return None
    return shelf.Item(str(Path(bpy.path.abspath(image.filepath, library=image.library)).absolute()))


def light_with(scene: bpy.types.Scene, path: Path) -> str:
    """Light a scene with an HDRI from a file -> the name of its image. Raises SceneError."""
    hdris.check(path)
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError as e:
        raise SceneError(f"{path} cannot be read ({e}): choose an HDRI") from e
    world = world_of(scene)
    if world is not None and FROM in world:
        world = None  # an asset stays what it is
    if world is None:
        world = bpy.data.worlds.new(path.stem)
        scene.world = world
    if world.library:
        raise SceneError("the world is linked from a library: make it local to change it")
    controls.set_hdri(world, image)
    if not bpy.app.background:
        shelf.note(str(path))
    return image.name


class ARTO_OT_use_hdri(Quick):
    """Light the scene with this one"""

    bl_idname = "arto.use_hdri"
    bl_label = "Use This HDRI"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})
    world: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def description(cls, context: bpy.types.Context, properties: object) -> str:
        where, name = getattr(properties, "filepath", ""), getattr(properties, "world", "")
        return f"{where}: {name}" if name else where

    def work(self, context: bpy.types.Context) -> str:
        if not self.world:
            name = light_with(context.scene, Path(bpy.path.abspath(self.filepath)))
            return f"the world shows {name}"
        context.scene.world = _asset(self.filepath, self.world)
        return f"the world is {context.scene.world.name}"


def _asset(path: str, name: str) -> bpy.types.World:
    """The world of an asset library, appended once. Raises SceneError."""
    for world in bpy.data.worlds:
        if world.get(FROM) == path and world.name.split(".")[0] == name.split(".")[0]:
            return world
    try:
        with bpy.data.libraries.load(path) as (there, into):
            into.worlds.extend([name] if name in there.worlds else [])
    except OSError as e:
        raise SceneError(f"{path} cannot be read ({e}): choose another world") from e
    if not into.worlds:
        raise SceneError(f"there is no world '{name}' in {path} any more: choose another one")
    world = into.worlds[0]
    world[FROM] = path
    return world


class ARTO_OT_more_hdris(bpy.types.Operator):
    """Show other HDRIs"""

    bl_idname = "arto.more_hdris"
    bl_label = "More HDRIs"

    by: IntProperty(default=1, options={"HIDDEN", "SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        switch = context.window_manager.arto
        switch.strip = max(0, switch.strip + self.by)
        watch.redraw()
        return {"FINISHED"}


CLASSES = (ARTO_OT_use_hdri, ARTO_OT_more_hdris)


def register() -> None:
    """Nothing is looked for before the panel is drawn."""


def unregister() -> None:
    shelf.forget()
    if bpy.app.timers.is_registered(_found):
        bpy.app.timers.unregister(_found)
