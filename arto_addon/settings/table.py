"""The table of all settings of a scene, and functions that pick some of them."""

from __future__ import annotations

from typing import Any

from .of_capture import CAPTURE, FIT, HEMICUBE
from .of_match import MATCH
from .of_relight import FILES, LIGHT
from .of_window import SHOWN
from .setting import Decides, Panel, Setting, Work

SHOT = (
    Setting(
        name="folder",
        kind="text",
        title="Folder",
        words="Where capture sets and fields are kept, in folders named after file, scene, "
        "camera and frame",
        subtype="DIR_PATH",
        default="//arto/",
        work="shot",
        decides=Decides.NOTHING,
        farm=False,
        # Every verb of the command line has an option for the folder already.
        option=False,
        panels=("Storage",),
    ),
    Setting(
        name="scene_id",
        kind="text",
        title="Scene ID",
        words="By which what was captured of this scene is found when it or its file is renamed",
        default="",
        hidden=True,
        work="shot",
        decides=Decides.NOTHING,
        farm=False,
        option=False,
        panels=(),
    ),
    Setting(
        name="photographs",
        kind="text",
        title="Photographs",
        words="The folder of the photographs that this scene is of; empty for any other scene",
        default="",
        hidden=True,
        work="shot",
        decides=Decides.NOTHING,
        farm=False,
        option=False,
        panels=(),
    ),
    Setting(
        name="alone",
        kind="text",
        title="Alone",
        words="The Scene ID, where the scene was the file's only one when it got its ID. The names "
        "of its plates then do not tell the scene, also beside scenes that come later",
        default="",
        hidden=True,
        work="shot",
        decides=Decides.NOTHING,
        farm=False,
        option=False,
        panels=(),
    ),
)
# This order is the order of the command line's options, and of the settings in a farm's job.
SETTINGS = (*HEMICUBE, *CAPTURE, *FIT, *LIGHT, *FILES, *SHOWN, *MATCH, *SHOT)
# The settings that a capture on a farm reads, for its renders, its fit and the denoising of its
# guides. Paths on a machine are not among them. Setting the preset also sets the faces, and setting
# the samples also sets the quality. So the preset and the samples come before what they set.
FARM = tuple(s.name for s in SETTINGS if s.farm)


def options(*work: Work) -> tuple[Setting, ...]:
    """List the settings of some pieces of work that have an option on the command line."""
    return tuple(s for s in SETTINGS if s.option and s.work in work)


def in_panel(panel: Panel, work: Work) -> tuple[str, ...]:
    """List the names of a piece of work's settings that a panel shows."""
    return tuple(s.name for s in SETTINGS if panel in s.panels and s.work == work)


def values(of: object, decides: Decides) -> dict[str, Any]:
    """Read the values of all settings whose `decides` is the given one.

    Parameters
    ----------
    of
        `scene.arto`, or an object with the same attributes.
    decides
        What a new value of the setting makes new.

    Returns
    -------
    dict
        The values by the settings' names, in the order of the table.
    """
    return {s.name: getattr(of, s.name) for s in SETTINGS if s.decides is decides}
