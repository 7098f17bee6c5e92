"""The real program, set up once for all tests that need it."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from arto.core.exr import open_image_io
from program_tools import MAKE_SCENE, Program, said

from tools import package


def own_modules() -> Path:
    """The folder of what the module bpy brings for Python, found without loading bpy."""
    (bpy,) = importlib.util.find_spec("bpy").submodule_search_locations
    return next(Path(bpy).glob("*/python/lib/**/OpenImageIO")).parent


# Every test that imports OpenImageIO has Blender's own.
open_image_io.imported([own_modules()])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Make a scene anew that tests share, where a test between them has opened another file.

    Workers take tests from each other, so those of a module run in any order.
    """
    for *_, fixture in item._fixtureinfo.name2fixturedefs.values():  # type: ignore[attr-defined]
        if fixture.cached_result is not None and _is_removed(fixture.cached_result[0]):
            fixture.finish(item._request)  # type: ignore[attr-defined]


def _is_removed(value: object) -> bool:
    """Whether a value is a scene that is not in Blender any more."""
    if type(value).__name__ != "Scene" or not hasattr(type(value), "bl_rna"):
        return False
    try:
        return not value.name  # type: ignore[attr-defined]
    except ReferenceError:
        return True


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is in the real program comes first: these are the longest tests, and none of them should
    be left alone at the end of a run of several workers."""
    items.sort(key=lambda item: "program" not in getattr(item, "fixturenames", ()))


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    if not os.environ.get("BLENDER"):
        pytest.skip(
            "BLENDER is not set: it is the command line of the Blender executable to test in"
        )
    home = tmp_path_factory.mktemp("blender")
    out = Program(home)
    zipped = package.build()
    install = ("--command", "extension", "install-file", "-r", "user_default", "--enable", zipped)
    done = out.run(*install)
    assert 'Installed "arto"' in done.stdout, said(done)
    yield out
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture(scope="session")
def made(program: Program, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene.blend and what Cycles itself shows of it."""
    folder = tmp_path_factory.mktemp("made")
    program.script(MAKE_SCENE, folder / "scene.blend", "camera")
    return folder
