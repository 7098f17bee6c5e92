"""Scripts for compositors compute the mix: what their nodes make of a plate's files is what ARTO's
own pictures are."""

from __future__ import annotations

import mix_tools
import numpy as np
import pytest
from arto.core.catcher import Caught
from arto.core.mix.fusion import fusion_comp
from arto.core.mix.mix import Behind, Layer, Mix, composed, mixed
from arto.core.mix.nuke import node_name, nuke_script

SIZE = (6, 4)
NAMES = ("LG_key", "LG_fill light", "own", "LG_fill_light")
RUNS = {"nuke": (nuke_script, mix_tools.nuke), "fusion": (fusion_comp, mix_tools.fusion)}


def pictures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    shape = (SIZE[1], SIZE[0])
    return {
        **{name: rng.exponential(size=(*shape, 3)) for name in NAMES},
        "alpha": rng.random(shape),
        "things": rng.random(shape),
        "caught": rng.normal(0.5, 0.5, (*shape, 3)),
        "footage": rng.random((*shape, 3)),
    }


def channels(picture: np.ndarray, prefix: str = "") -> dict[str, np.ndarray]:
    return {f"{prefix}{c}": picture[..., i] for i, c in enumerate("RGBA"[: picture.shape[-1]])}


def shot(each: bool, shadows) -> tuple[Mix, dict[str, dict[str, np.ndarray]], dict]:
    """A mix, its files on disk by path, and the pictures in them."""
    made = pictures()
    layers = tuple(
        Layer(name, 0.4 + i, (1.0, 0.5, 0.25 * i), f"a [x] ${i}.exr" if each else None)
        for i, name in enumerate(NAMES)
    )
    caught = None if shadows is None else Behind(shadows, "a_caught.exr", "/foot age/f [1].exr")
    mix = Mix("a.exr", SIZE, layers, None if each else "a_layers.exr", 0.7, caught)
    plate = np.dstack([sum(made[name] for name in NAMES), made["alpha"]])
    # the light of the ground has the things' alpha, which is not the plate's
    caught_file = (
        np.dstack([made["caught"], made["things"]]) if shadows == "ADD" else made["caught"]
    )
    files = {"/shot/a.exr": channels(plate), "/shot/a_caught.exr": channels(caught_file)}
    files["/foot age/f [1].exr"] = channels(made["footage"])
    if each:
        files |= {
            f"/shot/{one.file}": channels(np.dstack([made[one.name], made["alpha"]]))
            for one in layers
        }
    else:
        every = [channels(plate), *(channels(made[name], f"{name}.") for name in NAMES)]
        files["/shot/a_layers.exr"] = {k: v for part in every for k, v in part.items()}
    return mix, files, made


@pytest.mark.parametrize("each", [False, True])
@pytest.mark.parametrize("program", RUNS)
def test_a_script_adds_up_the_layers(program: str, each: bool) -> None:
    mix, files, made = shot(each, None)
    write, run = RUNS[program]
    found = run(write(mix), files)["Mix"]
    expected = sum(
        made[name] * (0.4 + i) * np.array([1.0, 0.5, 0.25 * i]) for i, name in enumerate(NAMES)
    )
    np.testing.assert_allclose(mix_tools.rgb(found), expected * 2**0.7, rtol=1e-6)
    np.testing.assert_array_equal(found["rgba.alpha"], made["alpha"])
    np.testing.assert_allclose(mixed(mix, made), expected * 2**0.7, rtol=1e-12)


@pytest.mark.parametrize("shadows", ["MULTIPLY", "ADD"])
@pytest.mark.parametrize("program", RUNS)
def test_a_script_puts_the_things_into_footage_as_the_catcher_does(program: str, shadows) -> None:
    mix, files, made = shot(False, shadows)
    write, run = RUNS[program]
    found = mix_tools.rgb(run(write(mix), files)["Composite"])
    light = mixed(mix, made)
    caught = Caught(light, made["things"], made["caught"], made["caught"])
    of = caught.over if shadows == "MULTIPLY" else caught.added_to
    np.testing.assert_allclose(found, of(made["footage"]), rtol=1e-5)
    both = np.dstack([made["caught"], made["things"]])
    own = composed(mix, light, both if shadows == "ADD" else made["caught"], made["footage"])
    np.testing.assert_allclose(own, of(made["footage"]), rtol=1e-5)


def test_layers_whose_names_would_be_one_node_are_two() -> None:
    names = [node_name(name) for name in ("a b", "a_b", "a-b", "1", "ä")]
    assert len(set(names)) == 5 and names[1] == "a_b"
