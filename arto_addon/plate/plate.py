"""The relit plate: its EXR files, and the image and the compositor node group that show it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import cryptomatte, exr
from ...core.errors import SceneError
from ...core.exr.window import NO_HIT, Window
from ...core.field.field import Field
from ..blender.colour import working_space
from ..blender.compositing import mixed
from ..shot import home, paths
from .header import header

IMAGE = "ARTO Relit"
# The image node in a plate's group.
SOURCE = "ARTO Relit"
# And that of how much a plate with shadow catchers shows of what is behind.
SHARE = "ARTO Catcher"
# Of such a plate's header, of one that has layers, of one that is cropped: its copy that is not.
CATCHER, LAYERS, CROPPED = "arto.shadow catchers", "arto.layers", "arto.full window"


def write(
    scene: bpy.types.Scene,
    path: Path,
    picture: NDArray[np.float32],
    about: dict[str, str],
    shows: bool = False,
) -> None:
    """Write the plate: (H, W, 4) scene-linear, premultiplied. The header names its colour space,
    and has what Blender's own render of the scene would have in it.

    shows: whether a node group of ours does: then it is there with all its pixels, too.
    """
    window = window_of(scene)
    exr.write(path, {"": picture}, *header_of(scene, about), window)
    if window.crop and shows:
        full = replace(window, crop=False)
        exr.write(full_file(path), {"": picture}, *header_of(scene, about), full)


def window_of(scene: bpy.types.Scene) -> Window:
    """How the settings want pictures to stand in their files."""
    return Window(scene.arto.overscan, scene.arto.data_window == "CROP")


def full_file(path: Path) -> Path:
    """Beside a file that is cropped: the same with all its pixels.

    Blender's image is the data window, wherever that stands, and its compositor puts one that is
    not in the middle of its display window upside down: as far below as it should be above (5.2).
    """
    return path.with_name(f"{path.stem}_full.exr")


def shown_file(path: Path, header: dict[str, object]) -> Path:
    """What Blender shows of a file of a plate that has this header."""
    return full_file(path) if CROPPED in header else path


def header_of(scene: bpy.types.Scene, about: dict[str, str]) -> tuple[dict[str, object], str]:
    """A plate's header and colour space."""
    attributes = header(scene) | {f"arto.{k}": v for k, v in about.items()}
    return attributes, working_space()


def share_file(path: Path) -> Path:
    """Beside a plate with shadow catchers: how much of what is behind it is seen, by colour."""
    return path.with_name(f"{path.stem}_catcher.exr")


def light_file(path: Path) -> Path:
    """Beside a plate with shadow catchers: the light that its things add to the ground."""
    return path.with_name(f"{path.stem}_light.exr")


def layers_file(path: Path) -> Path:
    """Beside a plate: what each part of its light gives to it."""
    return path.with_name(f"{path.stem}_layers.exr")


def world_file(path: Path) -> Path:
    """Beside a plate: the world that a mix of its layers is rendered with."""
    return path.with_name(f"{path.stem}_world.exr")


def data_file(path: Path) -> Path:
    """Beside a plate: what a denoiser or a compositor knows a picture by."""
    return path.with_name(f"{path.stem}_data.exr")


# Of the layers of that file, the letters of their channels.
DATA = {"albedo": "RGB", "normal": "XYZ", "depth": "Z", "position": "XYZ"}
# Of its header: what of this there is not.
MISSING = "arto.missing"


def write_data(
    scene: bpy.types.Scene, path: Path, field: Field, about: dict[str, str]
) -> list[str]:
    """Write what a field knows of a plate beside its light, as 32-bit floats, a part each; and the
    Cryptomattes of the artist's own render, where the settings name it. Returns what the field does
    not know. Raises SceneError where the render is of another size; ExrError."""
    parts: dict[str, dict[str, NDArray]] = {}
    missing = [name for name in DATA if not field.has_layer(name)]
    for name, letters in DATA.items():
        if field.has_layer(name):
            pixels = field.layer(name).reshape(*field.shape, -1)
            if name == "depth":  # outside a render region
                pixels = np.where(pixels == 0, np.float32(NO_HIT), pixels)
            parts[name] = {c: pixels[..., i] for i, c in enumerate(letters)}
    attributes, _ = header_of(scene, about)
    if missing:
        attributes[MISSING] = ", ".join(missing)
    if scene.arto.cryptomatte:
        rendered = home.absolute(scene.arto.cryptomatte)
        planes, names = cryptomatte.read(rendered)
        if any(plane.shape != field.shape for plane in planes.values()):
            raise SceneError(f"{rendered} is a render of another size: render this shot again")
        parts["cryptomatte"] = planes
        attributes |= names
    if parts:
        exr.write_planes(data_file(path), parts, attributes, window_of(scene))
    return missing


def comp_file(path: Path) -> Path:
    """Beside a plate with shadow catchers: it in the artist's footage."""
    return path.with_name(f"{path.stem}_comp.exr")


def name_of(scene: bpy.types.Scene, look: str | None = None) -> str:
    """The name of the plate's image and node group: of this scene and look, and no other's."""
    name = paths.relit_name(scene, look)
    return f"ARTO {name}" if name else IMAGE


def show(path: Path, name: str = IMAGE) -> bpy.types.Image:
    """The image data-block of a plate, loaded anew."""
    image = bpy.data.images.get(name)
    relative = bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    if image is None:
        image = bpy.data.images.load(str(path))
        image.name = name
    image.source = "FILE"
    image.filepath = relative
    image.reload()
    image.colorspace_settings.name = working_space()
    image.alpha_mode = "PREMUL"
    # the image editor shows it as it shows a render: exposure, AgX
    image.use_view_as_render = True
    # the node group is enough of a user only once it is there
    image.use_fake_user = True
    return image


def node_group(
    image: bpy.types.Image, name: str = IMAGE, share: bpy.types.Image | None = None
) -> Any:
    """The compositor node group that shows a plate; made once, then kept up to date.

    share: of a plate with shadow catchers, which the group puts into footage.
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


def add_footage(tree: bpy.types.NodeTree, things: Any, share: bpy.types.Image) -> None:
    """To a group that shows a plate, if it has it not: footage goes in, and comes out behind the
    things, a socket of the tree, and in their shadows."""
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
