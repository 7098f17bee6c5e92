"""Build the extension: `python -m tools.package` writes dist/arto-<version>.zip.

One zip is for every platform: the extension holds no binaries. `dist/repository/` becomes a folder
that a web server can offer to Blender as a repository, with the zip and its listing in it.

What ships is copied into build/extension/. Blender's own tool, which comes with the module `bpy`,
builds the zip, validates it and lists it.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DIST, STAGED = ROOT / "dist", ROOT / "build" / "extension"
SHIPPED = (
    "__init__.py", "blender_manifest.toml", "arto_addon", "core", "LICENSE", "README.md",
    "docs/guide.md", "docs/walk",
)  # fmt: skip


class PackageError(Exception):
    """The extension cannot be built; the message says why."""


def build() -> Path:
    """Build and validate the extension; the path of the zip. Raises PackageError."""
    shutil.rmtree(STAGED, ignore_errors=True)
    for name in SHIPPED:
        source, place = ROOT / name, STAGED / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, place, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, place)
    version = tomllib.loads((STAGED / "blender_manifest.toml").read_text())["version"]
    path = DIST / f"arto-{version}.zip"
    DIST.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    _blender_tool("build", "--source-dir", STAGED, "--output-filepath", path)
    _blender_tool("validate", path)
    return path


def repository(zipped: Path, folder: Path) -> Path:
    """Make a folder that Blender takes for a repository once a web server offers it; its listing.

    Raises PackageError.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copy(zipped, folder)
    _blender_tool("server-generate", "--repo-dir", folder)
    return folder / "index.json"


def _blender_tool(command: str, *arguments: str | Path) -> None:
    """Run Blender's `blender_ext.py`, which needs no bpy. Raises PackageError with what it said."""
    spec = importlib.util.find_spec("bpy")
    places = spec.submodule_search_locations if spec else None
    inside = "*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
    tools = [path for place in places or [] for path in Path(place).glob(inside)]
    if not tools:
        raise PackageError("the module bpy is missing: install the project with its extra 'dev'")
    line = [sys.executable, str(tools[0]), command, *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True)
    if done.returncode:
        raise PackageError(f"{' '.join(line)} failed:\n{done.stdout}{done.stderr}")


def main() -> int:
    try:
        path = build()
        listing = repository(path, DIST / "repository")
    except PackageError as e:
        print(f"package: {e}", file=sys.stderr)
        return 1
    print(path.relative_to(ROOT), listing.relative_to(ROOT), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
