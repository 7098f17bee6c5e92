"""What starting a job costs the window: the snapshot and the fingerprint, by the file's size."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from arto.arto_addon.job import snapshot as snapshots
from arto.arto_addon.shot.fingerprint import fingerprint

from . import reference

# Bytes of the file that a vertex of a grid takes: place, and four corners with vertex and edge.
BYTES_A_VERTEX = 12 + 4 * 8 + 2 * 8 + 4


def _grid(side: int) -> bpy.types.Mesh:
    """A mesh of side x side vertices, in no order that packs well."""
    mesh = bpy.data.meshes.new("grid")
    at = np.arange(side * side, dtype=np.int32).reshape(side, side)
    corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1)
    mesh.vertices.add(side * side)
    places = np.random.default_rng(0).normal(size=side * side * 3).astype(np.float32)
    mesh.vertices.foreach_set("co", places)
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(corners) // 4)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh


def snapshot(megabytes: list[int]) -> list[dict[str, Any]]:
    """Rows of seconds and bytes, for the product scene with so many megabytes of mesh added."""
    rows = []
    for size in megabytes:
        scene = reference.new_scene("product", 320, 240)
        if size:
            side = int((size * 1e6 / BYTES_A_VERTEX) ** 0.5)
            scene.collection.objects.link(bpy.data.objects.new("grid", _grid(side)))
        bpy.context.view_layer.update()
        layer = scene.view_layers[0].name
        with tempfile.TemporaryDirectory() as folder:
            begun = time.perf_counter()
            blend, _ = snapshots.take(Path(folder), "capture", scene, layer)
            taken = time.perf_counter()
            fingerprint(scene, layer, full=True)
            first = time.perf_counter()
            fingerprint(scene, layer)
            again = time.perf_counter()
            rows.append(
                {
                    "file_megabytes": round(blend.stat().st_size / 1e6, 1),
                    "snapshot_seconds": round(taken - begun, 3),
                    "fingerprint_seconds": round(first - taken, 3),
                    "fingerprint_again_seconds": round(again - first, 3),
                }
            )
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as a table in Markdown."""
    names = list(rows[0])
    lines = [
        "| " + " | ".join(n.replace("_", " ") for n in names) + " |",
        "|---" * len(names) + "|",
    ]
    return "\n".join([*lines, *("| " + " | ".join(str(r[n]) for n in names) + " |" for r in rows)])
