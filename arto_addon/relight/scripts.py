"""Scripts for other compositors beside a plate's layers, with the gains that Blender's mixer has.

A script is the artist's as soon as it was changed and saved: then it stays, and shows the newest
files anyway, because it reads them by their names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import bpy

from ...core.exr.writing import Opener
from ...core.mix.fusion import fusion_comp
from ...core.mix.mix import Behind, Layer, Mix, sequence
from ...core.mix.nuke import nuke_script
from ..blender.colour import working_space
from ..blender.compositing import compositor
from ..plate import plate
from ..plate.footage import footage
from ..plate.marks import SCRIPTS, is_own_script
from ..plate.mixer import EXPOSURE_SOCKET, SOURCE
from ..stage.stage import picture_size
from ..work import Progress

_WRITERS = dict(zip(SCRIPTS, (nuke_script, fusion_comp), strict=True))


def described(
    scene: bpy.types.Scene, path: Path, layers: Mapping[str, str | None], catches: bool
) -> Mix:
    """Describe the mix of a plate.

    layers: by the name of each layer the name of its own file, None where all are in one; catches:
    whether the plate has shadow catchers.
    """
    settings, render = scene.arto, scene.render
    width, height = picture_size(scene)
    over = settings.overscan
    behind = None
    if catches:
        found = footage(scene)
        file = found.file(scene) if found else None
        by = plate.light_file(path) if settings.shadows == "ADD" else plate.share_file(path)
        there = None
        if file is not None:
            there = file.name if file.parent == path.parent else file.as_posix()
        behind = Behind(settings.shadows, by.name, there)
    mix = Mix(
        path.name,
        (width - 2 * over, height - 2 * over),
        tuple(Layer(name, file=file) for name, file in layers.items()),
        None if all(layers.values()) else plate.layers_file(path).name,
        behind=behind,
        data=plate.data_file(path).name if settings.write_data else None,
        space=working_space(),
        aspect=render.pixel_aspect_x / render.pixel_aspect_y,
        fps=render.fps / render.fps_base,
        frame=scene.frame_current,
    )
    return as_mixed(mix, mixer_of(scene, mix))


def of_frames(scene: bpy.types.Scene, path: Path, mix: Mix, last: int) -> tuple[Path, Mix]:
    """The mix of a sequence from that of its first frame -> (where its scripts stand, the mix).

    The scripts are named after the sequence, without their endings. Footage that moves is left out.
    """
    number = _number_in(path.stem, mix.frame)
    begin, _, end = path.stem.rpartition(number)
    found = sequence(mix, last, path.stem, f"{begin}{'#' * len(number)}{end}")
    source = footage(scene)
    if found.behind is not None and source is not None and source.source.source != "FILE":
        found = replace(found, behind=replace(found.behind, footage=None))
    return path.with_name(f"{begin}sequence{end}.exr"), found


def _number_in(stem: str, frame: int) -> str:
    """How a frame's number stands in the name of its plate: last, with as many digits as there."""
    found = re.findall(r"-?\d+", stem)
    return next(digits for digits in reversed(found) if int(digits) == frame)


def mixer_of(scene: bpy.types.Scene, mix: Mix) -> bpy.types.Node | None:
    """The mixer of a plate in the scene's compositor: the node that has a socket for each layer."""
    tree = compositor(scene)
    for node in tree.nodes if tree else ():
        group = getattr(node, "node_tree", None)
        ours = group is not None and SOURCE in group.nodes
        if ours and all(layer.name in node.inputs for layer in mix.layers):
            return node
    return None


def as_mixed(mix: Mix, mixer: bpy.types.Node | None) -> Mix:
    """A mix with the gains, tints and exposure of a mixer. A socket with a link counts as 1."""
    if mixer is None:
        return mix

    def number(name: str, otherwise: float) -> float:
        socket = mixer.inputs[name]
        return otherwise if socket.is_linked else float(socket.default_value)

    layers = []
    for layer in mix.layers:
        socket = mixer.inputs[f"{layer.name} Tint"]
        red, green, blue = (1.0,) * 3 if socket.is_linked else socket.default_value[:3]
        gain = number(layer.name, 1.0)
        layers.append(replace(layer, gain=gain, tint=(float(red), float(green), float(blue))))
    return replace(mix, layers=tuple(layers), exposure=number(EXPOSURE_SOCKET, 0.0))


def write(path: Path, mix: Mix, opener: Opener) -> Iterator[Progress]:
    """Write the scripts of a mix beside a plate; one that was changed stays."""
    for ending, text in _WRITERS.items():
        script = path.with_suffix(ending)
        empty = script.is_file() and not script.stat().st_size
        if script.exists() and not empty and not is_own_script(script):
            yield Progress(0.95, f"{script.name} was changed since, or is not ARTO's: it stays")
            continue
        with opener(script) as partial:
            partial.write_text(text(mix), encoding="utf-8", newline="\n")
