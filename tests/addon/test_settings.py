"""What a capture changes is what the docs say; the panel says where a render looks otherwise."""

from __future__ import annotations

from pathlib import Path

import arto
from arto.arto_addon.blender.version import FIVE
from arto.arto_addon.stage.settings import CHANGES, looks_otherwise
from scene_tools import captured, small_scene

from bench.changes import page

DOCS = Path(arto.__file__).parent / "docs"


def test_the_page_is_made_of_the_table():
    assert (DOCS / "capture-changes.md").read_text(encoding="utf-8") == page()


def test_what_was_changed_is_in_the_table(tmp_path):
    scene = small_scene(tmp_path)
    changed = captured(scene).head.changed
    assert changed.keys() - {"world"} <= {c.setting for c in CHANGES}
    assert changed["cycles.sample_clamp_indirect"] == [10.0, 0.0]


def test_lines_for_settings_that_look_otherwise(tmp_path):
    scene = small_scene(tmp_path)
    assert looks_otherwise(scene) == ["Your render clamps at 10; the relit picture does not"]
    scene.cycles.sample_clamp_indirect = 0
    assert looks_otherwise(scene) == []
    scene.cycles.use_fast_gi = True
    scene.cycles.sample_clamp_direct = 2.5
    assert looks_otherwise(scene) == [
        "Your render clamps direct light at 2.5; the relit picture does not",
        "Your render uses Fast GI; the relit picture has all its bounces",
    ]
    strips = scene.sequence_editor_create().strips
    scene.render.use_stamp = True
    assert looks_otherwise(scene)[2:] == [
        "Your render burns metadata into the picture; the relit picture does not"
    ]
    length = {"length" if FIVE else "frame_end": 10}
    strip = strips.new_effect(name="A", type="COLOR", channel=1, frame_start=1, **length)
    assert "shows the sequencer" in looks_otherwise(scene)[3]
    strip.mute = True
    assert len(looks_otherwise(scene)) == 3
