"""All settings of a scene, and what is asked of them."""

from __future__ import annotations

from typing import Any

from .of_capture import CAPTURE, FIT, HEMICUBE
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
        # every verb has it, beside the scene's name
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
)
# The order of the command line's options, and of the settings in a farm's job.
SETTINGS = (*HEMICUBE, *CAPTURE, *FIT, *LIGHT, *FILES, *SHOWN, *SHOT)
# What of the settings a capture on a farm reads, its fit and the denoising of its guides; not where
# files are on a machine. A preset sets faces, and samples the quality: they come before what they
# set.
FARM = tuple(s.name for s in SETTINGS if s.farm)


def options(*work: Work) -> tuple[Setting, ...]:
    """The settings of pieces of work that the command line has an option for."""
    return tuple(s for s in SETTINGS if s.option and s.work in work)


def in_panel(panel: Panel, work: Work) -> tuple[str, ...]:
    """The names of the settings of a piece of work that stand in a panel."""
    return tuple(s.name for s in SETTINGS if panel in s.panels and s.work == work)


def values(of: Any, decides: Decides) -> dict[str, Any]:
    """The values of the settings that decide in one way.

    Parameters
    ----------
    of
        `scene.arto`, or what has its attributes.
    decides
        The way.

    Returns
    -------
    dict
        Value by name, in the order of the table.
    """
    return {s.name: getattr(of, s.name) for s in SETTINGS if s.decides is decides}
