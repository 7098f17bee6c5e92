"""Settings of a relight: what is shown, and which files are written."""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..plate import compare
from ..plate.present import use
from ..relight import looks


def _use_chosen(self: RelightSettings, context: bpy.types.Context) -> None:
    use(self.id_data)


class ArtoGroup(bpy.types.PropertyGroup):
    """A part of the world's light that gets a layer of its own. Its name is the layer's."""

    mask: PointerProperty(
        type=bpy.types.Image,
        name="Painted",
        description="An image of the HDRI's shape: where it is white, the light is in this group. "
        "Empty: a round part of the light",
    )
    azimuth: FloatProperty(
        name="Azimuth",
        description="Where its middle is, counterclockwise from +X as seen from above",
        subtype="ANGLE",
        soft_min=-math.pi,
        soft_max=math.pi,
    )
    elevation: FloatProperty(
        name="Elevation",
        description="How high its middle is above the horizon",
        subtype="ANGLE",
        min=-math.pi / 2,
        max=math.pi / 2,
    )
    radius: FloatProperty(
        name="Radius",
        description="How far it reaches from its middle",
        subtype="ANGLE",
        min=0.0,
        max=math.pi,
        default=math.radians(30),
    )
    soft: FloatProperty(
        name="Soft Edge",
        description="Over which share of its radius it fades",
        min=0.0,
        max=1.0,
        default=0.1,
    )


def _look_named(self: ArtoLook, context: bpy.types.Context) -> None:
    looks.named(self.id_data, self)


class ArtoLook(bpy.types.PropertyGroup):
    """A light that the shot is shown in. Its name is that of its plate."""

    name: StringProperty(
        name="Name",
        description="What the look is called; its plate is named after it",
        update=_look_named,
    )
    world: PointerProperty(
        type=bpy.types.World, name="World", description="The world that lights this look"
    )


class ArtoLamps(bpy.types.PropertyGroup):
    """A light group of the scene's own lamps. Its name is the group's."""

    show: BoolProperty(name="Show", description="Whether these lamps are lit", default=True)
    gain: FloatProperty(
        name="Gain",
        description="How much of these lamps' light is shown, as a factor of what was captured",
        min=0.0,
        soft_max=4.0,
        default=1.0,
    )


def _look_chosen(self: RelightSettings, context: bpy.types.Context) -> None:
    looks.show(self.id_data)


def _compare_chosen(self: RelightSettings, context: bpy.types.Context) -> None:
    compare.update(self.id_data)


class RelightSettings:
    """What relighting reads."""

    own_lamps: FloatProperty(
        name="Scene Lamps",
        description="How much of the light of the scene's own lamps, and of what emits in it, the "
        "relit picture has, as a factor",
        min=0.0,
        soft_max=2.0,
        default=1.0,
    )
    denoise: BoolProperty(
        name="Denoise",
        description="Denoise the relit picture with Open Image Denoise, steered by the captured "
        "albedo and normal",
        default=True,
    )
    lamps: BoolProperty(
        name="Render the HDRI's Suns",
        description="Cut suns and bright lamps out of the HDRI and render their light by itself, "
        "quickly, for sharp shadows; the capture brings the rest. Off: all from the capture",
        default=True,
    )
    lamp_samples: IntProperty(
        name="Sun Samples",
        description="Samples of that render for an HDRI that is all suns and lamps; for one where "
        "they have a part of the light, that part of the samples",
        min=1,
        soft_max=256,
        default=32,
    )
    environment_width: IntProperty(
        name="World Width",
        description="Width in pixels that the world is brought to before relighting. Mirrors "
        "show no more detail than this",
        min=64,
        max=16384,
        default=1024,
    )
    look: StringProperty(
        name="Look",
        description="Name of the light that the shot is shown in. Each look has a picture and an "
        "EXR of its own; empty: the scene's only one",
        default="",
    )
    write_data: BoolProperty(
        name="Write Data",
        description="Write albedo, normals, depth and positions beside the picture, as 32-bit "
        "floats",
        default=False,
    )
    cryptomatte: StringProperty(
        name="Cryptomatte",
        description="An EXR of your own render of this shot, whose Cryptomattes go into the data "
        "file as they are",
        subtype="FILE_PATH",
        default="",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    shadows: EnumProperty(
        name="Shadows",
        description="How the things of a shot with shadow catchers go into footage",
        items=[
            ("MULTIPLY", "Multiply", "As Cycles: the footage times what is left of its light"),
            (
                "ADD",
                "Add Light",
                "The footage, and the light that the things add to the ground as "
                "it was modelled or take from it: for a ground that looks like what was filmed",
            ),
        ],
        default="MULTIPLY",
    )
    use_in_compositor: EnumProperty(
        name="Use in Compositor",
        description="Where the scene's compositor has the relit picture",
        items=[
            ("VIEWER", "In a Viewer", "A node beside yours, seen through a viewer"),
            (
                "RENDER",
                "Instead of the Render",
                "What hangs on the render hangs on it; In a Viewer puts it back",
            ),
        ],
        default="VIEWER",
        update=_use_chosen,
    )
    compare: EnumProperty(
        name="Compare",
        description="The plate beside the last render of this scene, in the image editor",
        items=[
            ("OFF", "Plate", "The plate alone"),
            ("SIDE", "Side by Side", "Left half of the plate, right half of the render"),
            ("WIPE", "Wipe", "The plate up to the wipe, the render beyond it"),
            ("RENDER", "Render", "The render alone"),
        ],
        default="OFF",
        update=_compare_chosen,
    )
    wipe: FloatProperty(
        name="Wipe",
        description="Where the plate ends and the render begins, as a share of the width",
        min=0.0,
        max=1.0,
        default=0.5,
        subtype="FACTOR",
        update=_compare_chosen,
    )
    footage: PointerProperty(
        type=bpy.types.Image,
        name="Footage",
        description="What the things are put into where the scene has shadow catchers: an image, "
        "a sequence or a movie. Empty: what the camera has behind it, or the compositor",
    )
    layers: EnumProperty(
        name="Layers",
        description="What else is written of the relit picture: the light of each part of the "
        "world, and of the scene's own lamps, to be mixed in the compositor",
        items=[
            ("OFF", "None", "The picture alone"),
            ("FACES", "By Direction", "A layer for each face of the hemicube"),
            ("GROUPS", "By Groups", "A layer for each group of the light, and one for the rest"),
        ],
        default="OFF",
    )
    looks: CollectionProperty(type=ArtoLook)
    active_look: IntProperty(
        name="Look", description="The light that the shot is shown in", update=_look_chosen
    )
    own_groups: CollectionProperty(type=ArtoLamps)
    active_own_group: IntProperty()
    live_finish: BoolProperty(
        name="Finish When Resting",
        description="While Live is on and the light is left alone for two seconds, relight the "
        "shot as the button does: with the HDRI's suns, and denoised",
        default=True,
    )
    groups: CollectionProperty(type=ArtoGroup)
    active_group: IntProperty()
    layer_prefix: StringProperty(
        name="Layer Prefix",
        description="What the layers' names begin with in the file",
        default="LG_",
    )
    layers_files: EnumProperty(
        name="Layer Files",
        description="How the layers are written for other programs",
        items=[
            ("ONE", "One for All", "One file with all layers and the picture in it"),
            (
                "EACH",
                "One Each",
                "A file for each layer, named after it, with R, G, B and the picture's alpha. The "
                "mixer in Blender's compositor keeps a file of all",
            ),
        ],
        default="ONE",
    )
    layers_half: BoolProperty(
        name="Half Float",
        description="Write the layers as 16-bit floats, as compositing does; else as 32-bit",
        default=True,
    )
    data_window: EnumProperty(
        name="Data Window",
        description="Which pixels the files have",
        items=[
            ("FULL", "All", "All of the picture"),
            (
                "CROP",
                "Cropped",
                "Only those around what is there: other programs work faster on them. Blender's "
                "own nodes show copies that are whole",
            ),
        ],
        default="FULL",
    )
    overscan: IntProperty(
        name="Overscan",
        description="How many pixels at each edge the scene's resolution has beyond what is "
        "delivered. The files keep them, outside of their display window",
        subtype="PIXEL",
        min=0,
        soft_max=500,
        default=0,
    )
    output: StringProperty(
        name="Relit Picture",
        description="The relit EXR, #### for the frame's number; empty: beside the .blend, named "
        "after it",
        subtype="FILE_PATH",
        default="",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
