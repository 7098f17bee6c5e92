"""The settings on `scene.arto`: Blender properties made from `settings.table`."""

from __future__ import annotations

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

from ...core.capture.kinds import Quality
from ...core.faces import FACE_NAMES, PRESETS
from ..plate import compare
from ..plate.present import use
from ..relight import looks
from ..settings.setting import Setting
from ..settings.table import SETTINGS
from .lists import ENTRIES


class ArtoSettings(bpy.types.PropertyGroup):
    """What the artist may choose; capture, fit and relight read it."""


def _preset_chosen(self: ArtoSettings, context: bpy.types.Context) -> None:
    if self.preset in PRESETS:
        self["faces"] = sum(1 << FACE_NAMES.index(f) for f in PRESETS[self.preset])
        self["half_sides"] = self.preset == "paper"
        if self.preset == "paper":
            # the preset's half sides cannot be split in four
            self["adaptive"] = False


def _samples_chosen(self: ArtoSettings, context: bpy.types.Context) -> None:
    # the samples count only with this quality, which a script would not set besides
    self.quality = Quality.CUSTOM


def _use_chosen(self: ArtoSettings, context: bpy.types.Context) -> None:
    use(self.id_data)


def _look_chosen(self: ArtoSettings, context: bpy.types.Context) -> None:
    looks.show(self.id_data)


def _compare_chosen(self: ArtoSettings, context: bpy.types.Context) -> None:
    compare.update(self.id_data)


# What is called when a setting is set.
_FOLLOWS = {
    "preset": _preset_chosen,
    "samples": _samples_chosen,
    "use_in_compositor": _use_chosen,
    "compare": _compare_chosen,
    "wipe": _compare_chosen,
    "active_look": _look_chosen,
}
_PROPERTIES = {
    "switch": BoolProperty,
    "whole": IntProperty,
    "number": FloatProperty,
    "text": StringProperty,
    "choice": EnumProperty,
    "choices": EnumProperty,
    "image": PointerProperty,
    "list": CollectionProperty,
}


def _property(setting: Setting) -> object:
    """Make Blender's property for a setting."""
    facts: dict[str, object] = {
        "name": setting.title,
        "description": setting.words,
        "default": set(setting.default) if isinstance(setting.default, tuple) else setting.default,
        "min": setting.least,
        "max": setting.most,
        "soft_min": setting.soft_least,
        "soft_max": setting.soft_most,
        "subtype": setting.subtype,
        "update": _FOLLOWS.get(setting.name),
    }
    if setting.kind == "choice":
        facts["items"] = list(setting.items)
    elif setting.kind == "choices":
        facts["items"] = [(*item, 1 << i) for i, item in enumerate(setting.items)]
        facts["options"] = {"ENUM_FLAG"}
    elif setting.kind == "image":
        facts["type"] = bpy.types.Image
    elif setting.kind == "list":
        facts["type"] = ENTRIES[setting.name]
    if setting.subtype.endswith("_PATH"):
        facts["options"] = {"PATH_SUPPORTS_BLEND_RELATIVE"}
    if setting.hidden:
        facts["options"] = {"HIDDEN"}
    said = {name: fact for name, fact in facts.items() if fact is not None and fact != ""}
    return _PROPERTIES[setting.kind](**said)


ArtoSettings.__annotations__ = {setting.name: _property(setting) for setting in SETTINGS}

CLASSES = (*ENTRIES.values(), ArtoSettings)


def register() -> None:
    bpy.types.Scene.arto = PointerProperty(type=ArtoSettings)


def unregister() -> None:
    del bpy.types.Scene.arto
