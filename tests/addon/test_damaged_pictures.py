"""Pictures that are cut off, or have what is no number, are told before work."""

from __future__ import annotations

import struct

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.sequences import damage, form_of, form_of_tiles
from arto.arto_addon.capture.capture import capture
from arto.arto_addon.capture.check import incomplete_images
from arto.arto_addon.relight import ahead, many, relight
from arto.arto_addon.relight.shown import Shown
from arto.arto_addon.shot.fingerprint import fingerprint
from arto.arto_addon.world import hdris
from arto.arto_addon.world.check import check_file, check_images
from arto.core import exr
from arto.core.errors import ArtoError, SceneError, StrictError
from arto.core.exr import writing
from arto.core.picture_files import is_cut

NOISE = np.random.default_rng(3).random((16, 32, 3)).astype(np.float32)


def saved(folder, kind, codec=""):
    """A picture as Blender saves it."""
    image = bpy.data.images.new("Noise", 32, 16, float_buffer=True)
    image.pixels.foreach_set(np.dstack([NOISE, np.ones((16, 32), np.float32)]).ravel())
    settings = bpy.context.scene.render.image_settings
    before = settings.file_format
    settings.file_format = kind
    if codec:
        settings.tiff_codec = codec
    path = folder / f"{kind}{codec}.{'jpg' if kind == 'JPEG' else kind[:3].lower()}"
    image.save_render(str(path), scene=bpy.context.scene)
    settings.file_format = before
    bpy.data.images.remove(image)
    return path


@pytest.fixture
def unchecked(monkeypatch):
    """Writes an EXR as another program would, whatever its pixels are."""

    def write(path, layers):
        with monkeypatch.context() as m:
            m.setattr(writing, "_check_finite", lambda *_: None)
            exr.write(path, layers)

    return write


def tiff(pixels):
    """An uncompressed TIFF of 32-bit floats, big-endian, with its directory at the end."""
    height, width, channels = pixels.shape
    data = pixels.astype(">f4").tobytes()
    entries = [
        (256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, 32 << 16), (259, 3, 1, 1 << 16),
        (262, 3, 1, 2 << 16), (273, 4, 1, 8), (277, 3, 1, channels << 16), (278, 4, 1, height),
        (279, 4, 1, len(data)), (339, 3, 1, 3 << 16),
    ]  # fmt: skip
    directory = struct.pack(">H", len(entries))
    directory += b"".join(struct.pack(">HHII", *entry) for entry in entries)
    return b"MM\0*" + struct.pack(">I", 8 + len(data)) + data + directory + bytes(4)


@pytest.mark.parametrize(
    ("kind", "codec"),
    [
        ("JPEG", ""),
        ("TIFF", "NONE"),
        ("TIFF", "LZW"),
        ("TIFF", "DEFLATE"),
        ("PNG", ""),
        ("HDR", ""),
    ],
)
def test_a_cut_picture_is_told(tmp_path, kind, codec, scene):
    whole = saved(tmp_path, kind, codec)
    assert damage(whole, finite=True) == ""
    data = whole.read_bytes()
    cut = whole.with_name(f"cut.{whole.suffix}")
    cut.write_bytes(data[: len(data) // 2])
    assert "damaged or cut off" in damage(cut)
    if kind in ("JPEG", "TIFF"):
        assert not is_cut(data) and is_cut(data[:-40])
        with pytest.raises(SceneError, match="cut off"):
            hdris.check(cut)
    if codec == "DEFLATE":
        flipped = bytearray(data)
        flipped[-60] ^= 255
        assert is_cut(bytes(flipped))
    # whatever its name ends with
    other = whole.with_name("cut.png")
    other.write_bytes(data[: len(data) // 2])
    assert damage(other)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_told(tmp_path, value, scene, unchecked):
    bad = NOISE.copy()
    bad[3, 4, 1] = value
    files = [tmp_path / name for name in ("a.exr", "layer.exr", "a.tif")]
    unchecked(files[0], {"": bad})
    unchecked(files[1], {"ViewLayer.Combined": bad})
    files[2].write_bytes(tiff(bad))
    good = tmp_path / "good.tif"
    good.write_bytes(tiff(NOISE))
    assert damage(good, finite=True) == ""
    for path in files:
        assert "infinite or not a number" in damage(path, finite=True)
    with pytest.raises(SceneError, match="not a number"):
        check_file(files[0])
    depth = tmp_path / "depth.exr"  # what is no colour may be far away
    unchecked(depth, {"Depth": np.full((2, 2, 1), np.inf, np.float32)})
    assert damage(depth, finite=True) == ""


def of_world(shot):
    nodes = shot.world.node_tree.nodes
    return next(node for node in nodes if node.bl_idname == "ShaderNodeTexEnvironment")


def test_the_scenes_own_world_is_looked_at_as_a_map_is(shot, tmp_path, unchecked):
    node, layer = of_world(shot), shot.view_layers[0].name
    theirs = node.image
    cut, bad = tmp_path / "cut.jpg", tmp_path / "bad.exr"
    cut.write_bytes(saved(tmp_path, "JPEG").read_bytes()[:-30])
    unchecked(bad, {"": np.full((8, 16, 3), np.nan, np.float32)})
    try:
        for path, match in ((cut, "cut off"), (bad, "not a number")):
            node.image = bpy.data.images.load(str(path))
            with pytest.raises(ArtoError, match=match):
                work.run(relight.compute(shot, layer))
            with pytest.raises(ArtoError, match=match):
                work.run(many.relight_many(shot, layer, turns=2))
            node.image.pack()
            with pytest.raises(SceneError, match=match):
                check_images(shot.world, 1)
        with pytest.raises(SceneError, match=r"damaged, .*: copy it anew"):
            cut = tmp_path / "cut.exr"
            cut.write_bytes(bad.read_bytes()[:-20])
            check_file(cut)
    finally:
        node.image = theirs


def test_a_sequence_of_the_world_that_ends_is_warned_of(shot, tmp_path):
    node, layer = of_world(shot), shot.view_layers[0].name
    for frame in (1, 2):
        exr.write(tmp_path / f"sky_{frame}.exr", {"": np.ones((8, 16, 3), np.float32)})
    theirs, node.image = node.image, bpy.data.images.load(str(tmp_path / "sky_1.exr"))
    node.image.source, node.image_user.frame_duration = "SEQUENCE", 2
    try:
        shown = Shown(shot, layer)
        assert not any("does not last" in said for said in ahead.warnings(shown, shot.world))
        steps = many.relight_many(shot, layer, frames=[2, 3], batch=work.Batch(strict=True))
        with pytest.raises(StrictError, match="does not last until frame 3"):
            work.run(steps)
    finally:
        node.image = theirs


def test_forms_of_names():
    assert form_of("shot.v2_0007.exr") == r"shot\.v2_\d+\.exr"
    assert form_of_tiles("skin.<UDIM>.exr") == r"skin\.\d{4}\.exr"
    assert is_cut(b"II*\0" + bytes(4)) is False  # no page: nothing is missing
    assert is_cut(b"II*\0\xff\xff\xff\xff")


def test_a_texture_that_is_cut_off_is_warned_of(tmp_path, scene):
    """Blender renders grey or magenta in its place, and so does a capture."""
    cut, gone = tmp_path / "cut.jpg", tmp_path / "gone.png"
    cut.write_bytes(saved(tmp_path, "JPEG").read_bytes()[:-30])
    exr.write(whole := tmp_path / "whole.exr", {"": NOISE})
    nodes = scene.objects["Floor"].active_material.node_tree.nodes
    for path in (cut, gone, whole):
        image = bpy.data.images.new(path.name, 4, 4)
        image.source, image.filepath = "FILE", str(path)
        nodes.new("ShaderNodeTexImage").image = image
    found = fingerprint(scene, scene.view_layers[0].name)
    said = incomplete_images(found, 1)
    assert len(said) == 2 and "cut.jpg is damaged" in said[0] and "gone.png is not there" in said[1]
    steps = work.strictly(capture(scene, scene.view_layers[0].name))
    with pytest.raises(StrictError, match=r"cut\.jpg"):
        while not isinstance(next(steps), work.Render):
            pass
