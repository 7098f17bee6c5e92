"""A page of each scene: its bytes, and how far it is from the plates of its worlds."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from arto.arto_addon import work
from arto.arto_addon.fit import fit
from arto.arto_addon.web.make import make

from . import reference
from .machine import write_rows
from .models import captured
from .worlds import World, _hdri_folder


def web(
    out: Path, names: Iterable[str], worlds: Iterable[str], size: tuple[int, int], samples: int
) -> list[dict[str, Any]]:
    """Rows of every scene and world; written after each scene."""
    rows: list[dict[str, Any]] = []
    files = [_hdri_folder() / f"{world}.exr" for world in worlds]
    for name in names:
        there = captured(name, size, samples)
        shot = there.head.shot
        scene = reference.new_scene(name, *size)
        World(files[0].stem).apply(scene)
        scene.arto.samples, scene.arto.folder = samples, str(there.folder.parents[3].resolve())
        scene.arto.scene_id = (shot.scene_id if shot else None) or ""
        scene.render.film_transparent = True
        work.run(fit.fit(scene))
        with tempfile.TemporaryDirectory() as folder:
            steps = make(scene, scene.view_layers[0].name, Path(folder) / "page", files)
            made = work.run(steps)
        for world, error in made.errors.items():
            row = {"scene": name, "world": world, "bytes": made.bytes}
            row |= {"components": made.components, "error": error.smooth}
            rows.append({**row, "error_of_mirrors": error.mirrors, "error_of_all": error.all})
        write_rows(out, rows)
        print(f"{name} done", flush=True)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    lines = ["| scene, world | bytes | components | error | of mirrors |", "|---|---|---|---|---|"]
    for r in rows:
        mirrors = f"{r['error_of_mirrors']:.3f}" if r["error_of_mirrors"] else ""
        lines.append(
            f"| {r['scene']}, {r['world']} | {r['bytes']:,} | {r['components']} | "
            f"{r['error']:.3f} | {mirrors} |"
        )
    return "\n".join(lines)
