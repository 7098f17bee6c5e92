"""A contact sheet shows each plate as Blender shows it, and makes only those that are missing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.display import displayed
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.plate.marks import SHEET
from arto.arto_addon.relight import ahead, looks
from arto.arto_addon.sheet.cells import framed
from arto.arto_addon.sheet.layout import AROUND, WIDEST, layout, smaller
from arto.arto_addon.sheet.make import make, sheet_of
from arto.arto_addon.sheet.words import Words, fitting, write
from arto.arto_addon.shot.shot import layer_of
from arto.arto_addon.ui import cli
from arto.core import exr
from arto.core.errors import SceneError
from arto.core.exr.window import Window
from arto.core.photographs import png_file
from scene_tools import HEIGHT, WIDTH


@pytest.fixture
def two(shot: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """The shot with a look of its world, and one that is half as bright."""
    looks.add(shot, "Day")
    dim = looks.add(shot, "Evening")
    nodes = dim.world.node_tree.nodes
    nodes["Background"].inputs["Strength"].default_value = 0.5
    yield shot
    while shot.arto.looks:
        looks.remove(shot)


def read(path: Path) -> np.ndarray:
    """The pixels of a PNG file, rows from the top, 0 to 1."""
    image = bpy.data.images.load(str(path))
    try:
        width, height = image.size
        return np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
    finally:
        bpy.data.images.remove(image)


def said(path: Path) -> list[dict[str, object]]:
    return json.loads(png_file.texts(path)[SHEET])


def test_a_sheet_shows_its_plates(two: bpy.types.Scene, monkeypatch) -> None:
    path, layer = sheet_of(two), layer_of(two)
    work.run(make(two, layer, path))
    listed = said(path)
    assert [entry["light"] for entry in listed] == ["Day", "Evening"]
    assert {(e["camera"], e["frame"]) for e in listed} == {("Camera", two.frame_current)}
    page = read(path)
    grid = layout(2, 1, WIDTH, HEIGHT)
    for number, entry in enumerate(listed):
        plate = path.with_name(str(entry["plate"]))
        assert exr.header(plate)["arto.light key"] == entry["key"]
        light = next(iter(exr.read(plate).values()))[..., :3]
        row, column = grid.corner(number)
        rows, columns = light.shape[:2]
        found = page[row : row + rows, column : column + columns]
        np.testing.assert_allclose(found, displayed(two, light), atol=1.5 / 255)
        # its words stand under it, and nothing stands between it and the next
        under = page[row + rows : row + grid.cell[0], column : column + grid.cell[1]]
        assert (under.max(axis=-1) > 0.9).sum() > 20
        np.testing.assert_allclose(page[:, column - 4], AROUND, atol=0.01)
    # a plate whose light key is that of its light is not made again; another one is
    before = {entry["plate"]: path.with_name(str(entry["plate"])).stat() for entry in listed}
    two.arto.looks[1].world.node_tree.nodes["Background"].inputs["Strength"].default_value = 2.0
    work.run(make(two, layer, path))
    now = {name: path.with_name(str(name)).stat() for name in before}
    made = [n for n in before if now[n].st_mtime_ns != before[n].st_mtime_ns]
    assert made == [listed[1]["plate"]] and said(path)[1]["key"] != listed[1]["key"]


def test_maps_and_frames_in_place_of_looks(two: bpy.types.Scene, tmp_path: Path) -> None:
    """A row for each map, a column for each frame."""
    maps = [tmp_path / "grey.exr", tmp_path / "bright.exr"]
    for file, level in zip(maps, (0.3, 3.0), strict=True):
        exr.write(file, {"": np.full((8, 16, 3), level, np.float32)})
    path = tmp_path / "maps.png"
    frame = two.frame_current
    assert cli.main(["sheet", str(path), "--worlds", *map(str, maps), "--frames", "1-2"]) == 0
    assert [(e["light"], e["frame"]) for e in said(path)] == [
        ("grey", 1), ("bright", 1), ("grey", 2), ("bright", 2)
    ]  # fmt: skip
    assert two.frame_current == frame
    page, grid = read(path), layout(2, 2, WIDTH, HEIGHT)
    means = []
    for number in range(4):
        row, column = grid.corner(number)
        means.append(page[row : row + HEIGHT, column : column + WIDTH].mean())
    assert means[2] > 1.5 * means[0] and means[3] > 1.5 * means[1]
    assert abs(means[0] - means[1]) < 0.01


def test_a_column_for_each_camera(two: bpy.types.Scene, tmp_path: Path) -> None:
    """The other camera's plates have its name, and the sheet shows what it sees."""
    own, layer, path = two.camera, layer_of(two), tmp_path / "cameras.png"
    other = bpy.data.objects.new("Close", own.data.copy())
    two.collection.objects.link(other)
    other.location, other.rotation_euler = (0, 0, 9), (0, 0, 0)
    two.camera = other
    try:
        work.run(capture(two, layer))
        two.camera = own
        work.run(make(two, layer, path, cameras=["Camera", "Close"]))
        assert two.camera == own
    finally:
        two.camera = own
        bpy.data.objects.remove(other)
    listed = said(path)
    assert [(e["light"], e["camera"]) for e in listed] == [
        ("Day", "Camera"), ("Evening", "Camera"), ("Day", "Close"), ("Evening", "Close")
    ]  # fmt: skip
    assert len({e["plate"] for e in listed}) == 4 and "Close" in str(listed[3]["plate"])
    page, grid = read(path), layout(2, 2, WIDTH, HEIGHT)
    row, column = grid.corner(3)  # Evening, through the other camera
    plate = Path(bpy.path.abspath(two.arto.output)).with_name(str(listed[3]["plate"]))
    light = next(iter(exr.read(plate).values()))[..., :3]
    found = page[row : row + HEIGHT, column : column + WIDTH]
    np.testing.assert_allclose(found, displayed(two, light), atol=1.5 / 255)


def test_a_sheet_is_not_written_over_files_of_others(two: bpy.types.Scene, tmp_path: Path) -> None:
    layer, mine = layer_of(two), tmp_path / "mine.png"
    png_file.write(mine, np.zeros((2, 2, 3), np.uint8))
    before = mine.read_bytes()
    with pytest.raises(SceneError, match="ARTO has not written it"):
        work.run(make(two, layer, mine))
    assert mine.read_bytes() == before
    with pytest.raises(SceneError, match="PNG"):
        work.run(make(two, layer, tmp_path / "sheet.jpg"))
    with pytest.raises(SceneError, match="no camera 'Other'"):
        work.run(make(two, layer, tmp_path / "sheet.png", cameras=["Other"]))


def test_a_movie_turns_the_world(two: bpy.types.Scene, tmp_path: Path) -> None:
    """Its pictures are those of a turntable, and a movie of others is not written over."""
    path = tmp_path / "turn.mp4"
    asked = ["sheet", str(path), "--turntable", "3"]
    scenes = len(bpy.data.scenes)
    assert cli.main(asked) == 0
    plates = [one.path for one in ahead.wanted(two, (), 3, ())]
    light = [next(iter(exr.read(plate).values()))[..., :3] for plate in plates]
    assert not np.allclose(light[0], light[1], rtol=0.02)
    clip = bpy.data.movieclips.load(str(path))
    assert (*clip.size, clip.frame_duration) == (WIDTH, HEIGHT, 3)
    bpy.data.movieclips.remove(clip)
    # a movie keeps brightness about at each pixel, and colour at every second
    error = read(path) - displayed(two, light[0])
    assert np.abs(error.mean((0, 1))).max() < 0.01
    assert np.abs(error @ [0.2126, 0.7152, 0.0722]).mean() < 0.025
    before = [plate.stat().st_mtime_ns for plate in plates]
    assert cli.main(asked) == 0
    assert [plate.stat().st_mtime_ns for plate in plates] == before
    assert len(bpy.data.scenes) == scenes
    path.write_bytes(b"a movie of someone else's")
    assert cli.main(asked) == 1 and path.read_bytes() == b"a movie of someone else's"
    assert cli.main(["sheet", str(path)]) == cli.main([*asked, "--frames", "1-2"]) == 2


def test_a_cropped_plate_stands_in_its_frame(tmp_path: Path) -> None:
    picture = np.zeros((20, 30, 4), np.float32)
    picture[4:9, 11:17] = 0.5
    path = tmp_path / "cropped.exr"
    exr.write(path, {"": picture}, window=Window(0, crop=True))
    np.testing.assert_array_equal(framed(path), picture)
    exr.write(path, {"": picture}, window=Window(3))
    np.testing.assert_array_equal(framed(path), picture[3:-3, 3:-3])


def test_a_smaller_picture_keeps_its_light() -> None:
    picture = np.random.default_rng(2).random((30, 1001, 3)).astype(np.float32)
    small = smaller(picture, WIDEST)
    assert small.shape == (14, WIDEST, 3)
    np.testing.assert_allclose(small.mean((0, 1)), picture.mean((0, 1)), rtol=1e-5)
    assert smaller(picture, 1001) is picture


def test_a_sheet_that_is_too_large_is_refused() -> None:
    assert (layout(5, 1, 64, 48).columns, layout(5, 1, 64, 48).rows) == (3, 2)
    assert (layout(3, 4, 64, 48).columns, layout(3, 4, 64, 48).rows) == (4, 3)
    with pytest.raises(SceneError, match="every so many frames"):
        layout(3, 200, 480, 270)


def test_words_stay_in_their_place() -> None:
    name = "A look whose name is longer than its picture is wide"
    page = np.zeros((40, 400, 3), np.float32)
    write(page, [Words(name, 30, 10, 120), Words("Ä", 30, 300, 50, 0.5)])
    columns = np.flatnonzero(page[:, :250].max((0, 2)) > 0.1)
    assert columns.min() >= 8 and columns.max() <= 131 and columns.max() > 100
    assert page[:, 300:350].max() == pytest.approx(0.5, abs=0.02)
    assert fitting("Day", 100) == "Day" and fitting(name, 120).endswith("…")
