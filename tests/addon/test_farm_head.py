"""The heads of a farm's files: what cannot be is named, whichever value it is."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from arto.arto_addon.farm import head as heads
from arto.arto_addon.farm.head import HEADER, PART_HEADER, JobHead, Part, PartHead
from arto.core.errors import FarmError

LONG = "x" * 40_000
SETTINGS = {
    "patches": 4,
    "faces": ["top", "back"],
    "quality": "GOOD",
    "adaptive": True,
    "rotation": 0.5,
}
JOB: dict[str, Any] = {
    "format": "ARTO farm job",
    "version": 2,
    "blend": "shot.blend",
    "blender": "5.2.3 LTS",
    "scene": "Scene",
    "library": "//set.blend",
    "view_layer": "ViewLayer",
    "scripts": True,
    "settings": SETTINGS,
    "frames": [1, 2, 3],
    "subframe": 0.0,
    "catchers": [2],
    "tiles": 2,
    "seeds": 3,
    "parts": 30,
}
PART: dict[str, Any] = {
    "part": {"number": 7, "frame": 2, "tile": 1, "seed": 0, "take": "ground"},
    "key": "602ab0ab927ef099",
    "samples": 64,
    "fitted": {"file": "tile_0001.arto", "region": [0, 0, 8, 8], "entries": {}},
    "sums": {"part_0007_00.exr": 2**32 - 1},
    "files": ["part_0007_00.exr"],
    "seconds": 1.5,
}

# By the name of each value, what it cannot be. Every name of a head must be here.
OF_JOB: dict[str, list[Any]] = {
    "version": [None, 0, 3, "2", 2.5],
    "blend": [LONG, 3, []],
    "blender": [LONG, 5.2, {}],
    "scene": [LONG, 3, True],
    "library": [LONG, 3, []],
    "scripts": [0, 1, "yes"],
    "view_layer": [LONG, 3, [""]],
    "settings": [
        [],
        "many",
        SETTINGS | {"patches": 0},
        SETTINGS | {"patches": 17},
        SETTINGS | {"patches": True},
        SETTINGS | {"patches": 1.5},
        SETTINGS | {"faces": "top"},
        SETTINGS | {"faces": ["top", "roof"]},
        SETTINGS | {"faces": [[]]},
        SETTINGS | {"quality": "BEST"},
        SETTINGS | {"quality": []},
        SETTINGS | {"adaptive": 1},
        SETTINGS | {"rotation": "half"},
        SETTINGS | {"rotation": 10**400},
        SETTINGS | {"seed": 2**31},
        SETTINGS | {"folder": 3},
        SETTINGS | {"looks": []},
    ],
    "frames": [None, [], 1, [1.0], [True], [2**31], [[1]], [1, 1], {"1": 1}],
    "subframe": [-0.1, 1.1, "0", [], True],
    "catchers": [[4], ["2"], 2, [2, 2]],
    "tiles": [None, 0, -1, 2.0, "2", True, 10**7],
    "seeds": [None, 0, -1, 2.0, "2", True, 10**7],
    "parts": [29, "30", []],
}
OF_PART: dict[str, list[Any]] = {
    "part": [3, [], None],
    "key": [3, LONG, []],
    "samples": [None, 0, -1, 1.5, True, 2**60],
    "files": ["part.exr", [3], ["../part.exr"], ["a/b.exr"], ["nul.exr"], {"a": 1}],
    "seconds": [-1.0, 1e300, "long", 10**400, True],
    "fitted": [3, [], {}, {"file": "tile_0002.arto"}, {"file": "../x"}, {"file": {}}],
    "sums": [3, [], {"a.exr": -1}, {"a.exr": 2**32}, {"a.exr": "1"}, {"a.exr": True}],
    "device": [3, LONG, []],
}
OF_WHICH: dict[str, list[Any]] = {
    "number": [None, -1, 1.0, "7", True, 10**7],
    "frame": [None, 2**31, 1.0, "2", True],
    "tile": [None, -1, 1.0, "1", True, 10**7],
    "seed": [None, -1, 1.0, "0", True, 10**7],
    "take": ["sky", "Ground", 0, []],
}


def test_every_value_of_a_head_is_damaged_below() -> None:
    own = [{f.name for f in fields(kind)} - {"others"} for kind in (JobHead, PartHead, Part)]
    assert own == [OF_JOB.keys() - {"version", "parts"}, OF_PART.keys(), OF_WHICH.keys()]


def write(path: Path, said: dict[str, Any], name: str, value: Any) -> None:
    """None stands for a value that is missing."""
    kept = {n: v for n, v in said.items() if n != name}
    path.write_text(json.dumps(kept if value is None else said | {name: value}))


@pytest.mark.parametrize("name", OF_JOB)
def test_a_value_of_a_job_that_cannot_be_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / HEADER
    path.write_text(json.dumps(JOB))
    there = heads.read(tmp_path)
    assert there.parts == 30 and json.loads(json.dumps(there.to_json())) == JOB
    for value in OF_JOB[name]:
        write(path, JOB, name, value)
        with pytest.raises(FarmError, match=rf"'{name}.*plan again") as e:
            heads.read(tmp_path)
        assert str(path) in str(e.value)


@pytest.mark.parametrize("name", OF_PART)
def test_a_value_of_a_part_that_cannot_be_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / PART_HEADER
    path.write_text(json.dumps(PART))
    there = heads.read_part(tmp_path)
    assert there is not None and json.loads(json.dumps(there.to_json())) == PART
    for value in OF_PART[name]:
        write(path, PART, name, value)
        # what a part lacks, and which file has the wrong sum, is named more closely
        told = {"part": "(part|number)", "sums": "(sums|a.exr)"}.get(name, name)
        with pytest.raises(FarmError, match=rf"'{told}.*render that part again"):
            heads.read_part(tmp_path)


@pytest.mark.parametrize("name", OF_WHICH)
def test_what_a_part_is_must_be_of_a_job(tmp_path: Path, name: str) -> None:
    path = tmp_path / PART_HEADER
    for value in OF_WHICH[name]:
        write(path, PART["part"], name, value)
        path.write_text(json.dumps(PART | {"part": json.loads(path.read_text())}))
        with pytest.raises(FarmError, match=rf"{name}'.*render that part again"):
            heads.read_part(tmp_path)
