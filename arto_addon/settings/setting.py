"""A setting, and all that is known of it.

The properties on `scene.arto`, the options of the command line, a farm's job, and the keys by which
captures and plates are compared are made of what a `Setting` says. It needs no Blender.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

# What a setting holds. choice: one of its items; choices: any number of them; image: an image of
# the file; list: entries that are made in the panels, see `ui.lists`.
Kind = Literal["switch", "whole", "number", "text", "choice", "choices", "image", "list"]
# The piece of work that reads it. hemicube: a capture, to build its hemicube; shot: all work, to
# find the shot's files.
Work = Literal["hemicube", "capture", "fit", "relight", "shot"]
# Titles of the panels, see `ui.panels`.
Panel = Literal["Shot", "Light", "Result", "Quality", "Layers", "Storage", "Method"]
# Identifier, name, description.
Item = tuple[str, str, str]


class Decides(Enum):
    """What is another one when the value of a setting is another one, and how its key says so."""

    NOTHING = "nothing"
    # The key of a capture has the value itself.
    CAPTURE = "capture"
    # The key of a capture has what is made of the value: hemicube, patterns, number of samples.
    CAPTURE_MADE = "capture, by what is made of it"
    # The value says how the picture is cut into tiles.
    CAPTURE_TILES = "capture, by its tiles"
    # The value says which basis images are kept.
    CAPTURE_KEPT = "capture, by what is kept of it"
    # The value decides where the basis images need not be kept: the fit is then all that stays.
    CAPTURE_FIT = "capture, by its fit"
    # The key of a plate's light has the value itself.
    PLATE = "plate"
    # The key of a plate's light has what is made of the value: the gains of lamps.
    PLATE_MADE = "plate, by what is made of it"

    @property
    def of_capture(self) -> bool:
        """Whether captures under two values are two captures."""
        return self.name.startswith("CAPTURE")

    @property
    def of_plate(self) -> bool:
        """Whether plates under two values are two plates."""
        return self.name.startswith("PLATE")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A setting of a scene.

    Parameters
    ----------
    name
        Its identifier on `scene.arto` and in a farm's job. The command line's option is the name
        with dashes.
    kind
        What it holds.
    title, words
        Its name and its description in the interface. The description is also the option's help.
    default
        Its value in a new scene; None for images and lists.
    work
        The piece of work that reads it.
    decides
        Whether two captures, or two plates, are the same where the setting is not.
    farm
        Whether it goes to the machines of a farm.
    option
        Whether the command line has an option for it.
    panels
        The panels in which it stands.
    items
        Of a choice, in the order of the menu. Their places are in artists' files: a new one goes to
        the end.
    least, most
        Bounds of a number; None for none.
    soft_least, soft_most
        Bounds of a number's slider; None for the bounds of the number.
    subtype
        Blender's, for units and paths.
    hidden
        Whether it is nothing to be shown.
    """

    name: str
    kind: Kind
    title: str = ""
    words: str = ""
    default: Any = None
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
