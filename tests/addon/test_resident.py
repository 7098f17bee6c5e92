"""The resident renderer: one preparation for all suns, and an end when it is not wanted."""

from __future__ import annotations

import json
import os
import queue
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import bpy
import numpy as np
import pytest
from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.job import snapshot
from arto.arto_addon.resident import making, prepared, serve
from arto.arto_addon.resident.resident import ANSWER, STOP
from arto.arto_addon.shot import home
from arto.arto_addon.world.lamp_render import lamp_light
from arto.core import arrays
from arto.core.errors import CancelledError
from arto.core.field.field import Field
from arto.core.light.environment import Environment
from arto.core.light.lamps import split
from scene_tools import captured, small_scene

from bench.heavy import counted


def sunny() -> np.ndarray:
    """An even sky with a sun in it, high at one side."""
    image = np.full((64, 128, 3), 0.1, np.float32)
    image[16:18, 30:32] = 300.0
    return image


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> prepared.Question:
    """A question about the suns of a shot that was captured."""
    folder = tmp_path_factory.mktemp("resident")
    scene = small_scene(folder)
    scene.arto.samples, scene.arto.support = 4, "auto"
    field = Path(work.run(fit.fit(scene)) if captured(scene) else "")
    field = field if field.is_dir() else field.parent
    (folder / "snapshot").mkdir()
    layer = scene.view_layers[0].name
    blend, task = snapshot.take(folder / "snapshot", "relight", scene, layer)
    return prepared.Question(
        file=asdict(prepared.File(str(blend), str(task), False)), field=str(field), key="sunny",
        full=False, map="", turn=0.0, resting=True, factor=1, samples=64, seconds=60.0, clean=False,
        picture="", suns=True, strength=1.0, out=str(folder / "suns.npy"),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def _back() -> Iterator[None]:
    """Forget afterwards that this process worked on a copy of a file."""
    yield
    home._home.clear()


def test_two_suns_in_a_row_prepare_the_scene_once(asked: prepared.Question) -> None:
    """And each is where the world has it: its picture is that of a relight's render."""
    maps = making.Maps()
    there = prepared.Prepared(maps, lambda _: None)
    said = asdict(asked)
    assert there.answer(said) == {"lacks": True}
    maps.keep("sunny", False, sunny())
    pictures = []
    with counted() as count:
        for turn in (0.0, 2.0):
            assert "picture" in there.answer(said | {"turn": turn})
            pictures.append(np.array(arrays.read(Path(asked.out), 1 << 20)))
        # another map, and fewer samples, while the light moves
        maps.keep("other", False, np.roll(sunny(), 40, axis=1))
        there.answer(said | {"key": "other", "resting": False, "samples": 63})
        pictures.append(np.array(arrays.read(Path(asked.out), 1 << 20)))
    assert count.renders == 3 and count.prepared_times == 1
    objects = len([o for o in bpy.context.scene.objects if o.type == "MESH"])
    assert count.synchronized <= objects
    there.let_go()
    scene, field = bpy.context.scene, Field(Path(asked.field))
    lit = [(0.0, sunny()), (2.0, sunny()), (0.0, np.roll(sunny(), 40, axis=1))]
    for (turn, image), picture in zip(lit, pictures, strict=True):
        suns = split(Environment(image, turn)).lamps
        expected = work.run(lamp_light(scene, field, suns, 64))
        off = np.abs(picture[..., :3] - expected).mean() / expected.mean()
        assert off < 0.12, off
    # the shadows are elsewhere
    assert np.abs(pictures[0] - pictures[1])[..., :3].mean() > 0.3 * pictures[0][..., :3].mean()


class _Heard:
    """What a window says, made up."""

    def __init__(self, *lines: str | None) -> None:
        self._lines = list(lines)

    def next(self, seconds: float) -> str | None:
        if not self._lines:
            raise queue.Empty
        return self._lines.pop(0)

    def begin(self) -> None: ...
    def finish(self) -> None: ...
    def step(self, step: object = None) -> None: ...


def said(capsys: pytest.CaptureFixture[str]) -> list[dict]:
    lines = capsys.readouterr().out.splitlines()
    return [json.loads(x.removeprefix(ANSWER)) for x in lines if x.startswith(ANSWER)]


def test_it_ends_when_nothing_was_asked_for_long_and_when_the_input_closes(capsys) -> None:
    question = json.dumps({"kind": "no such kind"})
    assert serve.serve(0.0, _Heard(question)) == 0
    first, last = said(capsys)
    assert "no such kind" in first["error"] and first["bytes"] > 0
    assert last == {"ended": "nothing was asked for long"}
    assert serve.serve(1e6, _Heard(question, None)) == 0
    assert len(said(capsys)) == 1


def test_it_ends_when_memory_is_short(capsys, monkeypatch) -> None:
    assert not serve.too_much(4 << 30, 16 << 30, 8 << 30)
    assert not serve.too_much(None, 16 << 30, None)
    assert "9.7 GB" in serve.too_much(9 << 30, 16 << 30, 8 << 30)
    assert "are to stay free" in serve.too_much(1 << 30, 16 << 30, 1 << 29)
    monkeypatch.setattr(serve, "taken", lambda: 9 << 30)
    monkeypatch.setattr(serve, "memory", lambda: (16 << 30, 8 << 30))
    assert serve.serve(1e6, _Heard()) == 0
    assert said(capsys)[-1]["ended"].startswith("memory is short")


def test_work_that_nobody_wants_any_more_is_stopped() -> None:
    ear, mouth = os.pipe()
    heard = serve.Heard(ear)
    os.write(mouth, f"{STOP}\nquestion\n".encode())
    assert heard.next(10) == "question"
    heard.begin()
    heard.step()  # what came before the question does not count
    os.write(mouth, f"{STOP}\n".encode())
    with pytest.raises(CancelledError):
        for _ in range(10**7):
            heard.step()
