"""The head of a field: what `field.json` says comes back, and what it cannot say is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from arto.core.capture.kinds import Route, Take
from arto.core.errors import FieldError
from arto.core.field import head as heads
from arto.core.field.about import About
from arto.core.field.head import FieldHead, FieldTile
from arto.core.field.writer import write_head
from arto.core.hemicube import Hemicube
from arto.core.region import Region
from arto.core.shot import Shot
from arto.core.signed import parsed

SHOT = Shot("Scene", 3, 64, 48, (1.0,) * 16, ("PERSP", 50.0), file="shot")
ABOUT = About(
    choice="auto",
    separate=False,
    scene="Scene",
    colour_space="Linear Rec.709",
    samples=64,
    file="shot",
    frame=3,
    view_layer="ViewLayer",
    far=True,
    key="abc",
    fingerprint={"Mesh 'a'": "1"},
    route=Route.SAMPLED,
    shot=SHOT,
    catchers=("Floor",),
    take=Take.GROUND,
    pair="def",
    behind=True,
    portals=False,
    guides="clean",
    fit_seconds=1.5,
    read_seconds=0.5,
    others={"machine": "a farm"},
)
SMALL = FieldTile("tile_0000.arto", Region(0, 0, 32, 24), {"box": 3})
TILE = FieldTile("tile_0000.arto", Region(0, 0, 64, 48), {"box": 7, "whole": 0}, {2: SMALL})
HEAD = FieldHead(Hemicube(patches=1), 48, 64, ABOUT, (TILE,), {"note": [1, 2]})


def test_a_head_comes_back(tmp_path: Path) -> None:
    write_head(tmp_path, HEAD)
    assert heads.read(tmp_path) == HEAD
    small = heads.read(tmp_path / "proxy_2")
    assert small == replace(
        HEAD, height=24, width=32, about=replace(ABOUT, proxy=2), tiles=(SMALL,)
    )
    empty = FieldHead(Hemicube(patches=1), 1, 1)
    write_head(tmp_path, empty)
    assert heads.read(tmp_path) == empty


def test_the_keys_on_disk_are_those_of_the_page(tmp_path: Path) -> None:
    """Programs of others read them, and so do fields of before."""
    write_head(tmp_path, HEAD)
    said = parsed((tmp_path / "field.json").read_text())
    assert said == {
        "format": "ARTO reflectance field",
        "version": 3,
        "height": 48,
        "width": 64,
        "hemicube": json.loads(json.dumps(Hemicube(patches=1).to_json())),
        "patches": 6,
        "about": {
            "choice": "auto",
            "separate": False,
            "scene": "Scene",
            "colour_space": "Linear Rec.709",
            "samples": 64,
            "file": "shot",
            "frame": 3,
            "view_layer": "ViewLayer",
            "far": True,
            "key": "abc",
            "fingerprint": {"Mesh 'a'": "1"},
            "route": "sampled",
            "shot": json.loads(json.dumps(SHOT.to_json())),
            "catchers": ["Floor"],
            "take": "ground",
            "pair": "def",
            "behind": True,
            "portals": False,
            "guides": "clean",
            "fit_seconds": 1.5,
            "read_seconds": 0.5,
            "machine": "a farm",
        },
        "note": [1, 2],
        "tiles": [
            {
                "file": "tile_0000.arto",
                "region": [0, 0, 64, 48],
                "entries": {"box": 7, "whole": 0},
                "proxies": {
                    "2": {"file": "tile_0000.arto", "region": [0, 0, 32, 24], "entries": {"box": 3}}
                },
            }
        ],
    }


def changed(path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    said = json.loads(json.dumps(HEAD.to_json()))
    where = said
    for key in path[:-1]:
        where = where[key]
    where[path[-1]] = value
    return said


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        (("about",), [], "'about'"),
        (("about", "samples"), -1, "'about.samples'"),
        (("about", "samples"), "64", "'about.samples'"),
        (("about", "separate"), 0, "'about.separate'"),
        (("about", "frame"), 1.5, "'about.frame'"),
        (("about", "frame"), 2**40, "'about.frame'"),
        (("about", "far"), "yes", "'about.far'"),
        (("about", "key"), 3, "'about.key'"),
        (("about", "scene"), "x" * 100_000, "'about.scene'"),
        (("about", "route"), "by road", "'about.route'"),
        (("about", "take"), "sky", "'about.take'"),
        (("about", "catchers"), "Floor", "'about.catchers'"),
        (("about", "catchers"), [3], "'about.catchers'"),
        (("about", "fingerprint"), {"a": 1}, "'about.fingerprint'"),
        (("about", "shot"), {"scene": "Scene"}, "'about.shot'"),
        (("about", "shot", "width"), "64", "'about.shot'"),
        (("about", "fit_seconds"), True, "'about.fit_seconds'"),
        (("about", "proxy"), 0, "'about.proxy'"),
        (("tiles", 0, "file"), "../tile.arto", "'file'"),
        (("tiles", 0, "file"), "tile", "'file'"),
        (("tiles", 0, "entries"), None, "'entries'"),
        (("tiles", 0, "entries"), {"box": 48 * 64 * 6 + 1}, "'box'"),
        (("tiles", 0, "proxies"), [], "'proxies'"),
        (("tiles", 0, "proxies"), {"x": {}}, "'proxies'"),
        (("tiles", 0, "proxies", "2"), 3, "'proxies.tiles'"),
        (("tiles", 0, "proxies", "2", "file"), "/a.arto", "'proxies.file'"),
        (("tiles", 0, "proxies", "2", "region"), [0, 0, 33, 24], "'proxies.region'"),
        (("tiles", 0, "proxies", "2", "entries"), {"box": -1}, "'proxies.box'"),
    ],
)
def test_what_a_head_cannot_say_is_named(path, value, named: str, tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="fit again") as e:
        heads.read(tmp_path, changed(path, value))
    assert named in str(e.value)
    assert heads.read(tmp_path, changed(("about", "samples"), 0)).about.samples == 0


def test_what_is_not_said_is_none(tmp_path: Path) -> None:
    """Null is as good as nothing: programs of before wrote both."""
    said = HEAD.to_json()
    for about in ({}, dict.fromkeys(said["about"]), None):
        assert heads.read(tmp_path, said | {"about": about}).about.to_json() in (
            {}, {"machine": None},
        )  # fmt: skip


def test_tiles_that_a_capture_set_describes(tmp_path: Path) -> None:
    """As captures whose images went are put together: each tile by its entry."""
    bare = replace(HEAD, tiles=())
    assert bare.with_tiles([TILE.to_json()], tmp_path) == HEAD
    before = {"folder": "tile_0000", "region": [0, 0, 64, 48], "entries": {}, "proxies": {}}
    (tile,) = bare.with_tiles([before], tmp_path).tiles
    assert tile == FieldTile("tile_0000", Region(0, 0, 64, 48), {})
    assert tile.to_json() == {k: v for k, v in before.items() if k != "proxies"}
    with pytest.raises(FieldError, match="'region'"):
        bare.with_tiles([before | {"region": [0, 0, 65, 48]}], tmp_path)
