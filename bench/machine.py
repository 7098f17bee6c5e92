"""What machine a figure comes from, and the one form of every bench command's JSON."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np
from arto.core.files import write_text


def machine() -> dict[str, Any]:
    """The machine in words."""
    return {
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write `{"machine": ..., "rows": ...}`, whole or not at all."""
    write_text(path, json.dumps({"machine": machine(), "rows": rows}, indent=1))
