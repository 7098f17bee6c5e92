"""`python -m bench COMMAND`: every figure of this project comes from one of these."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from . import (
    finish_command,
    heavy_command,
    match_command,
    mirrors_command,
    photographs_command,
    place_command,
    web_command,
)


def _demo(options: argparse.Namespace) -> None:
    from .demo import demo

    width, samples, many = {"shot": (480, 64, 96), "plate": (160, 128, 512), "looks": (320, 64, 0)}[
        options.what
    ]
    width, samples = options.width or width, options.samples or samples
    many = options.many or many
    size = (width, width * 3 // 4)
    if options.what == "looks":
        from .looks_demo import looks_demo

        sheet = options.picture or options.out / "looks.png"
        for name, seconds in looks_demo(sheet, size, samples, options.out).items():
            print(f"{name}: {seconds:.1f} s")
        print(f"look at {sheet}")
        return
    if options.what == "plate":
        from .plate_demo import plate_demo, table

        sheet = options.picture or options.out / "plates.png"
        print(table(plate_demo(sheet, size, samples, many)))
        print(f"look at {sheet}")
        return

    report = demo(
        options.out,
        options.scene,
        options.hdri,
        size,
        samples,
        many,
        options.picture,
        **{
            name: value
            for name in ("patches", "patterns", "support", "adaptive", "lamps")
            if (value := getattr(options, name)) is not None
        },
    )
    print(f"capture {report['capture_seconds']:.0f} s, a relight {report['relight_seconds']:.1f} s")
    print(f"look at {options.out / 'comparison.png'}")


def _stability(options: argparse.Namespace) -> None:
    from .machine import write_rows
    from .stability import stability, table

    rows = stability()
    write_rows(options.json, rows)
    print(table(rows))


def _safety(options: argparse.Namespace) -> None:
    from .machine import write_rows
    from .safety import safety, table

    rows = safety()
    write_rows(options.json, rows)
    print(table(rows))


def _models(options: argparse.Namespace) -> None:
    from . import scenes, worlds
    from .models import models, table

    rows = models(
        options.json,
        options.scenes or list(scenes.SCENES),
        options.hdris or worlds.hdri_names(),
        (options.width, options.width * 3 // 4),
        options.samples,
        options.many,
    )
    print(table(rows))


def _accuracy(options: argparse.Namespace) -> None:
    import json as reader

    from arto.core.fit.choice import CHOICES, SEARCH

    from . import accuracy_report as report
    from . import scenes
    from .accuracy import accuracy, all_worlds

    if options.quick:
        options.scenes = options.scenes or ["four_spheres", "window"]
        options.worlds = options.worlds or ["courtyard", "city", "sky35"]
        options.turns = [0.0]
        options.width, options.time_width, options.many = 64, 96, 256
    # the search takes longer than all others together
    choices = [c for c in CHOICES if c != SEARCH or not options.quick]
    size, time_size = ((w, w * 3 // 4) for w in (options.width, options.time_width))
    worlds = all_worlds(options.worlds, options.turns)
    rows = accuracy(
        options.json,
        options.scenes or list(scenes.SCENES),
        worlds,
        size,
        time_size,
        options.samples,
        options.many,
        options.lamp_samples,
        choices,
    )
    print(report.table(rows, options.samples), "\n")
    print(report.summary(rows, options.samples), "\n")
    print(report.by_material(rows, options.samples))
    report.plot(options.plot, rows)
    times = reader.loads(options.json.with_suffix(".state.json").read_text())["times"]
    shown = {"four_spheres": "courtyard", "product": "city", "window": "sky35", "soft": "forest"}
    there = {(r["scene"], r["hdri"]) for r in rows}
    cases = [(s, w) for s in times for w in worlds if (s, w.label) in there and not w.degrees]
    picked = [(s, w) for s, w in cases if shown.get(s) == w.name] or cases[:2]
    lamps = options.lamp_samples
    if picked:  # turned worlds alone are not on the sheet
        report.sheet(options.sheet, picked, times, rows, size, options.samples, options.many, lamps)
    print(f"look at {options.plot}" + (f" and {options.sheet}" if picked else ""))


def _noise(options: argparse.Namespace) -> None:
    from .noise import noise, table

    size = (options.width, options.width * 3 // 4)
    print(table(noise(options.json, options.scenes, size, options.samples, options.many)))


def _figure3(options: argparse.Namespace) -> None:
    from .figure3 import figure3

    figure3(options.out, (options.width, options.width * 3 // 4), options.samples)
    print(f"look at {options.out}")


def _colour(options: argparse.Namespace) -> None:
    from .colour import colour, table

    size = (options.width, options.width * 3 // 4)
    print(table(colour(options.json, size, options.samples, options.many)))


def _patterns(options: argparse.Namespace) -> None:
    from arto.core.patterns import MONOMIALS, PATTERN_SETS

    print("| set | patterns | rank | condition | moments that it tells on their own |")
    print("|---|---|---|---|---|")
    for s in PATTERN_SETS.values():
        told = [m for m, seen in zip(MONOMIALS, s.identified, strict=True) if seen]
        print(f"| `{s.name}` | {len(s)} | {s.rank} | {s.condition:.1f} | {', '.join(told)} |")


def _snapshot(options: argparse.Namespace) -> None:
    from .machine import write_rows
    from .snapshot import snapshot, table

    rows = snapshot(options.megabytes)
    if options.json:
        write_rows(options.json, rows)
    print(table(rows))


def _settings(options: argparse.Namespace) -> None:
    from .settings import page, run, table

    rows = run(options.json, options.part, options.seed, options.only)
    if options.page:
        options.page.write_text(page(rows), encoding="utf-8")
    print(table(rows))


def _changes(options: argparse.Namespace) -> None:
    from .changes import page

    if options.page:
        options.page.write_text(page(), encoding="utf-8")
    print(page())


def _field(options: argparse.Namespace) -> None:
    from .field import field, page, table

    rows = []
    for row in field(options.json, options.only):
        rows.append(row)
        print(row["case"], row["status"], row["text"], flush=True)
    if options.page:
        options.page.write_text(page(rows), encoding="utf-8")
    print(table(rows))


def _speed(options: argparse.Namespace) -> None:
    from .speed import speed, table

    only = [(int(w), int(h)) for w, h in (size.split("x") for size in options.sizes or ())]
    text = table(speed(options.json, options.quick, options.samples, only))
    if options.page:
        options.page.write_text(text + "\n", encoding="utf-8")
    print(text)


def _flicker(options: argparse.Namespace) -> None:
    from .flicker import flicker, table

    sizes = options.width, options.frames, options.samples
    print(table(flicker(options.json, options.sheet, options.worlds, *sizes)))
    print(f"look at {options.sheet}")


def _live(options: argparse.Namespace) -> None:
    from .live import live_bench

    live_bench(options.sizes, options.samples, options.json)


def _plates(options: argparse.Namespace) -> None:
    from . import specks
    from .plates import plates, table

    size = (options.width, options.width * 3 // 4)
    if options.specks:
        case = options.thing, options.ground
        rows = specks.specks(options.json, *case, size, options.samples, options.many)
        print(specks.table(rows))
        return
    rows = plates(options.json, options.quick, size, options.samples, options.many)
    text = table(rows)
    if options.page:
        options.page.write_text(text + "\n", encoding="utf-8")
    print(text)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    c = commands.add_parser("demo", help="capture, fit, relight a scene; compare with Cycles")
    c.add_argument("what", nargs="?", choices=("shot", "plate", "looks"), default="shot")
    c.add_argument("--out", type=Path, default=Path("out/demo"))
    c.add_argument("--scene", default="four_spheres")
    c.add_argument("--hdri", default="courtyard")
    c.add_argument("--width", type=int)
    c.add_argument("--samples", type=int)
    c.add_argument("--many", type=int, help="samples of each of two references")
    c.add_argument("--patches", type=int, help="these and the next: the add-on's settings")
    c.add_argument("--patterns")
    c.add_argument("--support")
    c.add_argument("--adaptive", action=argparse.BooleanOptionalAction)
    c.add_argument("--lamps", action=argparse.BooleanOptionalAction)
    c.add_argument("--picture", type=Path, help="put the comparison there as well")
    c.set_defaults(run=_demo)

    c = commands.add_parser("stability", help="hard synthetic cases for every support model")
    c.add_argument("--json", type=Path, default=Path("out/stability.json"))
    c.set_defaults(run=_stability)

    c = commands.add_parser("safety", help="damages and files of others: what comes of each")
    c.add_argument("--json", type=Path, default=Path("out/safety.json"))
    c.set_defaults(run=_safety)

    c = commands.add_parser("models", help="every support model on the same captures")
    c.add_argument("--json", type=Path, default=Path("out/models.json"))
    c.add_argument("--scenes", nargs="+")
    c.add_argument("--hdris", nargs="+")
    c.add_argument("--width", type=int, default=48)
    c.add_argument("--samples", type=int, default=16384)
    c.add_argument("--many", type=int, default=8192, help="samples of each of two references")
    c.set_defaults(run=_models)

    c = commands.add_parser("accuracy", help="error against time, and what pays off when")
    c.add_argument("--json", type=Path, default=Path("out/accuracy.json"))
    c.add_argument("--quick", action="store_true", help="a few minutes: two scenes, three worlds")
    c.add_argument("--scenes", nargs="+")
    c.add_argument("--worlds", nargs="+")
    c.add_argument("--turns", nargs="+", type=float, default=[0.0, 45.0], help="degrees")
    c.add_argument("--width", type=int, default=96, help="of the pictures for errors")
    c.add_argument("--time-width", type=int, default=320, help="of the renders for seconds")
    c.add_argument("--samples", type=int, default=128)
    c.add_argument("--many", type=int, default=512, help="samples of each of two references")
    c.add_argument("--lamp-samples", type=int, help="of a relight's lamps (default: the add-on's)")
    c.add_argument("--plot", type=Path, default=Path("out/accuracy.png"))
    c.add_argument("--sheet", type=Path, default=Path("out/accuracy_sheet.png"))
    c.set_defaults(run=_accuracy)

    for one in (mirrors_command, heavy_command, place_command, web_command, finish_command):
        one.add(commands)
    photographs_command.add(commands)

    c = commands.add_parser("noise", help="where to take out the noise of a capture")
    c.add_argument("--json", type=Path, default=Path("out/noise.json"))
    c.add_argument("--scenes", nargs="+", default=["four_spheres", "product"])
    c.add_argument("--width", type=int, default=96)
    c.add_argument("--samples", type=int, default=128)
    c.add_argument("--many", type=int, default=512)
    c.set_defaults(run=_noise)

    c = commands.add_parser("figure3", help="the paper's figure 3: supports of four pixels")
    c.add_argument("--out", type=Path, default=Path("docs/figure3.png"))
    c.add_argument("--width", type=int, default=80)
    c.add_argument("--samples", type=int, default=2048)
    c.set_defaults(run=_figure3)

    c = commands.add_parser("colour", help="a support for each channel, on prism and coat")
    c.add_argument("--json", type=Path, default=Path("out/colour.json"))
    c.add_argument("--width", type=int, default=48)
    c.add_argument("--samples", type=int, default=8192)
    c.add_argument("--many", type=int, default=2048)
    c.set_defaults(run=_colour)

    c = commands.add_parser("snapshot", help="what starting a job costs the window")
    c.add_argument("--json", type=Path)
    c.add_argument("--megabytes", type=int, nargs="+", default=[0, 100, 1000])
    c.set_defaults(run=_snapshot)

    c = commands.add_parser("settings", help="every setting of a scene against Cycles")
    c.add_argument("--json", type=Path)
    c.add_argument("--part", type=float, default=1.0, help="a random share of them, 0 to 1")
    c.add_argument("--seed", type=int, default=0, help="which share")
    c.add_argument("--only", nargs="+", help="owners, or owner.setting")
    c.add_argument("--page", type=Path, help="of the docs, to write")
    c.set_defaults(run=_settings)

    c = commands.add_parser("changes", help="what a capture changes, as a page of the docs")
    c.add_argument("page", type=Path, nargs="?")
    c.set_defaults(run=_changes)

    c = commands.add_parser("field", help="scenes and worlds as artists bring them")
    c.add_argument("--json", type=Path)
    c.add_argument("--only", nargs="+", help="cases that begin so")
    c.add_argument("--page", type=Path, help="of the docs, to write")
    c.set_defaults(run=_field)

    c = commands.add_parser("speed", help="every stage beside what it cannot be faster than")
    c.add_argument("--json", type=Path, default=Path("out/speed.json"))
    c.add_argument("--quick", action="store_true", help="a few minutes: the smallest sizes")
    c.add_argument("--samples", type=int, default=64)
    c.add_argument("--sizes", nargs="+", help="of its sizes these alone: 1920x1080")
    c.add_argument("--page", type=Path, help="a table in Markdown, to write")
    c.set_defaults(run=_speed)

    c = commands.add_parser("flicker", help="a moving shot relit, beside Cycles' own frames")
    c.add_argument("--json", type=Path, default=Path("out/flicker.json"))
    c.add_argument("--sheet", type=Path, default=Path("out/flicker.png"))
    c.add_argument("--worlds", nargs="+", default=["forest", "courtyard"])
    c.add_argument("--width", type=int, default=120)
    c.add_argument("--frames", type=int, default=24)
    c.add_argument("--samples", type=int, default=64)
    c.set_defaults(run=_flicker)

    c = commands.add_parser("plates", help="shadow catchers beside Cycles' own")
    c.add_argument("--json", type=Path, default=Path("out/plates.json"))
    c.add_argument("--quick", action="store_true", help="two pairs of thing and ground")
    c.add_argument("--specks", action="store_true", help="pixels that stand out, in 16 worlds")
    c.add_argument("--thing", default="metal", help="of --specks")
    c.add_argument("--ground", default="diffuse", help="of --specks")
    c.add_argument("--width", type=int, default=112)
    c.add_argument("--samples", type=int, default=128)
    c.add_argument("--many", type=int, default=512, help="samples of each of two references")
    c.add_argument("--page", type=Path, help="a table in Markdown, to write")
    c.set_defaults(run=_plates)

    match_command.add(commands)

    c = commands.add_parser("live", help="updates a second while the light is changed")
    c.add_argument("--json", type=Path, default=Path("out/live.json"))
    c.add_argument("--sizes", nargs="+", help="480x270 960x540 1920x1080")
    c.add_argument("--samples", type=int, default=16)
    c.set_defaults(run=_live)

    c = commands.add_parser("patterns", help="what each set of patterns can identify")
    c.set_defaults(run=_patterns)

    options = parser.parse_args()
    options.run(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
