"""A setting, and all that is known of it.

A `Setting` is the one source for the property on `scene.arto`, the option of the command line, the
entry in a farm's job, and the part of a key by which captures and plates are compared. This module
needs no Blender.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

# What a setting holds. choice: one of the setting's items; choices: any number of the items; image:
# an image of the .blend; list: entries that are made in the panels, see `ui.lists`.
Kind = Literal["switch", "whole", "number", "text", "choice", "choices", "image", "list"]
# The piece of work that reads a setting. hemicube: a capture, to build its hemicube; shot: all
# work, to find the shot's files.
Work = Literal["hemicube", "capture", "fit", "relight", "match", "shot"]
# Titles of the panels, see `ui.panels`.
Panel = Literal["Shot", "Light", "Result", "Match", "Quality", "Layers", "Storage", "Method"]
# Identifier, name, description.
Item = tuple[str, str, str]

# The largest numbers that Blender's properties hold.
_LARGEST = {"whole": 2**31 - 1, "number": 3.4e38}


class Decides(Enum):
    """Whether a new value of a setting makes a new capture or a new plate, and what the key has.

    Two captures, or two plates, are the same where their keys are equal.
    """

    NOTHING = "nothing"
    # The key of a capture has the value itself.
    CAPTURE = "capture"
    # The key of a capture has what is made of the value: hemicube, patterns, number of samples.
    CAPTURE_MADE = "capture, by what is made of it"
    # The value decides how the picture is cut into tiles.
    CAPTURE_TILES = "capture, by its tiles"
    # The value decides which basis images are kept.
    CAPTURE_KEPT = "capture, by what is kept of it"
    # The value counts unless `keep` is `always`: a field cannot be fitted again without its basis
    # images, so another fit needs another capture.
    CAPTURE_FIT = "capture, by its fit"
    # The key of a plate has the value itself.
    PLATE = "plate"
    # The key of a plate has what is made of the value: the gains of lamps, the places of groups,
    # the file of the footage.
    PLATE_MADE = "plate, by what is made of it"

    @property
    def of_capture(self) -> bool:
        """Whether a new value of the setting makes a new capture."""
        return self.name.startswith("CAPTURE")

    @property
    def of_plate(self) -> bool:
        """Whether a new value of the setting makes a new plate."""
        return self.name.startswith("PLATE")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A setting of a scene.

    Parameters
    ----------
    name
        The setting's identifier on `scene.arto` and in a farm's job. The command line's option is
        the name with dashes.
    kind
        What the setting holds.
    title, words
        The setting's name and description in the interface. The description is also the help of
        the command line's option.
    default
        The value in a new scene; None for images and lists.
    work
        The piece of work that reads the setting.
    decides
        Whether a new value makes a new capture or a new plate.
    farm
        Whether the setting goes to the machines of a farm.
    option
        Whether the command line has an option for the setting.
    panels
        The panels that show the setting.
    items
        The items of a choice, in the order of the menu. Artists' files store the place of an item
        in this order, so a new item goes to the end.
    least, most
        Bounds of a number; None where there is no bound.
    soft_least, soft_most
        Bounds of a number's slider; None for the bounds of the number.
    subtype
        Blender's subtype of the property, for units and paths.
    hidden
        Whether the interface never shows the setting.
    """

    name: str
    kind: Kind
    title: str = ""
    words: str = ""
    default: bool | float | str | tuple[str, ...] | None = None
    work: Work
    decides: Decides
    farm: bool
    option: bool
    panels: tuple[Panel, ...]
    items: tuple[Item, ...] = ()
    least: float | None = None
    most: float | None = None
    soft_least: float | None = None
    soft_most: float | None = None
    subtype: str = ""
    hidden: bool = False

    def can_be(self, value: object) -> bool:
        """Whether a value, as a description has it, is one that the setting can have.

        Several items of `choices` are a list. No description has an image or a list of entries.
        """
        if self.kind == "switch":
            return isinstance(value, bool)
        if self.kind == "text":
            return isinstance(value, str)
        items = {identifier for identifier, _, _ in self.items}
        if self.kind == "choice":
            return isinstance(value, str) and value in items
        if self.kind == "choices":
            return isinstance(value, list) and all(isinstance(x, str) and x in items for x in value)
        if self.kind not in _LARGEST or isinstance(value, bool):
            return False
        if not isinstance(value, int if self.kind == "whole" else int | float):
            return False
        least = -_LARGEST[self.kind] if self.least is None else self.least
        most = _LARGEST[self.kind] if self.most is None else self.most
        return least <= value <= most
