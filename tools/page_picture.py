"""Photograph a page that relights: `python -m tools.page_picture PAGE.html OUT.png`."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

# Without a window and a graphics card, Chromium draws WebGL by the processor.
OPTIONS = (
    *("--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--hide-scrollbars", "--force-color-profile=srgb"),
    *("--disable-dev-shm-usage", "--virtual-time-budget=60000"),
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.page_picture", description=__doc__)
    parser.add_argument("page", type=Path, help="that is one file")
    parser.add_argument("out", type=Path, help="a PNG file")
    parser.add_argument("--size", nargs=2, type=int, default=(1280, 760))
    options = parser.parse_args()
    browser = os.environ.get("CHROMIUM") or shutil.which("chromium")
    if not browser:
        parser.error("no Chromium is found on PATH, nor named by the variable CHROMIUM")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        size = "--window-size={},{}".format(*options.size)
        shot = f"--screenshot={options.out.resolve()}"
        address = options.page.resolve().as_uri()
        command = [browser, *OPTIONS, f"--user-data-dir={profile}", size, shot, address]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    print(f"look at {options.out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
