"""What an opened field holds: no more than one file a tile, and nothing once it is closed."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from arto.core.field.field import Field
from arto.core.field.merged import MergedTile, merged
from arto.core.field.tile_writer import TileWriter
from arto.core.field.writer import FieldWriter, replace_layers
from arto.core.hemicube import Hemicube
from arto.core.inside import parts_at
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.preview import Preview
from arto.core.region import Region
from arto.core.relight import relight, relights
from arto.core.supports import BOX, LINEAR

CUBE = Hemicube(patches=1)
LIGHT = PatchLight(Environment.uniform(1.0, 16), CUBE)
NAMES = ("own", "alpha", "albedo", "normal", "depth", "position", "own_key")
linux = pytest.mark.skipif(sys.platform != "linux", reason="/proc says what is mapped")


def made(folder: Path, tiles: int, rows: int = 2, width: int = 16) -> Path:
    """A field of many tiles, each with two models, a rest and all layers that a fit writes."""
    rng = np.random.default_rng(0)
    writer = FieldWriter(folder, CUBE, (tiles * rows, width))
    for number in range(tiles):
        region = Region(0, number * rows, width, rows)
        layers = {
            name: rng.random((rows, width) if name in ("alpha", "depth") else (rows, width, 3))
            for name in NAMES
        }
        tile = TileWriter(region, layers)
        for _ in range(len(CUBE)):
            codes = rng.choice([0, LINEAR.code, BOX.code], region.pixels).astype(np.uint8)
            used = {
                s.code: rng.random((int((codes == s.code).sum()), len(s.parameters)))
                for s in (LINEAR, BOX)
            }
            tile.add(codes, rng.random((region.pixels, 3)), used)
        writer.add(tile)
    writer.close()
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return made(tmp_path / "field", 4)


@pytest.fixture
def no_collector() -> Iterator[None]:
    """As between two rounds of the garbage collector: what is in a circle stays."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def mapped(folder: Path) -> list[str]:
    """What is mapped of a folder, in this process, each map once."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    return sorted(line.split(maxsplit=5)[5] for line in lines if f" {folder}/" in line)


def opened(folder: Path) -> list[str]:
    """The files of a folder that this process has open."""
    links = [os.path.realpath(p) for p in Path("/proc/self/fd").iterdir()]
    return sorted(link for link in links if link.startswith(f"{folder}/"))


@linux
def test_a_tile_is_one_file_and_one_map(folder: Path) -> None:
    field = Field(folder)
    assert not mapped(folder) and not opened(folder)
    relight(field, LIGHT)
    for name in NAMES:
        field.layer(name)
    tiles = [str(folder / f"tile_{n:04d}.arto") for n in range(4)]
    assert mapped(folder) == tiles
    # a map of Python 3.13 needs no open file, one of those before has one
    assert opened(folder) == ([] if sys.version_info >= (3, 13) else tiles)


@linux
def test_closing_lets_go_of_the_files(folder: Path, no_collector) -> None:
    with Field(folder) as field:
        expected = relights(field, [LIGHT, LIGHT])
        assert field.own_layers == ["own_key"] and parts_at(field, LIGHT, 3, 3)
        assert field.tiles[0].codes.any() and field.tiles[0].entries(0)
        assert mapped(folder)
    assert not mapped(folder) and not opened(folder)
    # what is asked for afterwards is mapped anew
    np.testing.assert_array_equal(relights(field, [LIGHT, LIGHT]), expected)
    assert mapped(folder)
    field.close()
    assert not mapped(folder)


@linux
def test_a_field_that_nobody_has_lets_go_of_its_files(folder: Path, no_collector) -> None:
    field = Field(folder)
    relight(field, LIGHT)
    half = field.proxy(2)
    relight(half, LIGHT)
    assert len(mapped(folder)) == 4 + len(half.tiles)
    del half, field
    assert not mapped(folder) and not opened(folder)


@linux
def test_an_array_keeps_its_map_and_nothing_else(folder: Path, no_collector) -> None:
    field = Field(folder)
    field.tiles[0].open(), field.tiles[1].open()
    codes = field.tiles[0].models[0].codes
    expected = codes.copy()
    field.close()
    assert mapped(folder) == [str(folder / "tile_0000.arto")]
    np.testing.assert_array_equal(codes, expected)
    del codes
    assert not mapped(folder)


@linux
def test_previews_hold_their_fields_alone(folder: Path, no_collector) -> None:
    preview = Preview([Field(folder)])
    for factor in preview.factors:
        preview.picture(LIGHT, factor)
    one = merged(Field(folder))
    assert isinstance(one.tiles[0], MergedTile)
    relight(one, LIGHT)
    # in one piece a field is in memory, so the maps are those of the whole one and of small ones
    assert len(mapped(folder)) <= 4
    del preview, one
    assert not mapped(folder) and not opened(folder)


@linux
def test_nothing_is_mapped_while_a_field_is_replaced(
    folder: Path, no_collector, monkeypatch
) -> None:
    """Windows replaces no file that is mapped: neither a tile's nor the field's."""
    held: list[list[str]] = []
    replace, rename = Path.replace, Path.rename

    def watched(path: Path, to: Path) -> Path:
        held.append(mapped(folder) + opened(folder))
        return (replace if path.is_file() else rename)(path, to)

    monkeypatch.setattr(Path, "replace", watched)
    monkeypatch.setattr(Path, "rename", watched)
    field = Field(folder)
    before = relight(field, LIGHT)
    albedo = np.full((8, 16, 3), 0.5)
    replace_layers(field, {"albedo": albedo, "own_fill": albedo})
    assert len(held) == 4
    np.testing.assert_array_equal(field.layer("albedo"), albedo)
    assert field.own_layers == ["own_fill", "own_key"]
    np.testing.assert_array_equal(relight(field, LIGHT), before)
    field.close()
    made(folder, 3)
    assert len(held) > 8 and not any(held)
    assert len(Field(folder).tiles) == 3


LIMITED = """
import resource, sys
from pathlib import Path

resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
sys.path[:0] = sys.argv[1].split("|")
import numpy as np
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.light import PatchLight
from arto.core.relight import relights

takes = [Field(Path(path)) for path in sys.argv[3:]]
light = PatchLight(Environment.uniform(1.0, 16), takes[0].hemicube)
pictures = [relights(take, [light])[0] for take in takes]
guides = [take.layer(n) for take in takes for n in ("albedo", "normal", "depth", "position")]
np.save(sys.argv[2], np.stack(pictures))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a limit of POSIX")
def test_many_tiles_in_three_takes_under_a_limit_of_256_files(tmp_path: Path) -> None:
    """As programs on macOS have it: pictures of everything, of the catchers, of the things."""
    takes = [made(tmp_path / "take_0", 62)]
    takes += [Path(shutil.copytree(takes[0], tmp_path / f"take_{n}")) for n in (1, 2)]
    out = tmp_path / "out.npy"
    # with the paths of this process: the package may be installed in any way
    line = [sys.executable, "-c", LIMITED, "|".join(sys.path), str(out), *map(str, takes)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    expected = relight(Field(takes[0]), LIGHT)
    for picture in np.load(out):
        np.testing.assert_array_equal(picture, expected)
