"""The extension in the real program: built, installed from its zip, and run as artists run it.

These need a Blender executable: BLENDER is the command line that starts it. Preferences and
extensions go to a folder of their own; a person's own are not touched.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from arto.core import exr
from program_tools import HEIGHT, MAKE_SCENE, ROOT, WIDTH, Program, said

# Mean relative error that 2x2 patches a face and 256 samples may leave; 0.02 was measured.
TOLERANCE = 0.05
BATCH = "import bpy; bpy.ops.arto.capture(); bpy.ops.arto.fit(); bpy.ops.arto.relight()"


@pytest.fixture
def scene(made: Path, tmp_path: Path) -> Path:
    """The scene's .blend, in a folder of the test's own."""
    return Path(shutil.copy(made / "scene.blend", tmp_path))


@pytest.fixture(scope="session")
def reference(made: Path) -> np.ndarray:
    return next(iter(exr.read(made / "scene.blend.reference.exr").values()))[..., :3]


def relit(folder: Path) -> np.ndarray:
    """The one relit EXR that lies beside the scene -> (H, W, 4)."""
    (path,) = folder.glob("*.exr")
    return next(iter(exr.read(path).values()))


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means over 8x8 pixels: most of the noise of few samples is gone from them."""
    return picture[..., :3].reshape(HEIGHT // 8, 8, WIDTH // 8, 8, 3).mean(axis=(1, 3))


def check_picture(picture: np.ndarray, reference: np.ndarray) -> None:
    """Complete, and what Cycles shows, but for noise and coarse patches."""
    assert picture.shape == (HEIGHT, WIDTH, 4)
    assert np.isfinite(picture).all()
    assert (picture[..., 3] == 1).all()  # the world behind is in it
    found, expected = blocks(picture), blocks(reference)
    assert found.mean() == pytest.approx(expected.mean(), rel=TOLERANCE)
    assert (np.abs(found - expected) / expected).mean() < TOLERANCE


def check_quiet(done: subprocess.CompletedProcess[str]) -> None:
    """No complaint of an OpenEXR that works on another's data, no Python error."""
    assert "EXR_ERR" not in done.stdout + done.stderr, said(done)
    assert "Traceback" not in done.stdout + done.stderr, said(done)


def test_batch_line(program: Program, scene: Path, reference: np.ndarray) -> None:
    """Nothing is written beside the extension's code."""
    code = program.home / "extensions" / "user_default" / "arto"

    def files() -> set[Path]:
        return {p for p in code.rglob("*") if p.is_file() and p.suffix != ".pyc"}

    before = files()
    done = program.run("-b", scene, "--python-exit-code", "1", "--python-expr", BATCH)
    assert done.returncode == 0, said(done)
    check_quiet(done)
    for job in ("capture", "fit", "relight"):
        assert re.search(rf"^ARTO {job}: 100%", done.stdout, re.MULTILINE), said(done)
    check_picture(relit(scene.parent), reference)
    assert before and files() == before


def test_command(program: Program, scene: Path, reference: np.ndarray) -> None:
    """The three jobs in three processes, their files where the options say."""
    folder, output = scene.parent / "kept", scene.parent / "out" / "picture.exr"
    jobs = (
        ("capture", "--folder", folder, "--patches", "1", "--samples", "32", "--faces", "top"),
        ("capture", "--folder", folder, "--preset", "full", "--patches", "2", "--samples", "256"),
        ("fit", "--folder", folder, "--support", "auto"),
        ("relight", "--folder", folder, "--output", output, "--environment-width", "512"),
    )
    for job in jobs:
        done = program.run("-b", scene, "--command", "arto", *job)
        assert done.returncode == 0, said(done)
        check_quiet(done)
        assert f"ARTO {job[0]}: 100%" in done.stdout
    check_picture(relit(output.parent), reference)
    assert not (scene.parent / "arto").exists()


def test_command_help(program: Program) -> None:
    done = program.run("--command", "arto", "--help")
    assert done.returncode == 0, said(done)
    for job in ("capture", "fit", "relight"):
        assert job in done.stdout
    done = program.run("--command", "arto", "capture", "--help")
    assert done.returncode == 0, said(done)
    assert "--patches" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("fit",), 1, "run Capture first"),
        (("relight",), 1, "ARTO: "),
        (("capture", "--patches", "17"), 2, "out of range"),
        (("capture", "--no-such"), 2, "--no-such"),
        (("develop",), 2, "develop"),
        (("fit", "--scene", "Nowhere"), 2, "no scene 'Nowhere'"),
    ],
)
def test_command_failures(
    program: Program, scene: Path, arguments: tuple[str, ...], code: int, message: str
) -> None:
    done = program.run("-b", scene, "--command", "arto", *arguments)
    assert done.returncode == code, said(done)
    assert message in done.stderr, said(done)
    check_quiet(done)


def test_without_camera(program: Program, tmp_path: Path) -> None:
    path = tmp_path / "scene.blend"
    program.script(MAKE_SCENE, path, "none")
    done = program.run("-b", path, "--command", "arto", "capture")
    assert done.returncode == 1, said(done)
    assert "the scene has no camera" in done.stderr
    done = program.run("-b", path, "--python-exit-code", "1", "--python-expr", BATCH)
    assert done.returncode == 1, said(done)
    assert "The scene has no camera" in done.stdout + done.stderr, said(done)


def test_batch_stops_at_the_first_failure(program: Program, scene: Path) -> None:
    line = "import bpy; bpy.ops.arto.fit(); bpy.ops.arto.relight()"
    done = program.run("-b", scene, "--python-exit-code", "1", "--python-expr", line)
    assert done.returncode == 1, said(done)
    assert "Capture the scene first" in done.stdout + done.stderr, said(done)


# Presses the buttons one after the other, as an artist would who waits for each. Its arguments: a
# list of (operator, whether it is cancelled while it renders), and the report to write: what is in
# the file before and after each.
BUTTONS = """
import json, sys, time, traceback
import bpy

presses, report = json.loads(sys.argv[-2]), sys.argv[-1]
found = []
state = {"at": -1, "since": 0.0, "cancelled": False}


def contents():
    render = bpy.context.scene.render
    kinds = ("scenes", "objects", "meshes", "materials", "worlds", "collections", "cameras")
    return {
        **{kind: len(getattr(bpy.data, kind)) for kind in kinds},
        "samples": bpy.context.scene.cycles.samples,
        "filepath": render.filepath,
        "size": [render.resolution_x, render.resolution_y],
        "groups": len(bpy.context.view_layer.lightgroups),
        "display": bpy.context.preferences.view.render_display_type,
        "handlers": len(bpy.app.handlers.render_complete),
    }


session = next(m for n, m in sys.modules.items() if n.endswith(".arto_addon.job.session"))


def running(window):
    # a job's end waits for no hand on the mouse: none is
    return session.current is not None


def step():
    window = bpy.context.window_manager.windows[0]
    if state["at"] >= 0 and running(window):
        operator, cancels = presses[state["at"]]
        late = time.monotonic() - state["since"]
        if late > 120:
            raise TimeoutError(operator)
        now = session.current.state
        if "basis images" in now.text and state["share"] is None:
            state["share"] = now.share
        # once samples were rendered: Blender forgets what comes before its render has begun
        sampled = state["share"] is not None and now.share > state["share"]
        if cancels and sampled and not state["cancelled"]:
            state["cancelled"] = True
            bpy.ops.arto.cancel()  # as the cross does
        return 0.02
    if state["at"] >= 0:
        found[-1]["after"] = contents()
        found[-1]["cancelled"] = state["cancelled"]
        found[-1]["outcome"] = [session.outcome.level, session.outcome.text]
    state["at"] += 1
    if state["at"] == len(presses):
        nodes = bpy.context.scene.compositing_node_group
        image = bpy.data.images.get("ARTO Relit")
        end = {
            "nodes": [n.bl_idname for n in nodes.nodes] if nodes else [],
            "image": list(image.size) if image else None,
        }
        finish({"presses": found, **end})
        return None
    operator, _ = presses[state["at"]]
    found.append({"operator": operator, "before": contents()})
    state.update(since=time.monotonic(), cancelled=False, share=None)
    area = next(a for a in window.screen.areas if a.type == "PROPERTIES")
    with bpy.context.temp_override(window=window, area=area):
        getattr(bpy.ops.arto, operator)("INVOKE_DEFAULT")
    return 0.02


def finish(what):
    with open(report, "w") as f:
        json.dump(what, f)
    bpy.ops.wm.quit_blender()


def safely():
    try:
        return step()
    except BaseException:
        finish({"error": traceback.format_exc()})


bpy.app.timers.register(safely, first_interval=1.0)
"""


def press(program: Program, scene: Path, *presses: tuple[str, bool]) -> dict:
    """Press buttons in the program's window -> what was there before and after each."""
    if not shutil.which("xvfb-run"):
        pytest.skip("xvfb-run is not installed: the window needs it")
    script, report = scene.parent / "press.py", scene.parent / "report.json"
    script.write_text(BUTTONS)
    window = (scene, "--python", script, "--", json.dumps(presses), report)
    done = program.run(*window, screen=True)
    assert report.is_file(), said(done)
    out = json.loads(report.read_text())
    assert "error" not in out, out["error"] + said(done)
    check_quiet(done)
    return out


def test_buttons(program: Program, scene: Path, reference: np.ndarray) -> None:
    out = press(program, scene, ("capture", False), ("fit", False), ("relight", False))
    for pressed in out["presses"]:
        assert pressed["outcome"][0] == "INFO", pressed
    for pressed in out["presses"][:2]:
        assert pressed["before"] == pressed["after"]
    assert out["image"] == [WIDTH, HEIGHT]
    assert "CompositorNodeGroup" in out["nodes"]
    check_picture(relit(scene.parent), reference)


def test_cancelled_in_the_middle(program: Program, scene: Path) -> None:
    """The cross during the capture's render leaves the scene as it was, and no half tile."""
    program.script(
        "import bpy, sys; path = sys.argv[-1]; bpy.ops.wm.open_mainfile(filepath=path);"
        "bpy.context.scene.arto.samples = 1 << 16; bpy.ops.wm.save_mainfile()",
        scene,
    )
    out = press(program, scene, ("capture", True))
    (pressed,) = out["presses"]
    assert pressed["cancelled"]
    assert pressed["outcome"][0] == "WARNING" and "cancelled" in pressed["outcome"][1]
    assert pressed["before"] == pressed["after"]
    # (what a job that took too long to end was writing has another name, and goes with the next)
    assert not list((scene.parent / "arto").rglob("*.exr"))


def test_interrupted_in_batch(program: Program, scene: Path) -> None:
    """Ctrl-C during the first of several tiles: exit code 130, no half file, and the capture can
    be made after it. (That finished tiles are kept is tested in tests/addon.)"""
    capture = [*program.command, "-b", scene, "--command", "arto", "capture", "--patches", "4"]
    line = [*map(str, capture), "--memory", "16", "--samples"]
    running = subprocess.Popen(
        [*line, "20000"], cwd=ROOT, env=program.environment, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip
    printed = ""
    for text in running.stdout:
        printed += text
        if "render 1 of" in text:
            break
    # the planes are being made, or the render has begun: either is told of one signal
    os.killpg(running.pid, signal.SIGINT)
    printed += running.stdout.read()
    assert running.wait(60) == 130, printed
    assert "cancelled" in printed
    head = json.loads(next((scene.parent / "arto").rglob("capture.json")).read_text())
    assert len(head["tiles"]) > 1 and not any(t["done"] for t in head["tiles"])
    assert not list((scene.parent / "arto").rglob("*.exr*"))
    done = program.run(*map(str, capture[len(program.command) :]), "--memory", "16")
    assert done.returncode == 0, said(done)


def test_the_last_line_is_the_estimate(program: Program, scene: Path) -> None:
    """Blender says more when it ends, and keeps some of its lines back until then."""
    done = program.run("-b", scene, "--command", "arto", "capture", "--estimate")
    assert done.returncode == 0, said(done)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["renders"] >= 1 and found["disk"] > 0
