"""`python -m bench COMMAND`: every figure of this project comes from one of these."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path


def _demo(options: argparse.Namespace) -> None:
    from .demo import demo

    report = demo(
        options.out,
        options.scene,
        options.hdri,
        (options.width, options.width * 3 // 4),
        options.samples,
        options.many,
    )
    print(json.dumps(report, indent=1))
    print(f"look at {options.out / 'comparison.png'}")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    c = commands.add_parser("demo", help="capture, fit, relight a scene; compare with Cycles")
    c.add_argument("--out", type=Path, default=Path("out/demo"))
    c.add_argument("--scene", default="product")
    c.add_argument("--hdri", default="courtyard")
    c.add_argument("--width", type=int, default=160)
    c.add_argument("--samples", type=int, default=128)
    c.add_argument("--many", type=int, default=512, help="samples of each of two references")
    c.set_defaults(run=_demo)

    options = parser.parse_args()
    options.run(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
