"""Layers of EXR files as other programs write them: several in a part, by their channels."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from arto.core import exr
from arto.core.errors import ExrError
from exr_tools import layers, same

pytestmark = pytest.mark.usefixtures("library")


def one_part(path: Path, planes: dict[str, np.ndarray]) -> None:
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(head, planes).write(str(path))


@pytest.mark.parametrize("view_layer", ["", "View Layer.", "v2.0.", "R."])
def test_layers_that_share_a_part_are_those_of_parts(tmp_path: Path, view_layer: str) -> None:
    """Blender interleaves them where a scene was saved before its version 5."""
    given = {view_layer + name: px for name, px in layers().items()}
    given[view_layer + "Normal"] = given[view_layer + "Combined"][..., :3] + 1
    exr.write(tmp_path / "parts.exr", given)
    planes = {}
    for name, pixels in given.items():
        stack = pixels[..., None] if pixels.ndim == 2 else pixels
        letters = {1: "Z", 3: "XYZ" if name.endswith("Normal") else "RGB", 4: "RGBA"}
        for n, letter in enumerate(letters[stack.shape[-1]]):
            planes[f"{name}.{letter}"] = np.ascontiguousarray(stack[..., n])
    one_part(tmp_path / "one.exr", planes)
    found = exr.read(tmp_path / "one.exr")
    same({name: found[name] for name in given}, exr.read(tmp_path / "parts.exr"))
    assert sorted(found) == sorted(given)
    assert exr.part_names(tmp_path / "one.exr") == list(found)


def test_one_layer_in_an_unnamed_part_is_named_by_its_channels(tmp_path: Path) -> None:
    one_part(tmp_path / "a.exr", {f"Layer.Combined.{c}": np.ones((3, 4), "f4") for c in "RGB"})
    assert (
        exr.part_names(tmp_path / "a.exr") == ["Layer.Combined"] == [*exr.read(tmp_path / "a.exr")]
    )


def test_a_named_part_that_holds_more_layers_names_them(tmp_path: Path) -> None:
    planes = {c: np.full((3, 4), n, np.float32) for n, c in enumerate(("R", "G", "B", "depth.Z"))}
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [OpenEXR.Part(dict(head), dict(planes), eye) for eye in ("left", "right")]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    names = ["left", "left.depth", "right", "right.depth"]
    assert sorted(exr.part_names(tmp_path / "a.exr")) == names
    assert exr.read(tmp_path / "a.exr")["right.depth"][0, 0].tolist() == [3]


def test_two_layers_of_one_name_are_not_mixed(tmp_path: Path) -> None:
    plane = np.ones((3, 4), np.float32)
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(head), {"Y": plane, "b.Z": plane}, "a"),
        OpenEXR.Part(dict(head), {"Y": plane}, "a.b"),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    for read in (exr.read, exr.part_names):
        with pytest.raises(ExrError, match=r"two layers 'a\.b'"):
            read(tmp_path / "a.exr")


@pytest.mark.parametrize("count", [2, 3, 1000])
def test_odd_channels_are_refused_in_few_words(tmp_path: Path, count: int) -> None:
    names = [f"x.channel{n:04d}" for n in range(count)]
    one_part(tmp_path / "a.exr", {n: np.ones((1, 1), np.float32) for n in names})
    for read in (exr.read, exr.part_names):
        with pytest.raises(ExrError, match="expected R, G, B or one a layer") as e:
            read(tmp_path / "a.exr")
        assert len(str(e.value)) < 400 + len(str(tmp_path))
        assert (f"and {count - 6} more" in str(e.value)) == (count > 6)


def test_small_letters_are_colours_too(tmp_path: Path) -> None:
    one_part(tmp_path / "a.exr", {c: np.full((3, 4), n, "f4") for n, c in enumerate("rgba")})
    assert exr.read(tmp_path / "a.exr")[""][0, 0].tolist() == [0, 1, 2, 3]


def test_whole_numbers_become_float_and_a_layer_is_of_one_kind(tmp_path: Path) -> None:
    planes = {
        "R": np.full((3, 4), 0.5, np.float16),
        "G": np.full((3, 4), 0.25, np.float32),
        "B": np.full((3, 4), 70000, np.uint32),
    }
    one_part(tmp_path / "a.exr", planes)
    found = exr.read(tmp_path / "a.exr")[""]
    assert found.dtype == np.float32 and found[0, 0].tolist() == [0.5, 0.25, 70000]


def test_a_file_of_many_layers_is_not_held_twice(tmp_path: Path) -> None:
    size, count = (64, 64), 200
    one_part(
        tmp_path / "a.exr",
        {f"L{n}.{c}": np.full(size, n, np.float32) for n in range(count) for c in "RGB"},
    )
    tracemalloc.start()
    try:
        for _ in exr.parts(tmp_path / "a.exr"):
            pass
        left, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    whole = count * 3 * 64 * 64 * 4
    assert whole < most < 1.1 * whole
    assert left < 0.1 * whole
