"""What the panel says is there, against what is."""

from __future__ import annotations

import json
import os
import re
import time

import bpy
from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.shot import paths, status, watch
from arto.core.signed import parsed
from scene_tools import captured, small_scene


def test_lines_follow_the_files(tmp_path):
    scene = small_scene(tmp_path)
    assert status.capture_line(scene) is None and status.field_line(scene) is None
    there = captured(scene)
    folder, patches = there.folder, len(there.hemicube)
    expected = (f"{patches} patches, {scene.arto.samples} samples", True)
    assert status.capture_line(scene) == expected
    assert status.field_line(scene) is None
    work.run(fit.fit(scene))
    assert status.field_line(scene) == (f"{patches} patches, auto", True)
    # another shot, and back
    scene.frame_set(7)
    other = ("is of another frame (1, now 7): capture again", False)
    assert status.capture_line(scene) == other
    assert status.field_line(scene) is None
    scene.frame_set(1)
    assert status.capture_line(scene) == expected
    # captured anew since it was fitted
    scene.arto.seed += 1
    captured(scene)
    assert status.field_line(scene) == ("of an earlier capture: fit again", False)
    # a capture that was stopped, and no other
    stopped = folder.with_name("unfinished-12345678")
    folder.rename(stopped)
    head = stopped / "capture.json"
    text = head.read_text().replace('"done": true', '"done": false')
    head.write_text(json.dumps(parsed(text.rpartition(",")[0] + "}")))
    assert status.capture_line(scene) == ("unfinished, 0 of 1 tiles", False)
    # damaged: the rest of the panel must be drawn
    stopped.rename(folder)
    head, later = folder / "capture.json", time.time_ns()
    again = ("damaged, or of another version: capture again", False)
    for text in ("{", "[]", "3", "null", '{"tiles": null}', '{"version": 1, "tiles": [3]}'):
        head.write_text(text)
        later += 10**9
        os.utime(head, ns=(later, later))
        assert status.capture_line(scene) == again
    os.utime(head, ns=(0, 0))
    assert status.capture_line(scene) == again


def test_what_another_version_left_is_said(tmp_path):
    scene = small_scene(tmp_path)
    there = captured(scene)
    work.run(fit.fit(scene))
    for path in (there.folder / "capture.json", paths.field_folder(scene) / "field.json"):
        path.write_text(re.sub(r'"version": \d', '"version": 99', path.read_text()))
    text, serves = status.capture_line(scene) or ("", True)
    assert "of another version: capture again" in text and not serves
    text, serves = status.field_line(scene) or ("", True)
    assert "of another version: fit again" in text and not serves


def test_a_description_without_its_shot_is_taken_as_it_is(tmp_path):
    """Of a capture set that another program wrote, nobody can say of which shot it is."""
    scene = small_scene(tmp_path)
    path = captured(scene).folder / "capture.json"
    path.write_text(json.dumps({**parsed(path.read_text()), "shot": None}))
    assert status.capture_line(scene) == ("6 patches, 64 samples", True)


def test_a_file_that_was_never_saved(tmp_path):
    scene = small_scene(tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.arto.folder = "//arto/"
    assert status.capture_line(scene) is None and status.field_line(scene) is None


def test_an_equal_fingerprint_is_not_looked_at_again(tmp_path):
    """Each look redraws the panels, and each panel asks: a look for every question has no end."""
    scene = small_scene(tmp_path)
    for then, stale in (("a", True), ("a", False), ("b", True)):
        watch._stale.clear()
        watch.latest(scene, "ViewLayer", {"Object 'Floor'": then}, now=False)
        assert bool(watch._stale) == stale


def _looked() -> None:
    """Do what the window's timer does, to its end."""
    while watch._look() is not None:
        pass


def test_two_states_that_are_compared_with_come_to_rest(tmp_path):
    """A field and a capture that was stopped may be of two states of a scene. The panels ask for
    both at each drawing, and a look ends in a drawing: both answers are there, and nothing is
    looked at again."""
    scene = small_scene(tmp_path)
    watch.unregister()
    both = {"Object 'Floor'": "a"}, {"Object 'Floor'": "b"}
    for then in both:
        assert watch.latest(scene, "ViewLayer", then, now=False) is None
    _looked()
    found = [watch.latest(scene, "ViewLayer", then, now=False) for then in both]
    assert all(found) and not watch._stale
    # a change makes both anew, but what nobody asks for any more is forgotten
    watch._stale.update(watch._asked)
    _looked()
    assert len(watch._latest) == 2
    watch.latest(scene, "ViewLayer", both[0], now=False)
    watch._stale.update(watch._asked)
    _looked()
    assert len(watch._asked) == len(watch._latest) == 1
    watch.unregister()
