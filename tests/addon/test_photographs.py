"""A folder of a dome's photographs becomes a shot that is relit like any other."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.capture.check import check_scene
from arto.arto_addon.photographs import opening
from arto.arto_addon.photographs.read import TABLE, WORST, read_photographs
from arto.arto_addon.relight.relight import compute
from arto.arto_addon.relight.verify import verify_plate
from arto.arto_addon.shot import paths
from arto.arto_addon.shot.shot import layer_of
from arto.arto_addon.ui import cli, state
from arto.core import exr
from arto.core.errors import PhotographsError, SceneError
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from numpy.typing import NDArray
from scene_tools import hdri, small_scene

oiio = pytest.importorskip("OpenImageIO")
if not hasattr(oiio, "ImageOutput"):
    pytest.skip("OpenImageIO's module is empty here", allow_module_level=True)

HEIGHT, WIDTH, LAMPS = 48, 64, 12


def directions() -> NDArray[np.float64]:
    z = 1 - 0.6 * (np.arange(LAMPS) + 0.5) / LAMPS
    turn, flat = np.arange(LAMPS) * 2.399963, np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def save(path: Path, values: NDArray, seconds: float) -> None:
    height, width = values.shape[:2]
    spec = oiio.ImageSpec(width, height, 3, "uint8")
    spec.attribute("ExposureTime", seconds)
    spec.attribute("Exif:FocalLengthIn35mmFilm", 70)
    spec.attribute("CompressionQuality", 98)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image((255 * values + 0.5).astype(np.uint8))
    out.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve JPEGs of a Lambert sphere, and lights.txt."""
    there = tmp_path_factory.mktemp("stone")
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    nx, ny = (x - 31.5) / 20, -(y - 23.5) / 20
    inside = nx * nx + ny * ny < 1
    nz = np.sqrt(np.maximum(1 - nx * nx - ny * ny, 0))
    normal = np.stack([nx, ny, nz], axis=-1) * inside[..., None]
    for k, d in enumerate(directions()):
        light = np.maximum(normal @ d, 0)[..., None] * np.array([0.7, 0.5, 0.3])
        values = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        save(there / f"img_{k:02d}.jpg", np.clip(values, 0, 1), 0.25)
    save(there / "mask.jpg", np.repeat(inside[..., None], 3, -1).astype(float), 1.0)
    rows = "\n".join(" ".join(f"{v:.6f}" for v in d) for d in directions())
    (there / "lights.txt").write_text(f"{LAMPS}\n{rows}\n")
    return there


def test_photographs_are_a_shot(folder: Path, tmp_path: Path) -> None:
    before = small_scene(tmp_path)
    hdri(before, np.full((8, 16, 3), 1.0))
    scene, _ = opening.open_scene(folder, before.world)
    scene.arto.folder, scene.arto.output = str(tmp_path / "arto"), str(tmp_path / "photo.exr")
    scene.arto.depth, scene.arto.environment_width = "FLOAT", 64
    bpy.context.window.scene = scene
    assert (scene.render.resolution_x, scene.render.resolution_y) == (WIDTH, HEIGHT)
    assert scene.camera.data.lens == 70
    said: list[str] = []
    work.run(read_photographs(scene), lambda step: said.append(step.text))
    assert any("no lamp covers" in text for text in said)
    assert any("curve is taken for that of sRGB" in text for text in said)
    # the table names every photograph, and the worst picture is three beside each other
    shot = paths.place(scene).folder
    table = (shot / TABLE).read_text()
    assert all(f"img_{k:02d}.jpg" in table for k in range(LAMPS))
    assert exr.read(shot / WORST)[""].shape[1] % 3 == 0
    field = Field(shot / "field")
    assert len(field.hemicube) == LAMPS and field.hemicube.lamps
    assert state.told(scene).kind == "ready"
    # relit by the world: what the cells of the lamps see of it
    path, _ = work.run(compute(scene, layer_of(scene)))
    plate = exr.read(path)[""]
    assert plate[0, 0].max() < 0.01 and plate[24, 32, 3] > 0.99
    red = plate[..., 0]
    # an even front light: brightest in the middle, as even from left and right as its lamps are
    assert red[24, 32] > 1.2 * red[24, 16] > 0 and abs(red[24, 20] / red[24, 43] - 1) < 0.1
    # what needs the thing in Blender is refused with its reason
    with pytest.raises(SceneError, match="is of photographs"):
        check_scene(scene)
    with pytest.raises(SceneError, match="is of photographs"):
        work.run(verify_plate(scene))


def test_a_sun_shines_by_the_cell_that_it_is_in(folder: Path, tmp_path: Path) -> None:
    before = small_scene(tmp_path)
    image = np.zeros((64, 128, 3), np.float32)
    where = Environment(image)
    aim = np.array([directions()[5][0], -directions()[5][2], directions()[5][1]])
    height, width = image.shape[:2]
    row = int((0.5 - np.arcsin(aim[2]) / np.pi) * height)
    best = max(
        range(width),
        key=lambda c: float(_lit(image.shape, row, c, where, aim)),
    )
    image[row, best] = 5000.0
    hdri(before, image)
    scene, _ = opening.open_scene(folder, before.world)
    scene.arto.folder, scene.arto.output = str(tmp_path / "arto"), str(tmp_path / "sun.exr")
    scene.arto.depth, scene.arto.environment_width = "FLOAT", 128
    scene.arto.lamps = True
    bpy.context.window.scene = scene
    work.run(read_photographs(scene))
    said: list[str] = []
    path, _ = work.run(compute(scene, layer_of(scene)), lambda step: said.append(step.text))
    assert any("suns shine by the patches" in text for text in said)
    red = exr.read(path)[""][..., 0]
    y, x = np.unravel_index(int(red.argmax()), red.shape)
    found = np.array([(x - 31.5) / 20, -(y - 23.5) / 20])
    assert np.abs(found - directions()[5][:2]).max() < 0.25


def _lit(
    shape: tuple[int, ...], row: int, column: int, where: Environment, aim: NDArray
) -> np.float64:
    image = np.zeros(shape, np.float32)
    image[row, column] = 1
    return np.float64(Environment(image, where.turn).at(aim[None])[0, 0])


def test_the_command_line_opens_and_reads(folder: Path, tmp_path: Path) -> None:
    small_scene(tmp_path)
    blend = tmp_path / "lab.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    assert cli.main(["photographs", str(folder), "--save"]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.data.scenes[folder.name]
    assert (paths.place(scene).folder / "field" / "field.json").is_file()
    # again: the same scene is read, and no other is made
    count = len(bpy.data.scenes)
    assert cli.main(["photographs", str(folder)]) == 0 and len(bpy.data.scenes) == count
    assert cli.main(["photographs", str(folder / "nowhere")]) == 2
    bad = tmp_path / "bad"
    bad.mkdir()
    assert cli.main(["photographs", str(bad)]) == 1


def test_the_operator_opens_a_scene(folder: Path, tmp_path: Path) -> None:
    small_scene(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lab.blend"))
    assert bpy.ops.arto.open_photographs(directory=str(folder)) == {"FINISHED"}
    scene = bpy.data.scenes[folder.name]
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        assert not bpy.ops.arto.capture.poll()
        assert not bpy.ops.arto.verify.poll()
        assert bpy.ops.arto.read_photographs.poll()
    count = len(bpy.data.scenes)
    with pytest.raises(RuntimeError, match="there is no photograph in"):
        bpy.ops.arto.open_photographs(directory=str(tmp_path))
    assert len(bpy.data.scenes) == count
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "a.jpg").write_bytes((folder / "img_00.jpg").read_bytes()[:500])
    (tmp_path / "cut" / "dome.lp").write_text("1\na.jpg 0 0 1\n")
    with pytest.raises(PhotographsError, match="a part of the picture is missing"):
        opening.open_scene(tmp_path / "cut", None)
