"""The types of ARTO's settings for pyright: `python -m tools.setting_types` writes them anew.

They are made of the table of settings, so that a setting is said once. A test tells where the file
is behind the table.
"""

from __future__ import annotations

from pathlib import Path

from arto.arto_addon.settings.setting import Setting
from arto.arto_addon.settings.table import SETTINGS

FILE = Path(__file__).parents[1] / "typings" / "arto_settings.pyi"
_HEAD = '''"""The settings on `scene.arto`, made of the table: `python -m tools.setting_types`."""

from typing import Any, Literal

from arto_lists import Groups, Lamps, Looks

'''
_KINDS = {"switch": "bool", "whole": "int", "number": "float", "text": "str", "image": "Any"}
_LISTS = {"looks": "Looks", "own_groups": "Lamps", "groups": "Groups"}


def _type(setting: Setting) -> str:
    if setting.kind == "list":
        return _LISTS[setting.name]
    if setting.kind in _KINDS:
        return _KINDS[setting.kind]
    items = ", ".join(f'"{identifier}"' for identifier, _, _ in setting.items)
    one = f"Literal[{items}]"
    return f"set[{one}]" if setting.kind == "choices" else one


def text() -> str:
    """What the file has to say.

    Returns
    -------
    str
    """
    lines = [f"    {setting.name}: {_type(setting)}" for setting in SETTINGS]
    return (
        _HEAD
        + "class Settings:\n"
        + "\n".join(lines)
        + "\n    bl_rna: Any\n    def is_property_set(self, name: str) -> bool: ...\n"
    )


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
