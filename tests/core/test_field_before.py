"""Fields of version 2, whose tiles are folders, show what they showed."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from arto.core.errors import FieldError
from arto.core.field.field import Field
from arto.core.field.head import HEADER
from arto.core.field.writer import replace_layers
from arto.core.hemicube import Hemicube
from arto.core.light.light import PatchLight
from arto.core.region import Region
from arto.core.relight import relight
from arto.core.signed import parsed

CUBE = Hemicube(faces=("top", "back"), patches=2)
REGIONS = [Region(0, 0, 8, 4), Region(0, 4, 8, 6)]


def _tile_before(arrays: dict[str, np.ndarray], folder: Path) -> None:
    folder.mkdir()
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array)


@pytest.fixture
def now(tmp_path: Path, scene, write_scene, fitted) -> Field:
    folder = write_scene(tmp_path / "capture", scene(CUBE, (10, 8)), REGIONS)
    return fitted(folder, tmp_path / "now")


@pytest.fixture
def before(tmp_path: Path, now: Field, arrays_of) -> Path:
    """The same field as version 2 wrote it, with its proxies."""
    for header in now.folder.rglob(HEADER):
        folder = tmp_path / "before" / header.parent.relative_to(now.folder)
        folder.mkdir(parents=True)
        head = parsed(header.read_text()) | {"version": 2}
        for entry in head["tiles"]:
            name = entry.pop("file")
            entry["folder"] = name.removesuffix(".arto")
            for proxy in entry.get("proxies", {}).values():
                proxy["folder"] = proxy.pop("file").removesuffix(".arto")
            _tile_before(arrays_of(header.parent / name), folder / entry["folder"])
        (folder / HEADER).write_text(json.dumps(head))
    return tmp_path / "before"


def same(one: Field, other: Field, light: PatchLight) -> None:
    """Bit for bit, whole, cropped and small."""
    for region in (None, Region(2, 3, 4, 5)):
        np.testing.assert_array_equal(
            relight(one, light, 0.5, region), relight(other, light, 0.5, region)
        )
    np.testing.assert_array_equal(relight(one.proxy(2), light), relight(other.proxy(2), light))
    assert one.shares() == other.shares() and one.own_layers == other.own_layers
    assert one.has_layer("alpha") and not one.has_layer("normal")


def test_a_field_of_before_shows_the_same(before: Path, now: Field, noisy) -> None:
    assert not list(before.rglob("*.arto"))
    same(Field(before), now, PatchLight(noisy(1), CUBE))


def test_a_field_whose_capture_went_on_in_this_version(before: Path, now: Field, noisy) -> None:
    """Its first tile is a folder, its second a file."""
    for header in before.rglob(HEADER):
        head = parsed(header.read_text())
        there = now.folder / header.relative_to(before)
        head["version"], head["tiles"][1] = 3, parsed(there.read_text())["tiles"][1]
        name = head["tiles"][1]["file"]
        (header.parent / name).write_bytes((there.parent / name).read_bytes())
        header.write_text(json.dumps(head))
    same(Field(before), now, PatchLight(noisy(1), CUBE))


def test_layers_of_a_field_of_before_are_replaced(before: Path, noisy) -> None:
    field, light = Field(before), PatchLight(noisy(1), CUBE)
    picture = relight(field, light, 0.0)
    alpha = np.linspace(0, 1, 80).reshape(10, 8)
    replace_layers(field, {"alpha": alpha})
    found = relight(Field(before), light, 0.0)
    np.testing.assert_array_equal(found[..., :3], picture[..., :3])
    np.testing.assert_array_equal(found[..., 3], alpha.astype(np.float16))


@pytest.mark.parametrize("name", ["peaks", "alpha", "box_coefficient", "box_counts"])
def test_a_damaged_array_of_before(before: Path, name: str, used, refused) -> None:
    path = before / "tile_0000" / f"{name}.npy"
    whole = path.read_bytes()
    used(before)
    for content in (whole[:-1], whole[:130], whole[:60], b"", b"no array at all", b"PK\x05\x06"):
        path.write_bytes(content)
        refused(before, f"{name}.npy is missing or damaged")
    np.save(path, np.zeros(3, np.uint8))
    refused(before, "tile_0000")
    path.unlink()
    refused(before, f"{name}.npy is missing or damaged")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are pipes on POSIX alone")
def test_a_pipe_in_an_array_of_before_is_not_waited_for(before: Path, refused) -> None:
    path = before / "tile_0000" / "peaks.npy"
    path.unlink()
    os.mkfifo(path)
    done = threading.Thread(target=refused, args=(before, "is no regular file"), daemon=True)
    done.start()
    done.join(30)
    assert not done.is_alive()


def test_a_field_of_before_that_is_older_is_refused_in_a_sentence(before: Path) -> None:
    head = parsed((before / HEADER).read_text())
    (before / HEADER).write_text(json.dumps(head | {"version": 1}))
    with pytest.raises(FieldError, match=r"a field of version 1; .* fit again from the capture"):
        Field(before)
