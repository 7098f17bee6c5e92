"""Damaged and hostile descriptions: a typed error that names what is wrong, soon."""

from __future__ import annotations

import copy
import json
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arto.core.capture import capture_set
from arto.core.capture.capture_set import CaptureSet
from arto.core.errors import ArtoError
from arto.core.field.field import Field
from arto.core.fit import fit
from arto.core.hemicube import Hemicube
from arto.core.patterns import pattern_set
from arto.core.shot import Shot
from arto.core.signed import parsed

SECONDS, BYTES = 1.0, 200 * 2**20
SHOT = Shot("Scene", 1, 3, 2, (1.0,) * 16, ("PERSP", 50.0))


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[type, Path]:
    """A capture set and a field of it, small and whole."""
    root = tmp_path_factory.mktemp("described")
    cube = Hemicube(patches=1)
    basis = np.ones((6, 3, 2, 3, 3), np.float32)
    about = {"samples": 16, "view_layer": "ViewLayer", "fingerprint": {"Mesh 'a'": "1"}}
    about |= {"shot": SHOT.to_json(), "key": "abc", "route": "all", "grain": False}
    capture_set.write(root / "capture", cube, pattern_set("linear"), basis, **about)
    for _ in fit.fit(CaptureSet(root / "capture"), root / "field"):
        pass
    return {CaptureSet: root / "capture", Field: root / "field"}


def looked_at(there: Any) -> None:
    """All that a panel asks of what it opened."""
    if isinstance(there, CaptureSet):
        assert all(region.pixels > 0 for region in there.regions)
        assert len(there.hemicube) > 0
        assert all(isinstance(t.done, bool) for t in there.head.tiles)
        assert all("/" not in name for names in there.files for name in names)
        found = there.head.to_json()
    else:
        there.shares()
        there.bytes_per_pixel()
        found = there.about.to_json()
    for name, kind in (("fingerprint", dict), ("shot", dict), ("view_layer", str), ("key", str)):
        assert found.get(name) is None or isinstance(found[name], kind)


def opened(kind: Callable[[Path], Any], folder: Path, text: str | bytes) -> str:
    """What comes of opening a description: `read`, or the error's text. The file is put back."""
    path = folder / ("capture.json" if kind is CaptureSet else "field.json")
    kept = path.read_bytes()
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    tracemalloc.start()
    begun = time.process_time()
    try:
        looked_at(kind(folder))
        said = "read"
    except ArtoError as e:
        said = str(e)
    finally:
        took, most = time.process_time() - begun, tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        path.write_bytes(kept)
    assert took < SECONDS and most < BYTES, (took, most)
    return said


def head_of(kind: type, folder: Path) -> dict[str, Any]:
    path = folder / ("capture.json" if kind is CaptureSet else "field.json")
    return parsed(path.read_text())


NONE = (
    "", "{", "[]", "3", "null", "NaN", '"x"', "{}", '{"version": Infinity}', "\ud800", "[" * 100000,
    '{"a":' * 20000 + "1" + "}" * 20000, b"\xff\xfe\x00", b"\x00" * 1000,
)  # fmt: skip


@pytest.mark.parametrize("kind", [CaptureSet, Field])
@pytest.mark.parametrize("text", NONE, ids=range(len(NONE)))
def test_what_is_no_description(kind, folders, text) -> None:
    assert "cannot be read" in opened(kind, folders[kind], text)


WRONG = [-1, 0, 1e400, float("nan"), 10**30, True, "3", [], {}, None, [[[]]], "x" * 10000]


def places(value: Any, path: tuple = ()) -> list[tuple]:
    """The way to every value in a description."""
    found = [path] if path else []
    if isinstance(value, dict):
        for key, item in value.items():
            found += places(item, (*path, key))
    elif isinstance(value, list):
        for n, item in enumerate(value):
            found += places(item, (*path, n))
    return found


def put(head: dict[str, Any], path: tuple, value: Any) -> dict[str, Any]:
    out = copy.deepcopy(head)
    where: Any = out
    for key in path[:-1]:
        where = where[key]
    where[path[-1]] = value
    return out


@pytest.mark.parametrize("kind", [CaptureSet, Field])
def test_two_hundred_wrong_values(kind, folders) -> None:
    """Every place of a description, each with a value that it cannot have, or may: no other error
    than a typed one comes of it, and of most one does."""
    rng = np.random.default_rng(11)
    head = head_of(kind, folders[kind])
    tries = [(p, v) for p in places(head) for v in WRONG]
    some = [tries[i] for i in rng.permutation(len(tries))[:200]]
    said = [opened(kind, folders[kind], json.dumps(put(head, p, v))) for p, v in some]
    assert sum(s != "read" for s in said) > 60


@pytest.mark.parametrize("kind", [CaptureSet, Field])
@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("height",), 10**9),
        (("width",), 0),
        (("hemicube", "centre"), [float("nan"), 0, 0]),
        (("hemicube", "centre"), [0, 0]),
        (("hemicube", "size"), float("inf")),
        (("hemicube", "size"), "10"),
        (("hemicube", "leaves"), [["top", 1, 0, 0]] * 5000),
        (("hemicube", "leaves"), [["top", 1.5, 0, 0]]),
        (("hemicube", "leaves"), [["top"]]),
        (("hemicube", "orientation"), [[1, 0, 0]] * 3),
        (("hemicube", "half_sides"), "no"),
        (("tiles", 0, "region"), [0, 0, 3, 9]),
        (("tiles", 0, "region"), [-1, 0, 3, 2]),
        (("tiles", 0, "region"), [0, 0, 3.0, 2]),
        (("tiles", 0, "region"), [0, 0, 0, 0]),
    ],
)
def test_what_cannot_be_is_refused(kind, folders, path, value) -> None:
    head = head_of(kind, folders[kind])
    assert opened(kind, folders[kind], json.dumps(head)) == "read"
    assert opened(kind, folders[kind], json.dumps(put(head, path, value))) != "read"


@pytest.mark.parametrize(
    "name",
    ["../x.exr", "/etc/passwd", "C:\\x.exr", "a/b.exr", "..", "", ".hidden", "a\0b", "nul. "],
)
def test_files_lie_in_the_set_itself(folders, name) -> None:
    head = head_of(CaptureSet, folders[CaptureSet])
    text = json.dumps(put(head, ("tiles", 0, "files", 0), name))
    assert "'files' cannot be" in opened(CaptureSet, folders[CaptureSet], text)
    head = head_of(Field, folders[Field])
    text = json.dumps(put(head, ("tiles", 0, "file"), name))
    assert "'file' cannot be" in opened(Field, folders[Field], text)


def test_tiles_that_overlap_are_refused(folders) -> None:
    head = head_of(CaptureSet, folders[CaptureSet])
    tile = head["tiles"][0]
    head["tiles"] = [{**tile, "region": [0, 0, 2, 2]}, {**tile, "region": [1, 1, 2, 1]}]
    assert "overlap" in opened(CaptureSet, folders[CaptureSet], json.dumps(head))
    head["tiles"] = [{**tile, "region": [0, 0, 1, 2]}, {**tile, "region": [1, 0, 2, 2]}]
    assert opened(CaptureSet, folders[CaptureSet], json.dumps(head)) == "read"
