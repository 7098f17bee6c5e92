"""Build the extension: `python -m tools.package` writes dist/arto-<version>.zip.

    python -m tools.package           for every platform that the wheels of OpenEXR are taken for
    python -m tools.package --here    for this machine's platform only; quicker, for tests

The wheels are downloaded into wheels/ once. What ships is copied into build/extension/, the
manifest there is told of platforms and wheels, and Blender's own tool, which comes with the module
`bpy`, builds the zip and validates it.
"""

from __future__ import annotations

import argparse
import importlib.util
import platform
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from .wheel_symbols import copy_symbolic

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = (
    "__init__.py", "arto_addon", "core", "LICENSE", "README.md", "docs/guide.md", "docs/walk",
)  # fmt: skip
# Blender 4.5 runs the first, the official 5.2 the second, and Linux distributions build that with
# the third. All wheels go into one zip: Blender unpacks the one of its own Python and platform, and
# passes by the others.
PYTHONS = ("3.11", "3.13", "3.14")


@dataclass(frozen=True)
class Target:
    """A platform: what Blender calls it, what wheels call it, and what Python's `platform` does."""

    blender: str
    wheel: str
    machine: tuple[str, str]


TARGETS = (
    Target("linux-x64", "manylinux_2_28_x86_64", ("Linux", "x86_64")),
    Target("windows-x64", "win_amd64", ("Windows", "AMD64")),
    Target("macos-arm64", "macosx_11_0_arm64", ("Darwin", "arm64")),
    Target("macos-x64", "macosx_10_15_x86_64", ("Darwin", "x86_64")),
)


class PackageError(Exception):
    """The extension cannot be built; the message says why."""


def here() -> Target:
    """This machine's platform. Raises PackageError for one that there are no wheels for."""
    found = (platform.system(), platform.machine())
    for target in TARGETS:
        if target.machine == found:
            return target
    raise PackageError(f"there are no wheels for {' '.join(found)}: build without --here")


def requirement() -> str:
    """The requirement on OpenEXR, with its version, as pyproject.toml has it."""
    with (ROOT / "pyproject.toml").open("rb") as f:
        wanted = tomllib.load(f)["project"]["dependencies"]
    return next(r for r in wanted if r.startswith("OpenEXR=="))


def wheel(target: Target, python: str) -> Path:
    """The wheel of OpenEXR for a platform and a Python, downloaded unless it is there."""
    version = requirement().partition("==")[2]
    tag = "cp" + python.replace(".", "")
    path = ROOT / "wheels" / f"openexr-{version}-{tag}-{tag}-{target.wheel}.whl"
    if not path.is_file():
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        pip += ["--only-binary=:all:", "--python-version", python, "--platform", target.wheel]
        _run([*pip, "--dest", str(path.parent), requirement()])
    if not path.is_file():
        raise PackageError(f"pip found no {path.name}: see what it left in {path.parent}")
    return path


def manifest(text: str, targets: tuple[Target, ...], wheels: list[str]) -> str:
    """The repository's manifest with platforms and wheels, before its first table."""
    head, table, tail = text.partition("\n[")
    names = "".join(f'    "./wheels/{w}",\n' for w in wheels)
    platforms = ", ".join(f'"{t.blender}"' for t in targets)
    return f"{head}platforms = [{platforms}]\nwheels = [\n{names}]\n{table}{tail}"


def stage(folder: Path, targets: tuple[Target, ...]) -> None:
    """Copy what ships into `folder`, emptied before."""
    wheels = [wheel(target, python) for target in targets for python in PYTHONS]
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "wheels").mkdir(parents=True)
    for name in SHIPPED:
        source = ROOT / name
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.is_file():
            shutil.copy(source, folder / name)
    for path in wheels:
        # elsewhere libraries find their own symbols first anyway
        copy = copy_symbolic if "manylinux" in path.name else shutil.copy
        copy(path, folder / "wheels")
    text = (ROOT / "blender_manifest.toml").read_text()
    names = sorted(path.name for path in (folder / "wheels").iterdir())
    (folder / "blender_manifest.toml").write_text(manifest(text, targets, names))


def blender_tool() -> Path:
    """Blender's `blender_ext.py`, which runs in plain Python; found without loading bpy."""
    spec = importlib.util.find_spec("bpy")
    places = spec.submodule_search_locations if spec else None
    for place in places or []:
        for path in Path(place).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"):
            return path
    raise PackageError("the module bpy is missing: install the project with its extra 'dev'")


def build(only_here: bool = False) -> Path:
    """Build and validate the extension; the path of the zip. Raises PackageError."""
    targets = (here(),) if only_here else TARGETS
    staged, dist = ROOT / "build" / "extension", ROOT / "dist"
    stage(staged, targets)
    version = tomllib.loads((staged / "blender_manifest.toml").read_text())["version"]
    # what is for one platform says so, as Blender names it
    suffix = f"-{targets[0].blender}" if only_here else ""
    path = dist / f"arto-{version}{suffix}.zip"
    dist.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    tool = [sys.executable, str(blender_tool())]
    _run([*tool, "build", "--source-dir", str(staged), "--output-filepath", str(path)])
    _run([*tool, "validate", str(path)])
    return path


def _run(command: list[str]) -> None:
    """Run a program quietly. Raises PackageError with what it said if it fails."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise PackageError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.package", description="Build the zip.")
    parser.add_argument("--here", action="store_true", help="for this machine's platform only")
    try:
        print(build(parser.parse_args().here).relative_to(ROOT))
    except PackageError as e:
        print(f"package: {e}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
