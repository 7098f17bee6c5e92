"""The relit plate: its EXR files, and the image and the compositor node group that show it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import exr
from ...core.cryptomatte import Mattes
from ...core.errors import FieldError
from ...core.exr.window import NO_HIT, Window
from ...core.exr.writing import Opener
from ...core.field.field import Field
from ...core.files import whole
from ..blender.colour import working_space
from ..blender.compositing import mixed
from ..blender.pictures import step_aside
from ..shot import home
from .header import header
from .names import relit_name

IMAGE = "ARTO Relit"
# The image node in a plate's group.
SOURCE = "ARTO Relit"
# The image node of the share, for a plate with shadow catchers: how much of the footage is seen.
SHARE = "ARTO Catcher"
# Attributes in a plate's header: the plate has shadow catchers; it has layers; it is cropped, and
# the attribute names the copy with all pixels.
CATCHER, LAYERS, CROPPED = "arto.shadow catchers", "arto.layers", "arto.full window"


def write(
    scene: bpy.types.Scene,
    path: Path,
    picture: NDArray[np.float32],
    about: dict[str, str],
    shows: bool = False,
    opener: Opener = whole,
) -> None:
    """Write a picture of a plate.

    The header names the colour space, and has the attributes of Blender's own render of the scene.
    picture: (H, W, 4), scene-linear, premultiplied; about: more attributes, by the names after
    `arto.`; shows: whether a node group of ARTO's shows the file. A cropped file then gets a copy
    with all pixels, which its header names. opener: how the files are put in their places.
    """
    window = window_of(scene)
    attributes, space = header_of(scene, about)
    named = attributes | ({CROPPED: full_file(path).name} if window.crop and shows else {})
    (stored,) = exr.as_half(picture) if scene.arto.depth == "HALF" else [picture]
    by = scene.arto.compression
    exr.write(path, {"": stored}, named, space, window, opener=opener, compression=by)
    if window.crop and shows:
        full = replace(window, crop=False)
        copy = full_file(path)
        exr.write(copy, {"": stored}, attributes, space, full, opener=opener, compression=by)


def window_of(scene: bpy.types.Scene) -> Window:
    """The windows that the settings ask for in a plate's files."""
    return Window(scene.arto.overscan, scene.arto.data_window == "CROP")


def full_file(path: Path) -> Path:
    """The path of the copy with all pixels, beside a cropped file.

    Blender needs the copy. Its image has only the data window, wherever that stands in the display
    window. Its compositor (5.2) mirrors the place of a data window that is not in the middle: as
    far below as it should be above.
    """
    return path.with_name(f"{path.stem}_full.exr")


def shown_file(path: Path, header: dict[str, object]) -> Path:
    """The file that Blender shows for a plate's file: the copy, where the header says cropped."""
    return full_file(path) if CROPPED in header else path


def header_of(scene: bpy.types.Scene, about: dict[str, str]) -> tuple[dict[str, object], str]:
    """The attributes of a plate's header, and the name of its colour space."""
    attributes = header(scene) | {f"arto.{k}": v for k, v in about.items()}
    return attributes, working_space()


def share_file(path: Path) -> Path:
    """The path of the share, beside a plate with shadow catchers: how much of the footage is seen.

    The share has three colours.
    """
    return path.with_name(f"{path.stem}_catcher.exr")


def light_file(path: Path) -> Path:
    """The path of the light that the things add to the ground, beside a plate with catchers."""
    return path.with_name(f"{path.stem}_light.exr")


def layers_file(path: Path) -> Path:
    """The path of the layers, beside a plate: the picture in each part of the light."""
    return path.with_name(f"{path.stem}_layers.exr")


def layers_prefix(path: Path, said: str) -> str | None:
    """The prefix of the files of single layers beside a plate, from what the plate's header says.

    said: the header's `LAYERS`, as in `shot_relit_LG_*.exr`. None where it names no such files.
    """
    begin, end = f"{path.stem}_", "*.exr"
    return said[len(begin) : -len(end)] if said.startswith(begin) and said.endswith(end) else None


def world_file(path: Path) -> Path:
    """The path of the world of a mix, beside a plate: renders of the scene get the mix's light."""
    return path.with_name(f"{path.stem}_world.exr")


def data_file(path: Path) -> Path:
    """The path of the data, beside a plate: albedo, normals, Cryptomattes and more, see `DATA`."""
    return path.with_name(f"{path.stem}_data.exr")


# By the layers of the data file: the letters of the layer's channels.
DATA = {"albedo": "RGB", "normal": "XYZ", "depth": "Z", "position": "XYZ", "through": "RGB"}
# How much of what lies behind is seen, by channel; where alpha does not tell it.
THROUGH = "through"
# The part of the data file with what the artist's own render has.
MATTES = "cryptomatte"
# The attribute in the header of the data file that names the missing layers.
MISSING = "arto.missing"


def write_data(
    scene: bpy.types.Scene,
    path: Path,
    field: Field,
    mattes: Mattes | None,
    about: dict[str, str],
    opener: Opener = whole,
) -> list[str]:
    """Write a plate's data file: the data layers of a field, and the artist's Cryptomattes.

    Each layer is a part of 32-bit floats. mattes: from the artist's own render, see `mattes.read`.
    Returns the names of the layers that the field does not have. Raises ExrError.
    """
    parts: dict[str, dict[str, NDArray]] = {}
    missing = [name for name in DATA if name != THROUGH and not field.has_layer(name)]
    for name, letters in DATA.items():
        layer = field.through() if name == THROUGH else None
        if name != THROUGH and field.has_layer(name):
            layer = field.layer(name)
        if layer is not None:
            pixels = layer.reshape(*field.shape, -1)
            if not np.isfinite(pixels).all():
                raise FieldError(
                    f"'{name}' in {field.folder} is infinite or not a number in some pixels, so "
                    "no data was written: capture again, or turn Write Data off"
                )
            if name == "depth":  # 0 stands outside a render region, where no thing is seen.
                pixels = np.where(pixels == 0, np.float32(NO_HIT), pixels)
            parts[name] = {c: pixels[..., i] for i, c in enumerate(letters)}
    attributes, _ = header_of(scene, about)
    if missing:
        attributes[MISSING] = ", ".join(missing)
    if mattes:
        parts[MATTES] = mattes.planes
        attributes |= mattes.about
    if parts:
        # what is no colour must come back to the bit
        by = "ZIPS" if scene.arto.compression == "DWAA" else scene.arto.compression
        named, colours = (data_file(path), parts, attributes), {"albedo": working_space()}
        exr.write_planes(*named, window_of(scene), [MATTES], opener, by, colours)
    return missing


def comp_file(path: Path) -> Path:
    """The path of the things in the artist's footage, beside a plate with shadow catchers."""
    return path.with_name(f"{path.stem}_comp.exr")


def name_of(scene: bpy.types.Scene, look: str | None = None) -> str:
    """The name of the plate's image and node group, which no other scene or look has."""
    name = relit_name(scene, look)
    return f"ARTO {name}" if name else IMAGE


def show(path: Path, name: str = IMAGE) -> bpy.types.Image:
    """Load a plate's file anew as Blender's image of a name, and return the image."""
    image = bpy.data.images.get((name, None))
    if image is not None and image.source == "GENERATED":
        step_aside(name)  # it was made or painted in Blender, and is nobody's plate
        image = None
    relative = home.relative(path)
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = name
    image.source = "FILE"
    image.filepath = relative
    image.reload()
    image.colorspace_settings.name = working_space()
    image.alpha_mode = "PREMUL"
    # The image editor shows the plate like a render, with exposure and view transform.
    image.use_view_as_render = True
    # The image must not be lost before a node group uses it.
    image.use_fake_user = True
    return image


def node_group(
    image: bpy.types.Image, name: str = IMAGE, share: bpy.types.Image | None = None
) -> bpy.types.NodeTree:
    """Make or update the compositor's node group that shows a plate.

    share: for a plate with shadow catchers, the image of how much of the footage is seen. The group
    then also puts the things into footage.
    """
    tree = bpy.data.node_groups.get(name)
    if tree is None or tree.bl_idname != "CompositorNodeTree":
        tree = bpy.data.node_groups.new(name, "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Alpha", in_out="OUTPUT", socket_type="NodeSocketFloat")
        source = tree.nodes.new("CompositorNodeImage")
        source.name = SOURCE
        out = tree.nodes.new("NodeGroupOutput")
        out.location = (300, 0)
        tree.links.new(source.outputs["Image"], out.inputs["Image"])
        tree.links.new(source.outputs["Alpha"], out.inputs["Alpha"])
    source = tree.nodes.get(SOURCE)
    if source:
        source.image = image
    if share and source:
        add_footage(tree, source.outputs["Image"], share)
    return tree


def add_footage(
    tree: bpy.types.NodeTree, things: bpy.types.NodeSocket, share: bpy.types.Image
) -> None:
    """Have a plate's node group put the things into footage; a group that does so is updated.

    The group gets an input for the footage, and an output for the composite. things: the socket
    in the group that gives the things; share: how much of the footage is seen.
    """
    if SHARE in tree.nodes:
        tree.nodes[SHARE].image = share
        return
    tree.interface.new_socket("Footage", in_out="INPUT", socket_type="NodeSocketColor")
    for name in ("Composite", "Shadow Catcher"):
        tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketColor")
    shown = tree.nodes.new("CompositorNodeImage")
    shown.name, shown.location, shown.image = SHARE, (0, -400), share
    footage = tree.nodes.new("NodeGroupInput")
    footage.location = (-200, -300)
    seen = mixed(tree, "MULTIPLY", footage.outputs["Footage"], shown.outputs["Image"])
    whole = mixed(tree, "ADD", things, seen)
    out = next(n for n in tree.nodes if n.bl_idname == "NodeGroupOutput")
    tree.links.new(whole, out.inputs["Composite"])
    tree.links.new(shown.outputs["Image"], out.inputs["Shadow Catcher"])
