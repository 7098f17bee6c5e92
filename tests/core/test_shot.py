"""A shot's folder is safe on every system, and no two shots come to be one."""

from __future__ import annotations

import dataclasses
import json

import pytest
from arto.core.errors import ShotError
from arto.core.file_names import safe_name
from arto.core.shot import Shot
from hypothesis import given
from hypothesis import strategies as st

SHOT = Shot(
    scene="Scene",
    frame=12,
    width=64,
    height=48,
    camera_matrix=tuple(map(float, range(16))),
    lens=("PERSP", 50.0),
    file="shot",
    scene_id="a",
    view_layer="ViewLayer",
    camera="Camera",
    subframe=0.0,
    region=(0, 0, 64, 48),
    colour_space="Linear Rec.709",
)
RESERVED = ("con", "CON", "nul.txt", "Com1", "LPT9.a.b", "aux ", "prn.")


@given(st.text(max_size=300))
def test_any_text_is_a_name_that_every_system_takes(text: str) -> None:
    name = safe_name(text)
    assert name and name not in (".", "..")
    assert not set(name) & set('<>:"/\\|?*{}#%') and min(map(ord, name)) >= 32
    assert name[-1] not in ". " and name[0] != " "
    assert len(name.encode("utf-8", "surrogatepass")) <= 60
    assert name.split(".")[0].rstrip().upper() not in {"CON", "PRN", "AUX", "NUL", "COM1", "LPT9"}


@given(st.text(max_size=80), st.text(max_size=80))
def test_two_texts_are_two_names(one: str, other: str) -> None:
    assert (safe_name(one) == safe_name(other)) == (one == other)


@pytest.mark.parametrize(
    "text", [*RESERVED, "..", "", "a/b", "a.", "tail ", "x" * 200, "{a}", "a~b"]
)
def test_what_is_unsafe_is_marked(text: str) -> None:
    assert "~" in safe_name(text) and safe_name(text) != text


@pytest.mark.parametrize("text", ["Scene", "shot 010.v2", "Küche", "シーン", "a-b_c"])
def test_what_is_safe_stays(text: str) -> None:
    assert safe_name(text) == text


def test_it_comes_back_from_its_description() -> None:
    assert Shot.from_json(json.loads(json.dumps(SHOT.to_json()))) == SHOT


def test_the_version_before_is_read() -> None:
    """It had the camera's matrix by another name, and knew neither file nor ID."""
    old = {"scene": "Scene", "frame": 12, "width": 64, "height": 48}
    old |= {"camera": list(SHOT.camera_matrix), "lens": ["PERSP", 50.0]}
    assert Shot.from_json(old).difference(SHOT) is None
    assert "another frame (12, now 13)" in str(
        Shot.from_json(old).difference(dataclasses.replace(SHOT, frame=13))
    )


WRONG = ({"frame": "1"}, {"width": True}, {"lens": 3}, {"scene": 3}, {"scene_id": []})


@pytest.mark.parametrize(
    "data", [None, [], 3, "x", {}, *({**SHOT.to_json(), **wrong} for wrong in WRONG)]
)
def test_what_is_no_shot_is_said(data: object) -> None:
    with pytest.raises(ShotError):
        Shot.from_json(data)


@pytest.mark.parametrize(
    ("field", "value", "word"),
    [
        ("scene_id", "b", "scene"),
        ("view_layer", "Other", "view layer"),
        ("width", 65, "width"),
        ("frame", 13, "frame"),
        ("subframe", 0.5, "subframe"),
        ("colour_space", "ACEScg", "working colour space"),
        ("camera_matrix", (0.0,) * 16, "camera"),
        ("lens", ("PERSP", 35.0), "lens"),
    ],
)
def test_another_shot_is_told(field: str, value: object, word: str) -> None:
    now = dataclasses.replace(SHOT, **{field: value})
    assert SHOT.difference(SHOT) is None
    assert f"another {word}" in str(SHOT.difference(now))


def test_names_are_no_difference() -> None:
    now = dataclasses.replace(SHOT, file="shot_v2", scene="Renamed", camera="Cam")
    assert SHOT.difference(now) is None
    assert SHOT.is_place_of(now)  # a camera by another name is the same one
    assert not SHOT.is_place_of(dataclasses.replace(now, lens=("PERSP", 35.0)))


# what a file of anybody may say, of which Python makes errors of many kinds
ODD = [-1, 1e400, float("nan"), 10**400, 1e308, True, None, "x", [], {}, [[]], [10**400] * 16,
       ["x"] * 16, "\ud800", 2**63]  # fmt: skip


@pytest.mark.parametrize("name", SHOT.to_json())
def test_a_value_that_cannot_be_is_said_or_used(name: str) -> None:
    for value in ODD:
        try:
            found = Shot.from_json(json.loads(json.dumps(SHOT.to_json() | {name: value})))
        except ShotError:
            continue
        told = found.title, found.folders, found.mark, found.difference(SHOT)
        assert told and isinstance(found.is_place_of(SHOT), bool)
