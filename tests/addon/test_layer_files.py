"""Files of a plate's layers and data: what other programs read in them."""

from __future__ import annotations

import bpy
import numpy as np
import OpenImageIO
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.output import set_format
from arto.arto_addon.blender.version import FIVE
from arto.arto_addon.plate import plate
from arto.arto_addon.plate.names import relit_file
from arto.arto_addon.relight import relight
from arto.arto_addon.relight.back import mix_to_scene
from arto.arto_addon.relight.many import relight_many
from arto.core import cryptomatte, exr
from arto.core.errors import ExrError, SceneError
from scene_tools import (
    composited,
    in_compositor,
)
from shot_tools import group_at, relit_layers


def test_a_reader_that_knows_nothing_of_arto(lit):
    """OpenImageIO finds one part of half floats, plain R, G, B, A first, and what the layers of
    each channel add up to; the data as parts of their own."""
    lit.arto.layers_half, lit.arto.layer_prefix, lit.arto.write_data = True, "C_", True
    path, _ = work.run(relight.relight(lit))
    file = OpenImageIO.ImageInput.open(str(plate.layers_file(path)))
    spec = file.spec()
    assert spec.channelnames[:4] == ("R", "G", "B", "A") and spec.format == "half"
    assert {"C_top.R", "C_own.B"} <= set(spec.channelnames)
    assert (
        spec["colorInteropID"] == "lin_rec709_scene" and spec.getattribute("chromaticities") is None
    )
    assert spec["compression"] == "zips"
    pixels = file.read_image("float")
    for i, c in enumerate("RGB"):
        mine = [n for n, name in enumerate(spec.channelnames) if name.endswith(f".{c}")]
        whole = pixels[..., i]
        assert np.abs(pixels[..., mine].sum(axis=-1) - whole).max() < 2e-3 * whole.max()
    assert not file.seek_subimage(1, 0)
    data = OpenImageIO.ImageInput.open(str(plate.data_file(path)))
    found = {}
    while data.seek_subimage(len(found), 0):
        spec = data.spec()
        found[spec["oiio:subimagename"]] = spec.channelnames
        # albedo is a colour, the others are data
        space = "lin_rec709_scene" if spec["oiio:subimagename"] == "albedo" else "data"
        assert spec.format == "float" and spec["colorInteropID"] == space
    assert found == {
        "albedo": ("R", "G", "B"),
        "normal": ("X", "Y", "Z"),
        "depth": ("Z",),
        "position": ("X", "Y", "Z"),
    }


@pytest.mark.parametrize("window", ["FULL", "CROP"])
def test_a_file_for_each_layer(lit, tmp_path, window):
    """Another reader finds bare R, G, B, A, which add up to the plate; the mixer goes on."""
    _, expected = relit_layers(lit)
    path = relit_file(lit)
    plate.layers_file(path).unlink()
    lit.arto.layers_files, lit.arto.data_window = "EACH", window
    work.run(relight.relight(lit))
    picture = exr.read(path)[""]
    total = 0
    for name, layer in expected.items():
        file = path.with_name(f"{path.stem}_{name}.exr")
        image = OpenImageIO.ImageBuf(str(file))
        assert image.spec().channelnames == ("R", "G", "B", "A")
        assert image.spec()["arto.layer"] == name
        pixels = image.get_pixels("float", OpenImageIO.get_roi_full(image.spec()))
        np.testing.assert_allclose(pixels[..., :3], layer, rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(pixels[..., 3], picture[..., 3])
        total = total + pixels[..., :3]
    np.testing.assert_allclose(total, picture[..., :3], rtol=1e-5, atol=1e-6)
    assert plate.layers_file(path).is_file() == (window == "FULL")
    node = in_compositor(lit, bpy.data.node_groups["ARTO Relit Mix"], "Image")
    node.inputs["LG_top"].default_value = 0.25
    mixed = picture[..., :3] - 0.75 * expected["LG_top"]
    np.testing.assert_allclose(composited(lit, tmp_path)[..., :3], mixed, rtol=1e-4, atol=1e-5)
    # many pictures are shown by no mixer, and have no file for it
    made = work.run(relight_many(lit, lit.view_layers[0].name, turns=2))
    for each in made:
        assert each.with_name(f"{each.stem}_LG_top.exr").is_file()
        assert not plate.layers_file(each).exists()
        assert not plate.full_file(plate.layers_file(each)).exists()


def test_a_mix_of_single_files_goes_back_to_the_scene(lit):
    lit.arto.layers_files, lit.arto.data_window = "EACH", "CROP"
    work.run(relight.relight(lit))
    assert mix_to_scene(lit) == plate.world_file(relit_file(lit))


def test_a_layers_file_is_no_other_file(lit):
    """Not one of ARTO's, and not one that a disk takes for the same."""
    lit.arto.layers, lit.arto.layers_files, lit.arto.layer_prefix = "GROUPS", "EACH", ""
    group_at(lit, "Data", 0, 0.5, 0.3)
    with pytest.raises(SceneError, match=r"'Data' would be written over .*_Data\.exr"):
        work.run(relight.relight(lit))
    lit.arto.layer_prefix = "LG_"
    group_at(lit, "data", 1, 0.5, 0.3)
    with pytest.raises(SceneError, match="'LG_data' would be written over"):
        work.run(relight.relight(lit))


@pytest.mark.parametrize("interleaved", [True, False] if FIVE else [None])
def test_cryptomattes_are_handed_on(lit, tmp_path, interleaved):
    """Every rank, bit for bit, and the names: from a file of the artist's own render."""
    lit.view_layers[0].use_pass_cryptomatte_object = True
    settings, rendered = lit.render.image_settings, tmp_path / "mine.exr"
    set_format(settings, "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER")
    if interleaved is not None:
        settings.use_exr_interleave = interleaved
    lit.render.filepath, lit.cycles.samples = str(rendered), 4
    bpy.ops.render.render(write_still=True)
    lit.arto.write_data, lit.arto.cryptomatte = True, str(rendered)
    path, _ = work.run(relight.relight(lit))
    there = cryptomatte.read(plate.data_file(path))
    mine = cryptomatte.read(rendered)
    assert there.about == mine.about and any("Glossy" in str(t) for t in mine.about.values())
    assert there.planes.keys() == mine.planes.keys() and len(mine.planes) == 12
    for name, plane in mine.planes.items():
        np.testing.assert_array_equal(there.planes[name].view(np.int32), plane.view(np.int32))
    lit.view_layers[0].use_pass_cryptomatte_object = False
    bpy.ops.render.render(write_still=True)
    with pytest.raises(ExrError, match="no Cryptomatte"):
        relit_layers(lit)
    lit.arto.cryptomatte = str(tmp_path / "gone.exr")
    with pytest.raises(ExrError, match="no file"):
        relit_layers(lit)


@pytest.mark.parametrize("prefix", ["..", "/ü .x", "10"])
def test_any_prefix_makes_names_that_programs_read(lit, tmp_path, prefix):
    """A dot parts a layer from its channels: with one in a prefix the mixer found no layer. They
    add up, and the mixer shows them."""
    lit.arto.layer_prefix = prefix
    picture, found = relit_layers(lit)
    assert len(found) == 7
    assert not any(set(name) & set(". /") or name.isdigit() for name in found)
    np.testing.assert_allclose(sum(found.values()), picture[..., :3], rtol=1e-5, atol=1e-6)
    in_compositor(lit, bpy.data.node_groups["ARTO Relit Mix"], "Image")
    np.testing.assert_allclose(composited(lit, tmp_path), picture, rtol=1e-4, atol=1e-5)
    lit.arto.layers_files = "EACH"
    path, _ = work.run(relight.relight(lit))
    assert len(list(tmp_path.glob(exr.header(path)["arto.layers"]))) >= 7
