"""Which patterns a capture shows where the artist leaves that to it."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest
from arto.arto_addon.capture.patterns import patterns_of
from arto.core.capture.kinds import Route
from arto.core.fit.choice import CHOICES
from arto.core.fit.choice import check as check_choice
from arto.core.patterns import PATTERN_SETS, LobedSet


def settings(patterns: str = "auto", support: str = "auto", **other: object) -> SimpleNamespace:
    return SimpleNamespace(
        **{"patterns": patterns, "support": support, "route": "all", "separate": False, **other}
    )


def test_a_new_scene_leaves_it_to_the_capture() -> None:
    assert bpy.data.scenes.new("new").arto.patterns == "auto"


def test_lobes_wherever_they_can_be_told_apart() -> None:
    assert isinstance(patterns_of(settings()), LobedSet)
    # shadow rays know no lobes; renders of their own have other paths; a channel has no lobes
    for route in (Route.SAMPLED, Route.PATTERN, Route.SINGLE):
        assert patterns_of(settings(), route).name == "linear"
        assert patterns_of(settings(route=route)).name == "linear"
    assert patterns_of(settings(separate=True)).name == "linear"


@pytest.mark.parametrize("choice", CHOICES)
def test_a_model_by_name_gets_what_tells_it(choice: str) -> None:
    """No pattern is missing, and no set of fewer patterns would do."""
    found = patterns_of(settings(support=choice))
    check_choice(choice, found, False)
    if choice in ("whole", "linear", "box", "gaussian"):
        assert len(found) == {"whole": 1, "linear": 3, "box": 5, "gaussian": 6}[choice]


@pytest.mark.parametrize("name", PATTERN_SETS)
def test_patterns_that_were_chosen_are_shown(name: str) -> None:
    assert patterns_of(settings(name, "box")).name == name
