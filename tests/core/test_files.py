"""What is being written is there whole or not at all, and held by one process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from arto.core import marked
from arto.core.errors import BusyError
from arto.core.files import Lock, replace_folder, settle, whole, write_text


def test_a_failing_write_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a.txt"
    write_text(path, "one")
    with pytest.raises(RuntimeError), whole(path) as partial:
        partial.write_text("half")
        raise RuntimeError
    assert path.read_text() == "one"
    assert list(path.parent.iterdir()) == [path]


def folder(path: Path, text: str) -> Path:
    marked.make(path, "field")
    (path / "what").write_text(text)
    return path


def test_a_crash_between_the_renames_loses_nothing(tmp_path: Path) -> None:
    """Killed after the first rename, the old folder has only another name: it comes back."""
    there = folder(tmp_path / "field", "old")
    there.rename(tmp_path / "field.old")
    settle(there)
    assert (there / "what").read_text() == "old"
    # killed after the second, only the removal is missing
    folder(tmp_path / "field.old", "older")
    settle(there)
    assert (there / "what").read_text() == "old" and not (tmp_path / "field.old").exists()


def test_replacing_settles_first(tmp_path: Path) -> None:
    there = tmp_path / "field"
    folder(tmp_path / "field.old", "old")
    replace_folder(folder(tmp_path / "new", "new"), there)
    assert (there / "what").read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["field"]


def test_a_rename_that_fails_puts_the_old_one_back(tmp_path: Path) -> None:
    there = folder(tmp_path / "field", "old")
    with pytest.raises(OSError):
        replace_folder(tmp_path / "nowhere", there)
    assert (there / "what").read_text() == "old"


HOLD = """
import sys, time
from pathlib import Path
from arto.core.files import Lock
with Lock(Path(sys.argv[1]), "capturing Scene"):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_folder_is_held_by_one_process_and_let_go_when_it_is_killed(tmp_path: Path) -> None:
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(BusyError, match=f"capturing Scene, process {other.pid}"):
            Lock(tmp_path, "fitting").__enter__()
        assert Lock.holder(tmp_path) == f"capturing Scene, process {other.pid}"
    finally:
        other.kill()
        other.wait()
    with Lock(tmp_path, "fitting"):
        pass
    assert Lock.holder(tmp_path) == ""
