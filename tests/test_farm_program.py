"""A farm's job in the real program, run by the command line of Open Job Description."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from arto.core import exr
from arto.core.field.tile_file import TileFile
from program_tools import MAKE_CATCHER, Program, said

# One machine, with the tiles that the job has.
ALONE = """
import bpy
from bl_ext.user_default.arto.arto_addon.capture import planned

planned.tiles_of = lambda region, *_: planned.strips_of(region, 4)
bpy.ops.arto.capture()
"""
# As a farm starts Blender: no preferences, no network, and the one add-on.
QUIET = ("-b", "--factory-startup", "--offline-mode", "--addons", "bl_ext.user_default.arto")


CATCHER = (
    MAKE_CATCHER
    + """
scene.cycles.samples = 32
scene.arto.quality, scene.arto.patches, scene.arto.adaptive = "DRAFT", 1, False
scene.arto.denoise = False
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
"""
)


def arrays(folder: Path) -> dict[str, np.ndarray]:
    (field,) = folder.rglob("field/field.json")
    found = {str(p.relative_to(field.parent)): TileFile(p) for p in field.parent.rglob("*.arto")}
    return {f"{p}/{name}": t.load(name).copy() for p, t in found.items() for name in t.sizes}


def test_an_openjd_job_is_what_one_machine_makes(
    program: Program, made: Path, tmp_path: Path
) -> None:
    """Four parts, one of them killed and run again: the field, bit for bit."""
    one, farm = tmp_path / "one", tmp_path / "farm"
    for folder in (one, farm):
        folder.mkdir()
        shutil.copy(made / "scene.blend", folder)
    done = program.run("-b", one / "scene.blend", "--python-expr", ALONE)
    assert list(one.rglob("field.json")), said(done)
    blend, job = farm / "scene.blend", farm / "job"
    line = ("plan", "--job", job, "--tiles", "4")
    done = program.run(*QUIET, blend, "--command", "arto", *line)
    assert done.returncode == 0, said(done)
    assert json.loads((job / "job.json").read_text())["parts"] == 4

    # what a farm runs, killed while it renders
    part = [*program.command, *QUIET, blend, "--command", "arto", "part", "2", "--job", job]
    killed = subprocess.Popen(
        [str(word) for word in part], env=program.environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    until = time.monotonic() + 240
    while not list(job.glob("parts/part_0002.*.part")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    assert not (job / "parts" / "part_0002").exists()
    done = program.run(*QUIET, blend, "--command", "arto", "gather", "--job", job)
    assert done.returncode == 1 and "4 of 4 parts are not there (0, 1, 2, 3)" in said(done)

    blender = tmp_path / "blender"
    blender.write_text(f'#!/bin/sh\nexec {shlex.join(program.command)} "$@"\n')
    blender.chmod(0o755)
    openjd = [Path(sys.executable).with_name("openjd"), "run", job / "openjd.json", "--verbose"]
    for name, value in {"Blender": blender, "Blend": blend, "Job": job}.items():
        openjd += ["--job-param", f"{name}={value}"]
    ran = subprocess.run(
        [*map(str, openjd), "--step", "Gather", "--run-dependencies"],
        env=program.environment, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout[-3000:] + ran.stderr[-2000:]
    assert "openjd_progress: 100.0" in ran.stdout and "Saved: '" in ran.stdout
    expected, found = arrays(one), arrays(farm)
    assert expected.keys() == found.keys()
    for name, array in expected.items():
        np.testing.assert_array_equal(array, found[name], err_msg=name)
    assert not list((job / "parts").iterdir())


def test_a_shot_with_a_catcher_by_the_lines_of_a_shell(program: Program, tmp_path: Path) -> None:
    """A part for each take, by workers that have no settings: plate and share, bit for bit."""
    pictures = []
    for way in ("one", "farm"):
        blend, job = tmp_path / way / "shot.blend", tmp_path / way / "job"
        blend.parent.mkdir()
        program.script(CATCHER, blend)
        if way == "one":
            done = program.run("-b", blend, "--command", "arto", "capture")
            assert done.returncode == 0, said(done)
        else:
            line = ("plan", "--job", job, "--tiles", "1")
            done = program.run(*QUIET, blend, "--command", "arto", *line)
            assert done.returncode == 0 and "3 takes of 1 with shadow catchers" in said(done)
            environment = {**program.environment, "BLEND": str(blend), "JOB": str(job)}
            lines = (job / "commands.txt").read_text().splitlines()
            assert len(lines) == 4
            for text in lines:
                assert text.startswith("blender ")
                command = shlex.join(program.command) + text.removeprefix("blender")
                done = subprocess.run(
                    ["sh", "-c", command], env=environment, capture_output=True, text=True,
                    timeout=600,
                )  # fmt: skip
                assert done.returncode == 0, said(done)
        done = program.run("-b", blend, "--command", "arto", "relight")
        assert done.returncode == 0, said(done)
        files = [blend.parent / f"shot_relit{end}.exr" for end in ("", "_catcher")]
        pictures.append([exr.read(file)[""] for file in files])
    for one, two in zip(*pictures, strict=True):
        np.testing.assert_array_equal(one, two)
    assert pictures[0][1].min() < 0.8, "there is a shadow"
