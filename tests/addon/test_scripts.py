"""Scripts for compositors beside a plate: what their nodes make of its files is the plate, the mix,
and the comp on footage."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import mix_tools
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.blender.compositing import compositor
from arto.arto_addon.plate import plate
from arto.arto_addon.relight import many, relight, scripts
from arto.core import exr
from arto.core.files import whole
from arto.core.mix.mix import Layer, Mix
from scene_tools import captured
from shot_tools import with_catcher

RUNS = {".nk": mix_tools.nuke, ".comp": mix_tools.fusion}


def files_in(folder: Path) -> dict[str, dict[str, np.ndarray]]:
    """The channels of all EXR files of a folder, by path."""
    return {
        str(path): {
            f"{part}.{c}" if part else c: pixels[..., i]
            for part, pixels in exr.read(path).items()
            for i, c in enumerate("RGBA"[: pixels.shape[-1]])
        }
        for path in folder.glob("*.exr")
        if not path.stem.endswith("_data")
    }


def made(path: Path, node: str) -> dict[str, np.ndarray]:
    """What each script beside a plate makes at a node, by ending."""
    files = files_in(path.parent)
    return {
        ending: mix_tools.rgb(
            run(path.with_suffix(ending).read_text("utf-8"), files, str(path.parent))[node]
        )
        for ending, run in RUNS.items()
    }


def test_a_script_makes_the_plate_and_the_mix(lit):
    path, _ = work.run(relight.relight(lit))
    beauty = exr.read(path)[""][..., :3]
    for found in made(path, "Mix").values():
        np.testing.assert_allclose(found, beauty, atol=1e-5 * beauty.max())
    mixer = next(n for n in compositor(lit).nodes if "LG_top" in n.inputs)
    mixer.inputs["LG_top"].default_value, mixer.inputs["Exposure"].default_value = 0.25, 1.0
    mixer.inputs["LG_own Tint"].default_value = (1.0, 0.5, 0.0, 1.0)
    lit.arto.layers_files = "EACH"
    work.run(relight.relight(lit))
    layers = exr.read(plate.layers_file(path))
    gains = {"LG_top": 0.25, "LG_own": np.array([1.0, 0.5, 0.0])}
    mix = sum(layers[name] * gains.get(name, 1.0) for name in layers if name)
    for found in made(path, "Mix").values():
        np.testing.assert_allclose(found, 2 * mix, atol=1e-5 * mix.max())


def test_a_script_that_was_changed_stays(lit):
    path, _ = work.run(relight.relight(lit))
    changed, other = path.with_suffix(".nk"), path.with_suffix(".comp")
    changed.write_text(changed.read_text("utf-8") + "Viewer {\n}\n", "utf-8")
    before = changed.read_bytes()
    said: list[str] = []
    work.run(relight.relight(lit), lambda step: said.append(step.text))
    assert changed.read_bytes() == before and any("it stays" in text for text in said)
    lit.arto.layers = "OFF"
    work.run(relight.relight(lit))
    assert changed.read_bytes() == before and not other.exists()


def test_a_script_of_a_sequence_makes_every_plate_of_it(lit):
    """The files that a compositor finds at a frame add up to the plate of that frame."""
    background = next(n for n in lit.world.node_tree.nodes if n.type == "BACKGROUND")
    strength = background.inputs["Strength"]
    for frame, value in ((1, 1.0), (3, 0.25)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    done = work.run(many.relight_many(lit, lit.view_layers[0].name, frames=range(1, 4)))
    assert [path.stem[-4:] for path in done] == ["0001", "0002", "0003"]
    base = done[0].with_name(done[0].name.replace("0001", "sequence"))
    texts = {ending: base.with_suffix(ending).read_text("utf-8") for ending in RUNS}
    assert "first_frame 1\n last_frame 3" in texts[".nk"]
    assert "origfirst 1\n origlast 3" in texts[".nk"]
    assert "TrimOut = 2" in texts[".comp"] and "GlobalEnd = 3" in texts[".comp"]
    means = []
    for path in done:
        number = path.stem[-4:]
        beauty = exr.read(path)[""][..., :3]
        means.append(beauty.mean())
        # Nuke reads by hashes, Fusion by the name of the first frame
        for ending, named in ((".nk", "####"), (".comp", "0001")):
            files = {
                name.replace(number, named): channels
                for name, channels in files_in(path.parent).items()
                if number in name
            }
            found = mix_tools.rgb(RUNS[ending](texts[ending], files, str(path.parent))["Mix"])
            np.testing.assert_allclose(found, beauty, atol=1e-5 * beauty.max())
    assert means[0] > 1.2 * means[2]


@pytest.mark.parametrize("shadows", ["MULTIPLY", "ADD"])
def test_a_script_makes_the_comp_on_footage(tmp_path, shadows):
    scene = with_catcher(tmp_path, samples=4, patches=1)
    captured(scene)
    scene.arto.layers, scene.arto.layers_half, scene.arto.shadows = "FACES", False, shadows
    path = Path(bpy.path.abspath(scene.arto.output or "//shot_relit.exr"))
    filmed = np.random.default_rng(0).random((18, 24, 4)).astype(np.float32)
    filmed[..., 3] = 1
    folder = tmp_path / "footage"
    folder.mkdir()
    exr.write(folder / "filmed.exr", {"": filmed}, {}, "lin_rec709_scene")
    scene.arto.footage = bpy.data.images.load(str(folder / "filmed.exr"))
    path, _ = work.run(relight.relight(scene))
    comp = exr.read(plate.comp_file(path))[""]
    files = files_in(path.parent) | files_in(folder)
    for ending, run in RUNS.items():
        script = path.with_suffix(ending).read_text("utf-8")
        found = mix_tools.rgb(run(script, files, str(path.parent))["Composite"])
        np.testing.assert_allclose(found, comp[..., :3], atol=2e-5 * comp.max())


def test_what_is_no_file_stays_too(tmp_path):
    mix = Mix("a.exr", (4, 2), (Layer("key"),), together="a_layers.exr")
    os.mkfifo(tmp_path / "a.comp")
    (tmp_path / "a.nk").touch()
    said = [step.text for step in scripts.write(tmp_path / "a.exr", mix, whole)]
    assert len(said) == 1 and "a.comp" in said[0] and (tmp_path / "a.comp").is_fifo()
    assert (tmp_path / "a.nk").read_text("utf-8").count("ARTO mix 0000") == 0
