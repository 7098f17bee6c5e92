"""What a support for each channel is worth: a glass that disperses, and a blue coat on red."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from arto.arto_addon.blender.nodes import new_material
from arto.arto_addon.world.bake import bake
from arto.core import metrics
from arto.core.light.light import PatchLight
from arto.core.relight import relight

from . import scenes
from .machine import write_rows
from .models import captured, fitted, truth
from .worlds import World

SCENE = "colour"
MATERIALS = {"prism": 1, "coat": 2, "floor": 5}
# Stronger than real glass, so that the channels part by more than a pixel's own width.
INDICES = (("R", (1, 0, 0, 1), 1.45), ("G", (0, 1, 0, 1), 1.55), ("B", (0, 0, 1, 1), 1.65))


def _prism() -> bpy.types.Material:
    """Glass whose index differs by channel: three refractions, a channel each, added up."""
    material = new_material("prism")
    tree = material.node_tree
    tree.nodes.clear()
    total = None
    for name, colour, index in INDICES:
        glass = tree.nodes.new("ShaderNodeBsdfGlass")
        glass.name = name
        glass.inputs["Color"].default_value = colour
        glass.inputs["IOR"].default_value = index
        glass.inputs["Roughness"].default_value = 0.0
        if total is None:
            total = glass.outputs[0]
            continue
        add = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(total, add.inputs[0])
        tree.links.new(glass.outputs[0], add.inputs[1])
        total = add.outputs[0]
    tree.links.new(total, tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _coat() -> bpy.types.Material:
    """A rough red under a mirror of blue."""
    material = new_material("coat")
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.8, 0.05, 0.02, 1)
    shader.inputs["Roughness"].default_value = 1.0
    metal = material.node_tree.nodes.new("ShaderNodeBsdfAnisotropic")
    metal.inputs["Color"].default_value = (0.02, 0.05, 1, 1)
    metal.inputs["Roughness"].default_value = 0.02
    mix = material.node_tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.4
    link = material.node_tree.links.new
    link(shader.outputs[0], mix.inputs[1])
    link(metal.outputs[0], mix.inputs[2])
    link(mix.outputs[0], material.node_tree.get_output_node("CYCLES").inputs["Surface"])
    return material


def scene(*, width: int = 320, height: int = 240) -> bpy.types.Scene:
    """The four spheres, of which two are left: one of prism glass, one with the coat."""
    out = scenes.four_spheres(width=width, height=height)
    for thing in list(out.objects):
        if thing.pass_index in (3, 4):
            bpy.data.objects.remove(thing)
        elif thing.pass_index in (1, 2):
            thing.data.materials.clear()
            thing.data.materials.append(_prism() if thing.pass_index == 1 else _coat())
    return out


def colour(path: Path, size: tuple[int, int], samples: int, many: int) -> list[dict[str, Any]]:
    """Shared and separate supports under three HDRIs, by material."""
    scenes.SCENES[SCENE], scenes.MATERIALS[SCENE] = scene, MATERIALS
    source = captured(SCENE, size, samples, patterns="moments", grain=True, adaptive=False)
    fields = {"shared": fitted(source, "box"), "separate": fitted(source, "box", separate=True)}
    rows = []
    for hdri in ("courtyard", "interior", "forest"):
        made, one, two = truth(SCENE, World(hdri), size, many)
        light = PatchLight(bake(made, made.arto.environment_width), source.hemicube)
        mean = (one.rgb + two.rgb) / 2
        for name, field in fields.items():
            picture = relight(field, light)[..., :3]
            for material, index in MATERIALS.items():
                seen = (one.alpha > 0.999) & (one.index == index)
                rows.append(
                    {
                        "hdri": hdri,
                        "material": material,
                        "supports": name,
                        "samples": samples,
                        "mean_relative_error": metrics.mean_relative_error(picture, mean, seen),
                        "noise_floor": metrics.mean_relative_error(one.rgb, two.rgb, seen),
                        "bytes_per_pixel": field.bytes_per_pixel(),
                    }
                )
    write_rows(path, rows)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: shared against separate, by HDRI and material."""
    lines = ["| HDRI | material | shared | separate | noise floor |", "|---|---|---|---|---|"]
    for one, two in zip(
        (r for r in rows if r["supports"] == "shared"),
        (r for r in rows if r["supports"] == "separate"),
        strict=True,
    ):
        lines.append(
            f"| {one['hdri']} | {one['material']} | {one['mean_relative_error']:.3f} | "
            f"{two['mean_relative_error']:.3f} | {one['noise_floor']:.3f} |"
        )
    return "\n".join(lines)
