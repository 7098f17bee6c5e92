"""How much memory a process may take: kernels' files of several kinds, made up."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from arto.core.memory import memory

GIGA = 1 << 30
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="containers are Linux's")


def kernel(root: Path, group: str, files: dict[str, str]) -> Path:
    """The kernel's files with 6 GB free, and what is said of groups."""
    said = {"proc/meminfo": f"MemTotal: {64 << 20} kB\nMemAvailable: {6 << 20} kB\n"}
    for name, text in (said | {"proc/self/cgroup": group} | files).items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def second(folder: str, most: str, taken: int, dropped: int = 0) -> dict[str, str]:
    return {
        f"{folder}/memory.max": most,
        f"{folder}/memory.current": str(taken),
        f"{folder}/memory.stat": f"anon 5\ninactive_file {dropped}\n",
    }


BASE = "sys/fs/cgroup"
CASES = {
    "no container": ("0::/user.slice\n", {}, 6 * GIGA),
    "no limit": ("0::/\n", second(BASE, "max", GIGA), 6 * GIGA),
    "a container that sees itself": ("0::/\n", second(BASE, str(GIGA), 400 << 20), 624 << 20),
    "files that the kernel drops": ("0::/\n", second(BASE, str(GIGA), GIGA, GIGA >> 1), GIGA >> 1),
    "the group around it is the tighter one": (
        "0::/farm/job\n",
        second(f"{BASE}/farm/job", str(8 * GIGA), 0) | second(f"{BASE}/farm", str(2 * GIGA), GIGA),
        GIGA,
    ),
    "a path of the host": ("0::/docker/0a1b\n", second(BASE, str(GIGA), 0), GIGA),
    "more is taken than there is": ("0::/\n", second(BASE, str(GIGA), 2 * GIGA), 0),
    "version 1": (
        "5:cpu:/x\n4:memory:/slurm/job_7\n0::/\n",
        {
            f"{BASE}/memory/slurm/job_7/memory.limit_in_bytes": str(2 * GIGA),
            f"{BASE}/memory/slurm/job_7/memory.usage_in_bytes": str(GIGA),
            f"{BASE}/memory/slurm/job_7/memory.stat": f"total_inactive_file {GIGA >> 1}\n",
            f"{BASE}/memory/memory.limit_in_bytes": str((1 << 63) - 4096),
        },
        GIGA + (GIGA >> 1),
    ),
    "nonsense": ("x\n0::\n:::::\n", second(BASE, "many", 0), 6 * GIGA),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_free_is_what_the_tightest_limit_leaves(tmp_path: Path, case: str) -> None:
    group, files, expected = CASES[case]
    total, free = memory(kernel(tmp_path, group, files))
    assert free == expected
    assert total >= (expected or 1)
