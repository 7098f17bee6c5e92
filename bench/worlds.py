"""Worlds that light the scenes: Blender's own HDRIs, the paper's right side, a clear sky with its
sun, a dark room with three softboxes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from .building import noded
from .made_worlds import MADE, angles

SKIES = {"sky10": 10.0, "sky35": 35.0, "sky70": 70.0}  # name -> the sun's height in degrees


@dataclass(frozen=True)
class World:
    """A world to light a scene with, by name, turned about the vertical."""

    name: str
    degrees: float = 0.0

    @property
    def label(self) -> str:
        return self.name + (f"+{self.degrees:g}" if self.degrees else "")

    def apply(self, scene: bpy.types.Scene) -> None:
        if self.name == "right":
            set_world_right(scene)
        elif self.name == "white":
            scene.world = noded(bpy.data.worlds.new("white"))
            background = scene.world.node_tree.nodes["Background"]
            background.inputs["Color"].default_value = (1, 1, 1, 1)
        elif self.name == "softboxes":
            _set_world(scene, _packed("softboxes", softbox_map()), self.degrees, 1.0)
        elif self.name in SKIES:
            image = _packed(self.name, sky_map(SKIES[self.name]))
            _set_world(scene, image, self.degrees, 1.0)
        elif self.name in MADE:
            _set_world(scene, _packed(self.name, MADE[self.name]()), self.degrees, 1.0)
        else:
            set_world_hdri(scene, self.name, rotation_degrees=self.degrees)


def world_names() -> list[str]:
    """Every world of the accuracy report: Blender's HDRIs, the skies, the dark room."""
    return [*hdri_names(), *SKIES, "softboxes"]


def hdri_names() -> list[str]:
    """Names of the environments that come with Blender (CC0, 1024x512), sorted."""
    return sorted(path.stem for path in _hdri_folder().glob("*.exr"))


def set_world_hdri(
    scene: bpy.types.Scene, name: str, *, rotation_degrees: float = 0.0, strength: float = 1.0
) -> bpy.types.World:
    """Light the scene with one of Blender's own environments, and return the world.

    `rotation_degrees` turns the light about +Z, counter-clockwise seen from above: at 90, what
    stood to the right (+X) stands at the back (+Y). (A Mapping node turns the direction that is
    looked up, hence its rotation is the negative.) Raises ValueError for a name that
    `hdri_names` lacks.
    """
    if name not in hdri_names():
        raise ValueError(f"No environment {name!r} comes with Blender; use one of {hdri_names()}.")
    image = bpy.data.images.load(str(_hdri_folder() / f"{name}.exr"), check_existing=True)
    return _set_world(scene, image, rotation_degrees, strength)


def set_world_right(scene: bpy.types.Scene, *, strength: float = 1.0) -> bpy.types.World:
    """Light the scene through the right-hand face of a cube only, and return the world.

    Source: Peers and Dutre 2002, section 7 (a light map on one side of the hemicube). The radiance
    is `right_light_map()`; the image is packed, so that a saved .blend keeps it.
    """
    return _set_world(scene, _packed("right", right_light_map()), 0.0, strength)


def right_light_map(height: int = 512) -> np.ndarray:
    """Equirectangular radiance (height, 2 * height, 3), float32, linear Rec.709, rows bottom-up.

    Soft sky light and two windows within x > |y|, x > |z|; black elsewhere. The outermost ring of
    pixels of the face is black too, so that interpolation brings no light out of the face: light
    beyond it would count as an error of the method. Convention of Cycles:
    u = 0.5 - atan2(y, x) / 2 pi, v = 0.5 + atan2(z, hypot(x, y)) / pi.
    """
    azimuth, elevation = angles(height)
    x = np.cos(elevation) * np.cos(azimuth)
    y = np.cos(elevation) * np.sin(azimuth)
    z = np.broadcast_to(np.sin(elevation), x.shape)
    inside = (x > np.abs(y)) & (x > np.abs(z))
    # No face pixel is near the edge of the image, so what roll wraps around is black.
    shifts = [(rows, columns) for rows in (-1, 0, 1) for columns in (-1, 0, 1)]
    inside = np.all([np.roll(inside, shift, (0, 1)) for shift in shifts], axis=0)
    across, up = (np.where(inside, c / np.where(inside, x, 1.0), 0.0) for c in (y, z))
    soft = np.exp(-1.5 * (across**2 + (up - 0.3) ** 2)) * (0.75 + 0.25 * np.sin(5.0 * up))
    light = 2.2 * soft[..., None] * np.array((0.85, 0.95, 1.1))
    windows = (
        ((-0.75, -0.15), (0.2, 0.85), (16.0, 14.0, 11.0)),
        ((0.3, 0.65), (-0.05, 0.5), (7.0, 9.0, 12.0)),
    )
    for (front, back), (low, high), radiance in windows:
        pane = (across > front) & (across < back) & (up > low) & (up < high)
        light[pane] = radiance
    return np.where(inside[..., None], light, 0.0).astype(np.float32)


def sky_map(elevation: float, height: int = 1024) -> np.ndarray:
    """A clear sky and its half-degree sun, `elevation` degrees high, front right of the scene.

    Equirectangular radiance (height, 2 * height, 3), float32, rows bottom-up. The sky has the shape
    of CIE's clear sky (bright horizon, brighter near the sun); below the horizon is the ground that
    it lights. The sun is redder the lower it stands, and brings five to nine times the sky's light.
    """
    azimuth, up = angles(height)
    sun_up, sun_azimuth = math.radians(elevation), math.radians(-50.0)
    cosine = np.sin(up) * math.sin(sun_up) + np.cos(up) * math.cos(sun_up) * np.cos(
        azimuth - sun_azimuth
    )
    apart = np.arccos(np.clip(cosine, -1, 1))
    above = np.maximum(np.sin(up), 0.02)
    glow = 0.91 + 10 * np.exp(-3 * apart) + 0.45 * cosine**2
    shape = glow * (1 - np.exp(-0.32 / above))
    haze = np.exp(-4 * above)[..., None]
    colour = (1 - haze) * (0.35, 0.6, 1.15) + haze * (0.85, 0.95, 1.05)
    light = 0.08 * shape[..., None] * colour
    ground = np.broadcast_to(up < 0, cosine.shape)
    light[ground] = (0.09, 0.08, 0.065)
    # the disc, covered in part by its rim's texels, keeps its energy at any size of the map
    radius, texel = math.radians(0.2665), math.pi / height
    finer = (np.arange(8) + 0.5) / 8 - 0.5
    cover = np.zeros(cosine.shape)
    near = np.nonzero(apart < radius + 2 * texel / math.cos(sun_up))
    fine_up = np.broadcast_to(up, cosine.shape)[near][:, None, None] + texel * finer[:, None]
    fine_azimuth = np.broadcast_to(azimuth, cosine.shape)[near][:, None, None] + texel * finer
    inside = np.sin(fine_up) * math.sin(sun_up) + np.cos(fine_up) * math.cos(sun_up) * np.cos(
        fine_azimuth - sun_azimuth
    ) > math.cos(radius)
    cover[near] = inside.mean(axis=(1, 2))
    air = 1 / (math.sin(sun_up) + 0.05)
    beam = 6.0 * np.exp(-air * np.array((0.05, 0.1, 0.2)))  # irradiance across the beam
    solid_angle = (cover * np.cos(up)).sum() * texel**2
    return (light + cover[..., None] * (beam / solid_angle)).astype(np.float32)


def softbox_map(height: int = 512) -> np.ndarray:
    """A dark room with three small softboxes of 5 to 8 degrees; shape and rows as `sky_map`."""
    azimuth, up = angles(height)
    shape = np.broadcast_shapes(azimuth.shape, up.shape)
    light = np.full((*shape, 3), 0.01)
    boxes = (
        # azimuth, height, half width, half height in degrees, radiance
        (-20.0, 40.0, 4.0, 2.5, (110.0, 100.0, 85.0)),
        (-150.0, 20.0, 2.5, 3.5, (60.0, 70.0, 95.0)),
        (75.0, 55.0, 3.0, 3.0, (70.0, 65.0, 60.0)),
    )
    for where, high, wide, tall, radiance in boxes:
        across = np.angle(np.exp(1j * (azimuth - math.radians(where)))) * math.cos(
            math.radians(high)
        )
        inside = (np.abs(across) < math.radians(wide)) & (
            np.abs(up - math.radians(high)) < math.radians(tall)
        )
        light[inside] = radiance
    return light.astype(np.float32)


def _packed(name: str, pixels: np.ndarray) -> bpy.types.Image:
    """An image of these pixels, packed, so that a saved .blend keeps it."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=False)
    image.colorspace_settings.name = "Linear Rec.709"
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image


def _hdri_folder() -> Path:
    """The folder of the environments that come with Blender."""
    return Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"


def _set_world(
    scene: bpy.types.Scene, image: bpy.types.Image, rotation_degrees: float, strength: float
) -> bpy.types.World:
    """Give the scene a new world that shows an equirectangular image."""
    world = noded(bpy.data.worlds.new(image.name))
    nodes, links = world.node_tree.nodes, world.node_tree.links
    background = nodes["Background"]
    background.inputs["Strength"].default_value = strength
    coordinates = nodes.new("ShaderNodeTexCoord")
    mapping = nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = -math.radians(rotation_degrees)
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])
    scene.world = world
    return world
