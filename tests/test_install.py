"""The extension's zip: what is in it, and how the real program takes it, by its address too."""

from __future__ import annotations

import json
import os
import threading
import tomllib
import zipfile
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from program_tools import Program, said

from tools import package

# What a zip of text and pictures may hold: no library, no wheel, no other archive.
KINDS = {".py", ".toml", ".md", ".js", ".css", ".html", ".png", ""}
# Of a tagline and of what a permission is for: the platform's rule.
LONGEST = 64


@pytest.fixture(scope="module")
def zipped() -> Path:
    return package.build()


@pytest.fixture
def bare(tmp_path: Path) -> Program:
    """The real program without any extension."""
    if not os.environ.get("BLENDER"):
        pytest.skip("BLENDER is not set")
    return Program(tmp_path / "home")


@pytest.fixture
def address(zipped: Path, tmp_path: Path) -> Iterator[str]:
    """Where a web server on this machine offers the repository."""
    folder = package.repository(zipped, tmp_path / "repository").parent

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/index.json"
        server.shutdown()


def test_one_zip_without_binaries_is_for_all_platforms(zipped: Path) -> None:
    assert zipped.name.count("-") == 1  # a platform would be in its name
    with zipfile.ZipFile(zipped) as file:
        names = file.namelist()
        manifest = tomllib.loads(file.read("blender_manifest.toml").decode())
        pictures = [file.read(n) for n in names if n.endswith(".png")]
        texts = [file.read(n) for n in names if not n.endswith((".png", "/"))]
    assert {Path(n).suffix for n in names} <= KINDS
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)
    assert not any(b"\0" in text for text in texts)
    assert {"core/exr/library.py", "arto_addon/__init__.py", "LICENSE"} <= set(names)
    assert not any(n.startswith(("tests", "bench", "tools")) or "__pycache__" in n for n in names)
    assert not {"platforms", "wheels"} & manifest.keys()


def test_the_manifest_is_as_the_platform_asks(zipped: Path) -> None:
    with zipfile.ZipFile(zipped) as file:
        manifest = tomllib.loads(file.read("blender_manifest.toml").decode())
    for text in manifest["copyright"]:
        year, _, name = text.partition(" ")
        assert all(y.isdecimal() for y in year.split("-")) and name.strip()
    assert manifest["permissions"].keys() <= {"files", "network", "clipboard", "camera"}
    for text in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(text) <= LONGEST and text[-1].isalnum() and text == text.strip()


def test_blender_itself_finds_no_fault_in_the_zip(bare: Program, zipped: Path) -> None:
    done = bare.run("--command", "extension", "validate", zipped)
    assert done.returncode == 0 and "Success" in done.stdout, said(done)


def test_it_is_installed_by_its_address(bare: Program, address: str) -> None:
    """From a repository of files alone, without any other server being asked."""
    extension = ("--online-mode", "--command", "extension")
    bare.run(*extension, "repo-add", "--clear-all", "--url", address, "arto_here")
    done = bare.run(*extension, "install", "--sync", "--enable", "arto_here.arto")
    assert 'Installed "arto"' in done.stdout, said(done)
    found = bare.script(
        "import json, sys\n"
        "from bl_ext.arto_here.arto.core import exr\n"
        "print('FOUND', json.dumps([exr.chosen().name, 'OpenEXR' in sys.modules]))"
    )
    line = next(n for n in found.stdout.splitlines() if n.startswith("FOUND"))
    assert json.loads(line.removeprefix("FOUND")) == ["OpenImageIO", False]


def test_a_blender_without_openimageio_names_the_package(program: Program) -> None:
    """ARTO is then not enabled, and leaves nothing of itself registered."""
    program.script(
        "import bpy, sys\n"
        "name = 'bl_ext.user_default.arto'\n"
        "bpy.ops.preferences.addon_disable(module=name)\n"
        "sys.modules['OpenImageIO'] = None\n"
        "try:\n"
        "    bpy.ops.preferences.addon_enable(module=name)\n"
        "except RuntimeError as e:\n"
        "    assert 'python3-openimageio' in str(e), e\n"
        "else:\n"
        "    raise AssertionError('it was enabled')\n"
        "assert name not in bpy.context.preferences.addons\n"
        "assert not hasattr(bpy.types.Scene, 'arto')\n"
    )
