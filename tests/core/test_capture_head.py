"""The head of a capture set: what files have comes back as it was, and what cannot be is named."""

from __future__ import annotations

import copy
import json
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path
from typing import Any

import pytest
from arto.core import signed
from arto.core.capture import head as heads
from arto.core.capture.agreement import Caution
from arto.core.capture.capture_set import CaptureSet
from arto.core.capture.head import HEADER, CaptureHead
from arto.core.capture.kinds import Keep, Quality, Route, Take
from arto.core.capture.tile_entry import SeedEntry, TileEntry
from arto.core.errors import CaptureSetError
from arto.core.region import Region
from arto.core.signed import parsed

ENTRY = {"folder": "tile_0000", "region": [0, 0, 24, 6], "entries": {"linear": 112, "box": 6}}
ENTRY |= {"proxies": {"2": {"folder": "tile_0000", "region": [0, 0, 12, 3], "entries": {"box": 4}}}}
# As ARTO wrote it before its heads had types, in this order.
WRITTEN: dict[str, Any] = {
    "format": "ARTO capture set",
    "version": 1,
    "height": 18,
    "width": 24,
    "hemicube": {
        "faces": ["top", "left", "right", "back", "front", "bottom"],
        "patches": 1,
        "half_sides": False,
        "orientation": [[1.0, -0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "centre": [0.0, 0.0, 1.0],
        "size": 5744.562646538028,
        "leaves": [],
    },
    "patches": 6,
    "patterns": "linear",
    "pattern_polynomials": {
        "white": [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        "u": [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        "v": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    },
    "key": "9ea6e5ec927ef099",
    "samples": 64,
    "seed": 0,
    "route": "all",
    "grain": True,
    "adaptive": False,
    "far": True,
    "blender": "5.2.3 LTS",
    "colour_space": "Linear Rec.709",
    "film_transparent": False,
    "portals": True,
    "changed": {
        "cycles.samples": [4096, 64],
        "cycles.use_denoising": [True, False],
        "world": ["World", None],
    },
    "catchers": ["Floor", "Größe"],
    "take": "ground",
    "kept": True,
    "choice": "auto",
    "separate": False,
    "scene": "Scene",
    "file": "//shot.blend",
    "view_layer": "ViewLayer",
    "shot": {
        "scene": "Scene",
        "frame": 1,
        "width": 24,
        "height": 18,
        "camera_matrix": [
            *(1.0, 0.0, 0.0, 0.0),
            *(0.0, 0.34202, -0.93969, -9.0),
            *(0.0, 0.93969, 0.34202, 4.0),
            *(0.0, 0.0, 0.0, 1.0),
        ],
        "lens": ["PERSP", 0.0, 0.0, "AUTO", 36.0, 24.0, 50.0, 1.0, 1.0],
        "file": "shot",
        "scene_id": "ecac6a5e61304346b0825a12bf6536af",
        "view_layer": "ViewLayer",
        "camera": "Camera",
        "subframe": 0.0,
        "region": [0, 0, 24, 18],
        "colour_space": "Linear Rec.709",
    },
    "frame": 1,
    "fingerprint": {"=Object 'Matt'": "0c9f", "Material 'Floor'": "4dd1"},
    "behind": True,
    "caution": {"text": "it is dark", "ratio": 0.5, "worst": 0.25, "share": 0.125, "dark": False},
    "tiles": [
        {"region": [0, 0, 24, 6], "files": [], "done": True, "fitted": ENTRY},
        {
            "region": [0, 6, 24, 6],
            "files": ["tile_0001_seed_00_0000.exr", "tile_0001_seed_01_0000.exr"],
            "done": True,
            "seeds": [[32, ["tile_0001_seed_00_0000.exr"]], [32, ["tile_0001_seed_01_0000.exr"]]],
        },
        {"region": [0, 12, 24, 6], "files": [], "done": False},
    ],
    "seconds": 0.14595619600004284,
    "pair": "602ab0ab927ef099",
}
# A photographed set says of itself what its maker knows.
PHOTOGRAPHED = {name: WRITTEN[name] for name in (*list(WRITTEN)[:8], "samples")}
PHOTOGRAPHED["tiles"] = [{"region": [0, 0, 24, 18], "files": ["tile_0000.exr"], "done": True}]


def text_of(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=1)


def opened(folder: Path, data: dict[str, Any]) -> CaptureHead:
    (folder / HEADER).write_text(text_of(data), encoding="utf-8")
    return heads.read(folder)


def refused(folder: Path, data: dict[str, Any]) -> str:
    with pytest.raises(CaptureSetError) as e:
        opened(folder, data)
    assert str(folder) in str(e.value) and "capture again" in str(e.value)
    return str(e.value)


def without(data: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name not in names}


FILES = {
    "a take of several seeds": WRITTEN,
    "faint patches": {
        key: told
        for name, value in (WRITTEN | {"version": 2}).items()
        for key, told in [(name, value), *([("radiance", 0.25)] if name == "route" else [])]
    },
    "no catchers, nothing to be told": without(WRITTEN, "catchers", "take", "pair")
    | {"caution": None},
    "photographed": PHOTOGRAPHED,
}


@pytest.mark.parametrize("data", FILES.values(), ids=FILES)
def test_a_file_comes_back_letter_by_letter(tmp_path: Path, data: dict[str, Any]) -> None:
    head = opened(tmp_path, data)
    heads.write(tmp_path, head)
    assert (tmp_path / HEADER).read_text(encoding="utf-8") == signed.text_of(data)
    assert heads.read(tmp_path) == head


def test_what_is_read_is_what_is_written(tmp_path: Path) -> None:
    """Each value in the field of its name, of its kind."""
    head = opened(tmp_path, WRITTEN)
    for name in ("samples", "seed", "grain", "far", "key", "blender", "frame", "seconds", "pair"):
        assert getattr(head, name) == WRITTEN[name], name
    assert head.route is Route.ALL and head.take is Take.GROUND
    assert head.catchers == ("Floor", "Größe")
    assert head.changed == WRITTEN["changed"] and head.fingerprint == WRITTEN["fingerprint"]
    assert head.caution == Caution("it is dark", 0.5, 0.25, 0.125, False)
    assert head.shot is not None and head.shot.camera == "Camera"
    assert (head.height, head.width, len(head.hemicube)) == (18, 24, 6)
    fitted, seeds, waiting = head.tiles
    assert fitted == TileEntry(Region(0, 0, 24, 6), (), True, (), ENTRY)
    assert seeds.seeds[1] == SeedEntry(32, ("tile_0001_seed_01_0000.exr",))
    assert seeds.renders[0] == (0.5, ["tile_0001_seed_00_0000.exr"])
    assert waiting == TileEntry(Region(0, 12, 24, 6))
    assert head.done == 2 and head.traced == 2 * 24 * 6 * 64


def test_what_another_version_says_beside_that_stays(tmp_path: Path) -> None:
    """In the head and in a tile: a capture that is gone on with does not lose it."""
    data = copy.deepcopy(WRITTEN) | {"weather": {"wind": [1, 2]}}
    data["tiles"][2]["machine"] = "seven"
    head = opened(tmp_path, data)
    assert head.others == {"weather": {"wind": [1, 2]}}
    heads.write(tmp_path, replace(head.with_tile(2, done=True), seconds=2.0))
    again = parsed((tmp_path / HEADER).read_text())
    data["tiles"][2]["done"] = True
    assert again == data | {"seconds": 2.0}


def test_a_head_does_not_change(tmp_path: Path) -> None:
    head = opened(tmp_path, WRITTEN)
    with pytest.raises(FrozenInstanceError):
        head.samples = 3  # type: ignore[misc]
    after = head.with_tile(2, done=True, files=("a.exr",))
    assert after.tiles[2].done and not head.tiles[2].done
    assert after.tiles[:2] == head.tiles[:2]


# What each field of the head cannot be, beside what is of no kind that any has.
IMPOSSIBLE: dict[str, list[Any]] = {
    "hemicube": [{"faces": ["top"]}, WRITTEN["hemicube"] | {"size": -1.0}],
    "patterns": ["stripes", ""],
    "height": [0, -1, 1.5, 10**9, True],
    "width": [0, -1, 1.5, 10**9, True],
    "tiles": [{}, [3], [{}], [{"region": [0, 0, 24, 18], "files": [], "done": "yes"}]],
    "key": ["x" * 40_000],
    "asked": ["x" * 40_000, 3],
    "samples": [-1, -0.5, 10**400, True, "64", 1e300],
    "seed": [-1, 2**31, 0.5, False],
    "route": ["", "All", "none"],
    "radiance": [0, -0.5, 2, 1e-30, True, "faint"],
    "grain": [0, 1, "yes"],
    "adaptive": [0, 1, "yes"],
    "far": [0, 1, "yes"],
    "blender": ["x" * 40_000, 5.2],
    "colour_space": ["x" * 40_000, 709],
    "film_transparent": [0, 1, "yes"],
    "portals": [0, 1, "yes"],
    "changed": [{"cycles.samples": 64}, {"cycles.samples": [1, 2, 3]}],
    "catchers": [[3], "Floor", [["Floor"]]],
    "take": ["Ground", "sky", 0],
    "kept": [0, 1, "yes"],
    "choice": ["x" * 40_000, 3],
    "separate": [0, 1, "yes"],
    "scene": ["x" * 40_000, 3],
    "file": ["x" * 40_000, 3],
    "view_layer": ["x" * 40_000, 3],
    "shot": [{"scene": 3}, WRITTEN["shot"] | {"frame": "one"}],
    "frame": [0.5, 2**31, -(2**31), True],
    "fingerprint": [{"Mesh": 3}, {"Mesh": None}],
    "caution": [{"text": "dark"}, WRITTEN["caution"] | {"share": 1.5}],
    "seconds": [-1.0, 1e300, "long", 10**400],
    "pair": ["x" * 40_000, 3],
    "behind": [0, 1, "yes"],
    "noise": [0.1, [1e-4], [1e-4, -1e-3], [1e-4, "some"], [1e-4, 1e-3, 0.0]],
}
OF_NO_KIND = [[[[]]], 7.25, {"a": {"b": []}}]
NAMED = [f.name for f in fields(CaptureHead) if f.name != "others"]


@pytest.mark.parametrize("name", NAMED)
def test_a_field_that_cannot_be_is_named(tmp_path: Path, name: str) -> None:
    """Every field of the head: a new one without a check, or without a line above, fails here."""
    assert opened(tmp_path, WRITTEN)
    number = name in ("samples", "seconds")
    wrong = [*IMPOSSIBLE[name], *(v for v in OF_NO_KIND if not (number and v == 7.25))]
    for value in wrong:
        said = refused(tmp_path, WRITTEN | {name: value})
        told = {"tiles": ("tiles", "region", "files", "done")}.get(name, (name,))
        assert any(f"'{n}" in said for n in told), (value, said)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        (
            "region",
            [None, [0, 12, 24], [0, 12, 24, 7], [0, 12, 0, 1], [-1, 0, 2, 2], [0.0, 0, 1, 1]],
        ),
        ("files", [None, "a.exr", ["../a.exr"], [3], ["a/b.exr"]]),
        ("done", [None, 1, "yes"]),
        ("seeds", [3, [3], [[0, []]], [[-1, []]], [[True, []]], [[1.5, []]], [[8, ["none.exr"]]]]),
        ("fitted", [3, [], {}, {"folder": "../x"}, {"folder": 3}]),
    ],
)
def test_a_value_of_a_tile_that_cannot_be_is_named(tmp_path: Path, name, values) -> None:
    assert name in {f.name for f in fields(TileEntry)}
    for value in values:
        data = copy.deepcopy(WRITTEN)
        data["tiles"][2][name] = value
        assert f"'{name}'" in refused(tmp_path, data), value


@pytest.mark.parametrize("name", [f.name for f in fields(Caution)])
def test_a_value_of_a_caution_that_cannot_be_is_named(tmp_path: Path, name: str) -> None:
    for value in ([], {}, "x" if name != "text" else 3, 1e300 if name != "text" else 1, None):
        said = refused(tmp_path, WRITTEN | {"caution": WRITTEN["caution"] | {name: value}})
        assert "caution." in said and name in said, said


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("format", "ARTO reflectance field"),
        ("patches", 7),
        (
            "pattern_polynomials",
            WRITTEN["pattern_polynomials"] | {"u": [0.0, 2.0, 0.0, 0.0, 0.0, 0.0]},
        ),
        ("pattern_polynomials", {}),
    ],
)
def test_what_is_written_for_others_must_be_true(tmp_path: Path, name: str, value: Any) -> None:
    """A set whose patterns are others than those of their name would bend the light."""
    assert f"'{name}'" in refused(tmp_path, WRITTEN | {name: value})


def test_a_set_that_blender_did_not_render_says_so_where_it_is_asked(tmp_path: Path) -> None:
    there = CaptureSet(tmp_path, head=opened(tmp_path, PHOTOGRAPHED))
    assert there.kept and there.samples == 64
    with pytest.raises(CaptureSetError, match="how it was rendered"):
        _ = there.head.told_route
    with pytest.raises(CaptureSetError, match="what to fit it with"):
        _ = there.head.told_choice


def test_the_names_of_kinds_are_those_of_files_and_settings() -> None:
    """They are in .blend files and capture sets on disk: another name is another file."""
    assert [*Route] == ["all", "pattern", "single", "sampled", "photographs"]
    assert [*Keep] == ["always", "fits", "never"]
    assert [*Quality] == ["DRAFT", "GOOD", "FINAL", "CUSTOM"]
    assert [*Take] == ["", "ground", "things"]
    assert json.dumps(Route.SAMPLED) == '"sampled"' and f"{Take.GROUND}" == "ground"
