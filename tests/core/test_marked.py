"""Nothing is removed that ARTO has not made, and nothing of others is written into."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import arto
import numpy as np
import pytest
from arto.core import marked
from arto.core.capture import capture_set
from arto.core.errors import BusyError, FilesError
from arto.core.field.writer import FieldWriter
from arto.core.files import Lock, replace_folder, settle, whole, write_text
from arto.core.hemicube import Hemicube
from arto.core.patterns import pattern_set
from arto.core.regular import host, read_regular


def ends(look: Callable[[], None]) -> None:
    """Run what must not wait for a writer that never comes. A minute is enough on any machine."""
    failed: list[BaseException] = []

    def run() -> None:
        try:
            look()
        except BaseException as e:
            failed.append(e)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(60)
    assert not thread.is_alive() and not failed, failed


needs_links = pytest.mark.skipif(os.name == "nt", reason="links need rights there")


def others(folder: Path) -> Path:
    """A folder of somebody else's."""
    folder.mkdir(parents=True)
    (folder / "comp.nk").write_text("mine")
    return folder


def test_only_one_module_removes() -> None:
    """Whatever the project removes goes through `core.marked`; `files.whole` removes the file that
    it has made itself."""
    root = Path(arto.__file__).parent
    found = set()
    for path in [*root.glob("core/**/*.py"), *root.glob("arto_addon/**/*.py")]:
        for line in path.read_text(encoding="utf-8").splitlines():
            if re.search(r"rmtree|\.rmdir\(|\bos\.(remove|unlink|removedirs)\b", line) or (
                re.search(r"\.unlink\(", line)
                and not re.search(r"(children|objects)\.unlink", line)
            ):
                found.add(path.relative_to(root).as_posix())
    assert found == {"core/marked.py", "core/files.py"}


@pytest.mark.parametrize("marks", [True, False])
def test_what_a_killed_removal_leaves_is_removed_by_the_next(
    tmp_path: Path, monkeypatch, marks: bool
) -> None:
    """However far it came: else the rest is in the way for ever, as somebody else's."""
    for killed in range(8):
        made = marked.make(tmp_path / "field", "field")
        for name in ("field.json", "tile_0000.arto", "proxy_2", "proxy_4"):
            if "proxy" in name:
                (made / name).mkdir()
                (made / name / "a").touch()
            else:
                (made / name).write_text('{"format": "ARTO reflectance field", "version": 3}')
        if not marks:  # as the version before made it
            (made / marked.MARK).unlink()
        left = [killed]

        def count(real: Callable[..., Any], left: list[int] = left) -> Callable[..., Any]:
            def run(*args: Any, **options: Any) -> Any:
                left[0] -= 1
                if left[0] < 0:
                    raise KeyboardInterrupt
                return real(*args, **options)

            return run

        with monkeypatch.context() as m, contextlib.suppress(KeyboardInterrupt):
            m.setattr(Path, "unlink", count(Path.unlink))
            m.setattr(Path, "rmdir", count(Path.rmdir))
            m.setattr(marked.shutil, "rmtree", count(shutil.rmtree))
            marked.remove(made, "field", tmp_path)
        assert made.exists() == (killed < 6)
        if made.exists():  # as where a field was replaced by another
            made.rename(tmp_path / "field.old")
        marked.make(made, "field")
        settle(made)
        assert [path.name for path in tmp_path.iterdir()] == ["field"]
        marked.remove(made, "field", tmp_path)


def test_a_folder_with_a_mark_is_removed(tmp_path: Path) -> None:
    made = marked.make(tmp_path / "deep" / "job", "job")
    (made / "inside").mkdir()
    marked.remove(made, "job", tmp_path)
    assert not made.exists()
    marked.remove(made, "job", tmp_path)  # nothing is there


@pytest.mark.parametrize(
    "said",
    [
        "", "{", "[]", '{"format": "ARTO folder"}', '{"format": "ARTO folder", "version": 2}',
        '{"format": "ARTO folder", "version": 1, "kind": "field"}',
        '{"format": "ARTO folder", "version": 1, "kind": "else"}',
        '{"format": "other", "version": 1, "kind": "job"}',
        '{"format": "ARTO folder", "version": 1, "kind": ["job"]}', "[" * 100000,
    ],
)  # fmt: skip
def test_another_mark_is_none(tmp_path: Path, said: str) -> None:
    folder = others(tmp_path / "x")
    (folder / marked.MARK).write_text(said)
    with pytest.raises(FilesError, match="not made by ARTO"):
        marked.remove(folder, "job", tmp_path)
    assert (folder / "comp.nk").read_text() == "mine"


def test_outside_nothing_is_removed(tmp_path: Path) -> None:
    made = marked.make(tmp_path / "b" / "job", "job")
    (tmp_path / "a").mkdir()
    for path in (made, tmp_path / "a" / ".." / "b" / "job", tmp_path / "a" / ".."):
        with pytest.raises(FilesError):
            marked.remove(path, "job", tmp_path / "a")
    assert made.is_dir()


@needs_links
def test_links_are_not_followed(tmp_path: Path) -> None:
    theirs = others(tmp_path / "theirs")
    made = marked.make(tmp_path / "made", "job")
    (made / "caches").symlink_to(theirs)
    (tmp_path / "link").symlink_to(made)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "out").symlink_to(tmp_path)
    for path in (tmp_path / "link", tmp_path / "in" / "out" / "made"):
        with pytest.raises(FilesError):
            marked.remove(path, "job", tmp_path / "in" if "in" in path.parts else tmp_path)
    assert made.is_dir()
    marked.remove(made, "job", tmp_path)
    assert not made.exists() and (theirs / "comp.nk").read_text() == "mine"


def test_what_the_version_before_made_is_known(tmp_path: Path) -> None:
    """A capture set and a field without marks are ours, and with a file of others in them not."""
    cube = Hemicube(faces=("top",), patches=1)
    captured, field = tmp_path / "capture", tmp_path / "field"
    basis = np.ones((1, 1, 2, 2, 3), np.float32)
    capture_set.write(captured, cube, pattern_set("white"), basis)
    FieldWriter(field, cube, (2, 2)).close()
    kinds: list[tuple[Path, marked.Kind]] = [(captured, "capture"), (field, "field")]
    for folder, kind in kinds:
        (folder / marked.MARK).unlink(missing_ok=True)
        assert marked.kind_of(folder) == kind
        (folder / "comp.nk").write_text("mine")
        assert marked.kind_of(folder) is None
        with pytest.raises(FilesError):
            marked.remove(folder, kind, tmp_path)
        (folder / "comp.nk").unlink()
        marked.remove(folder, kind, tmp_path)


def test_a_folder_of_others_is_not_marked(tmp_path: Path) -> None:
    folder = others(tmp_path / "x")
    marked.mark(folder, "capture")
    assert sorted(p.name for p in folder.iterdir()) == ["comp.nk"]


def test_a_folder_of_others_is_not_replaced(tmp_path: Path) -> None:
    folder = others(tmp_path / "field")
    made = marked.scratch(folder, "field")
    with pytest.raises(FilesError, match="not made by ARTO"):
        replace_folder(made, folder)
    assert (folder / "comp.nk").exists() and made.is_dir()
    with pytest.raises(FilesError):
        FieldWriter(folder, Hemicube(faces=("top",), patches=1), (2, 2))


def test_an_old_of_others_stays(tmp_path: Path) -> None:
    old = others(tmp_path / "field.old")
    there = marked.make(tmp_path / "field", "field")
    settle(there)
    with pytest.raises(FilesError, match="in the way"):
        replace_folder(marked.scratch(there, "field"), there)
    assert (old / "comp.nk").exists() and there.is_dir()
    marked.remove(there, "field", tmp_path)
    settle(there)
    assert old.is_dir() and not there.exists()


@needs_links
@pytest.mark.parametrize("how", ["symbolic", "hard"])
def test_a_lock_that_is_a_link_empties_nothing(tmp_path: Path, how: str) -> None:
    theirs = tmp_path / ".bashrc"
    theirs.write_text("export A=1")
    shot = tmp_path / "shot"
    shot.mkdir()
    lock = shot / "lock"
    if how == "symbolic":
        lock.symlink_to(theirs)
    else:
        lock.hardlink_to(theirs)
    assert Lock.holder(shot) == ""
    with pytest.raises(FilesError, match="link"):
        Lock(shot, "capturing").__enter__()
    assert theirs.read_text() == "export A=1"


@pytest.mark.parametrize("text", ["my own notes", "x" * 100000, "capturing, process 1\nmore"])
def test_a_file_that_is_no_lock_is_kept(tmp_path: Path, text: str) -> None:
    (tmp_path / "lock").write_text(text)
    assert Lock.holder(tmp_path) == ""
    with pytest.raises(FilesError, match="no lock"):
        Lock(tmp_path, "capturing").__enter__()
    assert (tmp_path / "lock").read_text() == text


@needs_links
def test_a_lock_that_is_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "lock")

    def look() -> None:
        assert Lock.holder(tmp_path) == ""
        with pytest.raises(FilesError):
            Lock(tmp_path, "capturing").__enter__()

    ends(look)


def test_looking_at_a_lock_writes_nothing(tmp_path: Path) -> None:
    with Lock(tmp_path, "capturing"):
        pass
    (tmp_path / "lock").write_text("capturing, process 12")
    assert Lock.holder(tmp_path) == ""
    assert (tmp_path / "lock").read_text() == "capturing, process 12"
    with Lock(tmp_path, "fitting a\nscene"), pytest.raises(BusyError, match="fitting a\nscene"):
        Lock(tmp_path, "looking").__enter__()


@needs_links
def test_a_link_in_the_way_of_a_write_is_replaced_and_not_followed(tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    theirs.write_text("mine")
    for name in ("a.exr", "a.exr.part", "a.part"):
        (tmp_path / name).symlink_to(theirs)
    write_text(tmp_path / "a.exr", "new")
    assert theirs.read_text() == "mine" and (tmp_path / "a.exr").read_text() == "new"
    assert (tmp_path / "a.exr.part").is_symlink()


def test_two_writers_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    with whole(path) as one, whole(path) as two:
        assert one != two
        one.write_text("one")
        two.write_text("two")
    assert path.read_text() == "one" and list(tmp_path.iterdir()) == [path]


WRITE = """
import sys, os
from pathlib import Path
from arto.core import marked
from arto.core.files import whole
path = Path(sys.argv[1])
marked.scratch(path, "field")
with whole(path) as partial:
    partial.write_text("half")
    os._exit(9)
"""


def test_what_a_killed_writer_leaves_goes_with_the_next_write(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    theirs = [tmp_path / "a.exr.part", tmp_path / "a.exr.mine-1-0123456789abcdef.part"]
    for there in theirs:
        there.write_text("mine")
    subprocess.run([sys.executable, "-c", WRITE, str(path)], check=False)
    assert len(list(tmp_path.iterdir())) == 4
    write_text(path, "new")
    assert sorted(tmp_path.iterdir()) == sorted([path, *theirs])


def test_a_name_is_short_enough_for_a_disk(tmp_path: Path) -> None:
    name = "ä" * 120 + ".exr"
    write_text(tmp_path / name, "x")
    assert [p.name for p in tmp_path.iterdir()] == [name]


@needs_links
def test_only_regular_files_of_a_size_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "long").write_text("x" * 101)
    (tmp_path / "folder").mkdir()
    (tmp_path / "good").write_text(json.dumps({"a": 1}))

    def look() -> None:
        for name in ("pipe", "zero", "long", "folder", "none"):
            with pytest.raises(OSError):
                read_regular(tmp_path / name, 100, follow=name == "zero")

    ends(look)
    assert read_regular(tmp_path / "good", 100) == b'{"a": 1}'


def test_a_sweep_removes_what_dead_processes_left_and_nothing_else(tmp_path: Path) -> None:
    ours = marked.make(tmp_path / "shot", "take")
    deeper = marked.make(ours / "unfinished", "take")
    theirs = tmp_path / "shot" / "theirs"
    theirs.mkdir()
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    dead = f"tile_0000.exr.{host()}-{done.pid}-0123456789abcdef.part"
    alive = f"tile_0000.exr.{host()}-{os.getpid()}-0123456789abcdef.part"
    for folder in (ours, deeper, theirs):
        for name in (dead, alive, "mine.part", "tile_0001.exr"):
            (folder / name).write_text("x")
    marked.sweep(ours)
    for folder in (ours, deeper):
        left = {path.name for path in folder.iterdir() if path.is_file()} - {marked.MARK}
        assert left == {alive, "mine.part", "tile_0001.exr"}
    assert (theirs / dead).exists()
    marked.sweep(tmp_path)
    assert (theirs / dead).exists()
