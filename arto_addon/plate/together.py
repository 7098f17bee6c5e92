"""The files of a plate, put in place together, and those of an earlier plate that go with them.

Beside a plate there may be its layers, its data, its shadows and its composite over footage. All of
them are of one light. So none is put in place before all are complete, and what an earlier relight
has left beside the plate and this one does not write is removed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType

from ...core import exr, marked
from ...core.errors import ExrError
from ...core.file_names import folded
from ...core.files import whole
from ...core.places import in_turn
from . import marks
from .marks import ENDINGS, SCRIPTS, is_of
from .plate import LAYERS, full_file, layers_prefix


class Together:
    """A context manager in which the files of a plate are written.

    At the end of the block the files take their names, the plate's own file last. If the block
    fails, nothing is changed. Raises ExrError where a file cannot be put in its place, SceneError
    where it would be written over a file of others (`marks`).
    """

    def __init__(self, plate: Path, prefix: str | None, overwrite: bool = False) -> None:
        """prefix: of the names of layers' own files; None where there are no such files.

        overwrite: whether files of others are written over.
        """
        self.plate, self.overwrite = plate, overwrite
        self.written: list[Path] = []
        self.removed: list[Path] = []
        known = (prefix, older_prefix(plate))
        self._prefixes = {name for name in known if name is not None}
        self._held = ExitStack()
        self._partial: Path | None = None

    def __enter__(self) -> Together:
        marks.check(self.plate, self.plate, self.overwrite)
        try:
            # entered first, so put in its place last
            self._partial = self._held.enter_context(whole(self.plate))
        except OSError as e:
            raise _cannot(self.plate, e) from e
        return self

    @contextmanager
    def file(self, path: Path) -> Iterator[Path]:
        """Give the path to write a file to; the file takes its name at the end of the block."""
        if path == self.plate:
            assert self._partial is not None
            yield self._partial
        else:
            marks.check(path, self.plate, self.overwrite)
            yield self._held.enter_context(whole(path))
        self.written.append(path)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        try:
            # in turn: of two relights of one plate, all files of the later one stay
            with in_turn(self.plate.parent):
                if error is None:
                    self._remove_others()
                self._held.__exit__(kind, error, at)
        except OSError as e:
            raise _cannot(self.plate, e) from e

    def _remove_others(self) -> None:
        if (prefix := older_prefix(self.plate)) is not None:  # of a relight that came meanwhile
            self._prefixes.add(prefix)
        for path in beside(self.plate, self._prefixes):
            same = any(folded(path) == folded(there) for there in self.written)
            if not same and marked.remove_own_file(path, lambda path: is_of(path, self.plate)):
                self.removed.append(path)


def older_prefix(plate: Path) -> str | None:
    """The prefix of the files of layers beside the plate that is there now."""
    if not plate.is_file():
        return None
    try:
        return layers_prefix(plate, str(exr.header(plate).get(LAYERS, "")))
    except ExrError:
        return None


def _cannot(path: Path, error: OSError) -> ExrError:
    return ExrError(
        f"{path} cannot be written ({error}): make room on the disk, or choose a folder that can "
        "be written"
    )


def beside(plate: Path, prefixes: set[str]) -> list[Path]:
    """Files that have names as ARTO gives them beside a plate. prefixes: of the names of layers."""
    found = [plate.with_name(f"{plate.stem}_{ending}.exr") for ending in ENDINGS]
    found += [full_file(path) for path in (plate, *found)]
    found += [plate.with_suffix(ending) for ending in SCRIPTS]
    there = {path for path in found if path.is_file()}
    begins = tuple(f"{plate.stem}_{prefix}" for prefix in prefixes)
    if begins and plate.parent.is_dir():
        names = (path for path in plate.parent.iterdir() if path.suffix == ".exr")
        there |= {path for path in names if path.name.startswith(begins)}
    return sorted(there)
