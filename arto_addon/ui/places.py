"""Where ARTO's panels are: in the sidebars and in the render properties.

The sidebars are those of the 3D viewport, the image editor and the compositor.
"""

from __future__ import annotations

import textwrap

import bpy

from ..blender.words import tr

# Space, region, and the end of the names of the panels there.
SIDEBARS = (
    ("VIEW_3D", "UI", "view"),
    ("IMAGE_EDITOR", "UI", "image"),
    ("NODE_EDITOR", "UI", "nodes"),
)
TAB = "ARTO"
# Average width of a letter in Blender's interface, in pixels at a scale of 1, rather too wide.
_LETTER = 5.9


class Draws:
    """What the panels of one title share in all places: the title and `draw_column`."""

    label = ""
    closed = False

    @staticmethod
    def shown(context: bpy.types.Context) -> bool:
        return True

    @staticmethod
    def draw_column(column: bpy.types.UILayout, context: bpy.types.Context) -> None:
        raise NotImplementedError


def panels(name: str, draws: type[Draws], sidebar: bool = True, parent: str = "") -> list[type]:
    """The panel classes of one title, one for each place.

    sidebar: whether the panel is in the sidebars too; parent: the name of the enclosing panel.
    """
    places: list[tuple[str, str, str]] = [*SIDEBARS] if sidebar else []
    places.append(("PROPERTIES", "WINDOW", "render"))
    return [_panel(name, draws, *place, parent) for place in places]


def _panel(name: str, draws: type[Draws], space: str, region: str, end: str, parent: str) -> type:
    def poll(cls: type, context: bpy.types.Context) -> bool:
        if space == "NODE_EDITOR" and context.space_data.tree_type != "CompositorNodeTree":
            return False
        return draws.shown(context)

    def draw(self: bpy.types.Panel, context: bpy.types.Context) -> None:
        draws.draw_column(self.layout.column(), context)

    identifier = f"ARTO_PT_{name}_{end}"
    attributes: dict[str, object] = {
        "bl_label": draws.label,
        "bl_idname": identifier,
        "bl_space_type": space,
        "bl_region_type": region,
        "poll": classmethod(poll),
        "draw": draw,
        "__doc__": draws.__doc__,
    }
    if draws.closed:
        attributes["bl_options"] = {"DEFAULT_CLOSED"}
    if space == "PROPERTIES":
        attributes["bl_context"] = "render"
        attributes["bl_parent_id"] = f"ARTO_PT_{parent or 'main'}_{end}"
        if name == "main":
            del attributes["bl_parent_id"]
    else:
        attributes["bl_category"] = TAB
        if parent:
            attributes["bl_parent_id"] = f"ARTO_PT_{parent}_{end}"
    return type(identifier, (bpy.types.Panel,), attributes)


def say(
    column: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE"
) -> None:
    """Draw a sentence in as many lines as the region needs: Blender clips a long label."""
    letters = _letters(context, icon != "NONE")
    lines = column.column(align=True)
    lines.scale_y = 0.8
    text = tr(text)
    for i, line in enumerate(_lines(text, letters)):
        first = icon if i == 0 else ("NONE" if icon == "NONE" else "BLANK1")
        lines.label(text=line, icon=first, translate=False)


def sentence(text: str) -> str:
    """A text in the artist's language, beginning with a capital letter."""
    text = tr(text)
    return text[:1].upper() + text[1:]


def slot(
    column: bpy.types.UILayout,
    context: bpy.types.Context,
    text: str,
    icon: str = "NONE",
    lines: int = 2,
    whole: bool = False,
) -> None:
    """Draw a text in exactly so many lines, whatever its length: nothing below it ever moves.

    A longer text ends with dots. whole: give such a text a button that shows all of it.
    """
    row = column.row(align=True)
    body = row.column(align=True)
    body.scale_y = 0.8
    text = tr(text)
    letters = _letters(context, icon != "NONE") - (4 if whole else 0)
    found = _lines(text, letters)
    cut = len(found) > lines
    if cut:
        found = found[:lines]
        found[-1] = found[-1][: letters - 1].rstrip(" ,;:.") + "…"
    found += [""] * (lines - len(found))
    for i, line in enumerate(found):
        first = icon if i == 0 else ("NONE" if icon == "NONE" else "BLANK1")
        body.label(text=line or " ", icon=first, translate=False)
    if whole:
        # there also where nothing was cut: the text goes away once it was read
        row.operator("arto.read_message", text="", icon="X", emboss=False).text = text


def _lines(text: str, letters: int) -> list[str]:
    """Break a text into lines, also where the text has a new line.

    A text without blanks, as in Japanese, is broken anywhere, and its letters count twice.
    """
    wide = any(ord(c) > 0x2E80 for c in text)
    room = letters // 2 if wide else letters
    return [line for part in text.split("\n") for line in textwrap.wrap(part, room) or [""]]


def shortened(context: bpy.types.Context, text: str) -> str:
    """A text cut to one line, with dots where something was cut."""
    return textwrap.shorten(text[:1].upper() + text[1:], _letters(context), placeholder="…")


def _letters(context: bpy.types.Context, icon: bool = False) -> int:
    """How many letters a line of the region has room for."""
    scale = context.preferences.system.ui_scale
    room = (context.region.width if context.region else 300) / scale
    # less the room of the panel's frame, the scroll bar and an icon
    return max(12, int((room - 56 - (22 if icon else 0)) / _LETTER))
