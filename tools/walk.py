"""The pictures of an artist's hour: `python -m tools.walk docs/walk`.

They are taken by the tests that walk it (tests/test_walk.py, tests/test_light_walk.py), in the real
Blender with its window: needs Linux, Xvfb, xdotool, ImageMagick, and BLENDER, the command line of
the Blender executable.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from . import package


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.walk", description=__doc__)
    parser.add_argument("folder", type=Path, help="for the pictures; emptied before")
    folder = parser.parse_args().folder.resolve()
    if not os.environ.get("BLENDER"):
        print("walk: BLENDER is not set: the command line of the Blender to walk in")
        return 1
    shutil.rmtree(folder, ignore_errors=True)
    tests = ["tests/test_walk.py", "tests/test_light_walk.py"]
    line = [sys.executable, "-m", "pytest", "-q", "-rs", *tests]
    environment = {**os.environ, "ARTO_WALK": str(folder)}
    return subprocess.run(line, cwd=package.ROOT, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
