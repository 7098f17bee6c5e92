"""Settings of a capture and its fit: patches, patterns, samples, where it is kept."""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...core.fit.choice import CHOICES
from ...core.hemicube import FACE_NAMES, PRESETS
from ...core.patterns import PATTERN_SETS

_PATTERN_TEXT = {
    "moments": ("1, u, u², v, v²", "Five patterns that identify a box"),
    "moments_uv": ("1, u, u², v, v², uv", "Six patterns that also show a tilt"),
    "linear": ("1, u, v", "Three patterns that show where in a patch the light comes from"),
    "paper": ("Paper's nine", "White, four diagonal gradients and their inverses"),
    "white": ("White only", "One pattern: a reflection coefficient and no support"),
}
_SUPPORT_TEXT = {
    "auto": ("Automatic", "The smallest model that explains each pixel and patch"),
    "whole": ("Whole Patch", "Every direction of a patch counts the same (Light Stage)"),
    "linear": ("Linear", "The light taken as a plane over each patch"),
    "box": ("Box", "The paper's axis-aligned rectangle, in closed form"),
    "quadratic": ("Quadratic", "The light taken as a paraboloid over each patch"),
    "oriented_box": ("Oriented Box", "A tilted rectangle; needs the pattern uv"),
    "gaussian": ("Gaussian", "A tilted elliptical Gaussian; needs the pattern uv"),
    "double": ("Two Components", "A broad base and a narrow box; needs the pattern uv"),
    "search": ("Paper's Search", "The box by the paper's Algorithm 1; slow"),
    "stage_and_matte": ("Light Stage and Matte", "A box in the brightest patch, whole the others"),
}


def _title(name: str) -> str:
    return name.replace("_", " ").title()


# Made here: within an annotation a comprehension sees no name of this module before Python 3.12.
_PATTERNS = [(n, *_PATTERN_TEXT.get(n, (_title(n), ""))) for n in PATTERN_SETS]
_SUPPORTS = [(n, *_SUPPORT_TEXT.get(n, (_title(n), ""))) for n in CHOICES]


def _preset_chosen(self: CaptureSettings, context: bpy.types.Context) -> None:
    if self.preset in PRESETS:
        self["faces"] = sum(1 << FACE_NAMES.index(f) for f in PRESETS[self.preset])
        self["half_sides"] = self.preset == "paper"
        if self.preset == "paper":
            # half a side cannot be split in four
            self["adaptive"] = False


def _samples_chosen(self: CaptureSettings, context: bpy.types.Context) -> None:
    # who says how many samples wants these: scripts say nothing else
    self.quality = "CUSTOM"


class CaptureSettings:
    """What capture and fit read."""

    preset: EnumProperty(
        name="Preset",
        description="Which directions the light comes from",
        items=[
            ("full", "Full Cube", "Six faces: any HDRI, whole"),
            ("paper", "Paper's Monitors", "Top, left, right and back, above the horizon"),
            ("custom", "Custom", "Choose the faces"),
        ],
        default="full",
        update=_preset_chosen,
    )
    faces: EnumProperty(
        name="Faces",
        description="Faces of the hemicube that carry patches; the camera looks towards Back",
        items=[(f, f.title(), f"The {f} face", 1 << i) for i, f in enumerate(FACE_NAMES)],
        options={"ENUM_FLAG"},
        default=set(FACE_NAMES),
    )
    patches: IntProperty(
        name="Patches",
        description="Patches along the edge of a face (the paper: 4). More see finer light, "
        "and each is noisier",
        min=1,
        max=16,
        default=4,
    )
    adaptive: BoolProperty(
        name="Adaptive Patches",
        description="Probe the scene first, split the patches where it tells directions apart, "
        "and join them where it does not. Off: a regular grid",
        default=True,
    )
    half_sides: BoolProperty(
        name="Half Height",
        description="The four sides only above the horizon",
        default=False,
    )
    align: EnumProperty(
        name="Align",
        description="Where the hemicube's Back is",
        items=[
            ("world", "World", "Along the world's Y axis"),
            ("camera", "Camera", "Where the camera looks, level"),
        ],
        default="world",
    )
    rotation: FloatProperty(
        name="Rotation",
        description="Turn of the hemicube about the vertical, on top of Align",
        subtype="ANGLE",
        soft_min=-math.pi,
        soft_max=math.pi,
        default=0.0,
    )
    far: BoolProperty(
        name="Far Away",
        description="1,000 times the scene's radius: the light is as good as infinitely far, "
        "like an HDRI. Off: a real set of monitors of the given size",
        default=True,
    )
    size: FloatProperty(
        name="Size",
        description="Distance from the centre to a face, where the hemicube is not far away",
        subtype="DISTANCE",
        min=1e-4,
        default=10.0,
    )
    patterns: EnumProperty(
        name="Patterns",
        description="What the patches show",
        items=_PATTERNS,
        default="linear",
    )
    route: EnumProperty(
        name="Renders",
        description="How the patches and patterns are told apart",
        items=[
            ("all", "All at Once", "All patches and patterns in one render, by light groups"),
            ("pattern", "One a Pattern", "A light group for each patch"),
            ("single", "One a Patch and Pattern", "As in the paper; slow"),
        ],
        default="all",
    )
    grain: BoolProperty(
        name="Capture Noise",
        description="One more pattern that shows how noisy each patch's light is, so that the fit "
        "does not take noise for narrow reflections",
        default=False,
    )
    quality: EnumProperty(
        name="Quality",
        description="Samples of the capture, as a multiple of the scene's own (of no more than 256 "
        "where it has a noise threshold). Their noise is the main error of the relit picture",
        items=[
            ("DRAFT", "Draft", "A quarter of the scene's own samples"),
            ("GOOD", "Good", "As many samples as the scene's own"),
            ("FINAL", "Final", "Four times the scene's own samples"),
            ("CUSTOM", "Custom", "A number of samples of your own"),
        ],
        default="GOOD",
    )
    samples: IntProperty(
        name="Samples",
        description="Samples of the capture where its quality is Custom",
        min=1,
        max=1 << 20,
        default=128,
        update=_samples_chosen,
    )
    seed: IntProperty(name="Seed", description="Seed of the capture's noise", min=0, default=0)
    memory: IntProperty(
        name="Memory (MB)",
        description="Megabytes that capturing and fitting may take beside Blender and the scene; a "
        "larger picture is captured in tiles. 0: a sixth of the machine's memory",
        min=0,
        default=0,
    )
    keep: EnumProperty(
        name="Keep Basis Images",
        description="Whether what was rendered stays on disk once it is fitted",
        items=[
            ("never", "Never", "Each tile is fitted as it comes; the field is all that stays"),
            ("fits", "If They Fit", "Keep them where they take no more than the limit"),
            ("always", "Always", "Keep them: Fit is a step of its own, with any support"),
        ],
        default="never",
    )
    keep_limit: FloatProperty(
        name="Limit (GB)",
        description="Gigabytes of basis images that are kept where they fit",
        min=0.0,
        soft_max=1000.0,
        default=4.0,
    )
    support: EnumProperty(
        name="Support",
        description="How the light within a patch is filtered",
        items=_SUPPORTS,
        default="auto",
    )
    separate: BoolProperty(
        name="Per Channel",
        description="A support for each of red, green and blue: for dispersion and coloured coats",
        default=False,
    )
    folder: StringProperty(
        name="Folder",
        description="Where capture sets and fields are kept, in folders named after file, scene, "
        "camera and frame",
        subtype="DIR_PATH",
        default="//arto/",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
