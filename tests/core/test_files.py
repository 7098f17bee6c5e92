"""What is being written is there whole or not at all, and held by one process."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from arto.core import exr, marked, regular
from arto.core.description import Description
from arto.core.errors import BusyError, FieldError, FilesError
from arto.core.field.tile_file import TileFile, written
from arto.core.files import Lock, moved, replace_folder, settle, whole, write_text


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


def test_two_writers_of_one_file_and_a_reader(tmp_path: Path) -> None:
    """As two relights of one shot: what is read is one of both, whole, and nothing is left."""
    path, ended = tmp_path / "relit.exr", []
    exr.write(path, {"": np.zeros((40, 60, 4), np.float32)})

    def write(value: float) -> None:
        for _ in range(12):
            exr.write(path, {"": np.full((40, 60, 4), value, np.float32)})
        ended.append(value)

    writers = [threading.Thread(target=write, args=(n,)) for n in (1, 2)]
    for writer in writers:
        writer.start()
    while len(ended) < 2:
        found = exr.read(path)[""]
        assert (found == found[0, 0, 0]).all()
    for writer in writers:
        writer.join()
    assert [file.name for file in tmp_path.iterdir()] == ["relit.exr"]


def test_windows_is_asked_again_while_somebody_reads(tmp_path: Path, monkeypatch) -> None:
    for name in ("new", "a.exr"):
        (tmp_path / name).write_text(name)
    real, refused = Path.replace, []

    def replace(source: Path, target: Path) -> Path:
        if len(refused) < 3:
            refused.append(target)
            raise PermissionError("a panel reads it")
        return real(source, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(PermissionError):
        moved(tmp_path / "new", tmp_path / "a.exr")  # other systems do not refuse for that
    monkeypatch.setattr(regular, "_WINDOWS", True)
    moved(tmp_path / "new", tmp_path / "a.exr")
    assert (tmp_path / "a.exr").read_text() == "new" and len(refused) == 3


def test_a_lock_tells_who_ended_without_letting_go(tmp_path: Path) -> None:
    with Lock(tmp_path, "capturing a") as held:
        assert held.left == ""
    (tmp_path / Lock.NAME).write_text("capturing a, process 7")
    with Lock(tmp_path, "capturing a") as held:
        assert held.left == "capturing a, process 7"
    with Lock(tmp_path, "capturing a") as held:
        assert held.left == ""


def test_too_many_open_files_are_no_damage(tmp_path: Path, monkeypatch) -> None:
    """Else a field that is whole would be fitted again, and again to no use."""
    write_text(tmp_path / "field.json", "{}")
    exr.write(tmp_path / "a.exr", {"": np.zeros((4, 4, 4))})
    with written(tmp_path / "tile_0000.arto") as out:
        out.add("scales", np.ones(2, np.float32))

    def none_left(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(os, "open", none_left)
    monkeypatch.setattr(Path, "open", none_left)
    for read in (
        lambda: Description(tmp_path / "field.json", FieldError),
        lambda: TileFile(tmp_path / "tile_0000.arto"),
        lambda: exr.read(tmp_path / "a.exr"),
    ):
        with pytest.raises(FilesError, match="nothing is damaged"):
            read()
