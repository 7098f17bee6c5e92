"""A part of the sweep over all settings, and a case of the field, as `bench` does them."""

from __future__ import annotations

import json
from pathlib import Path

from bench import settings
from bench.field import one
from bench.field_cases import CASES


def test_settings_drawn_at_random_are_right() -> None:
    """Of every property that Blender has, some: each as Cycles has it, or refused in words."""
    rows = list(settings.settings(part=0.01, seed=1))
    # motion blur, adaptive sampling, culling, colour management, a panorama
    assert len(rows) > 3
    assert not [r for r in rows if r["status"] == "wrong"], rows


def test_what_differs_on_purpose_is_said_in_the_docs() -> None:
    page = (Path(__file__).parents[1] / "docs" / "settings.md").read_text(encoding="utf-8")
    for (owner, name), why in settings.ON_PURPOSE.items():
        assert f"| {owner} | {name} | {why} |" in page


def test_a_region_between_pixels_is_right() -> None:
    row = one("render region")
    assert row["status"] == "right", json.dumps(row)


def test_every_scene_of_the_field_is_in_the_docs() -> None:
    page = (Path(__file__).parents[1] / "docs" / "scenes.md").read_text(encoding="utf-8")
    assert not [name for name in CASES if f"| {name} |" not in page]
