"""The stream: fit each tile while Cycles renders the next, then remove its basis images.

A thread does the fit, which works because Cycles releases Python's lock while it renders. An error
in the thread is raised where the capture next looks at the thread.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Mapping
from pathlib import Path

from ...core.capture.capture_set import CaptureSet
from ...core.errors import CancelledError
from ...core.fit.fit import fit_into
from ..work import driven


class Stream:
    """Fits tiles of an unfinished capture set into `field` in its folder, one at a time."""

    FIELD = "field"

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._entry: Mapping[str, object] | None = None
        self._error: BaseException | None = None
        self._number = 0
        self.share = 0.0

    def start(self, number: int) -> None:
        """Begin to fit a tile, which must be rendered by what the set's head says."""
        captured = CaptureSet(self.folder, unfinished=True)
        self._number, self.share, self._entry, self._error = number, 0.0, None, None

        def work() -> None:
            try:
                self._entry = self._fit(captured, number)
            except BaseException as e:
                self._error = e

        self._thread = threading.Thread(target=work, name=f"ARTO fits tile {number}")
        self._thread.start()

    def _fit(self, captured: CaptureSet, number: int) -> Mapping[str, object]:
        def look(share: float) -> None:
            self.share = share
            if self._stop.is_set():
                raise CancelledError("cancelled")

        return driven(fit_into(captured, number, self.folder / self.FIELD), look)

    def ended(self, patience: float | None) -> tuple[int, Mapping[str, object]] | None:
        """The number of the tile that was fitted, and its entry in `field.json`.

        None where no tile is being fitted, or the fit takes longer than `patience` seconds. Raises
        the error of the fit.
        """
        if self._thread is None:
            return None
        self._thread.join(patience)
        if self._thread.is_alive():
            return None
        self._thread = None
        if self._error:
            raise self._error
        assert self._entry is not None
        return self._number, self._entry

    @property
    def busy(self) -> bool:
        return self._thread is not None

    def stop(self) -> None:
        """End the fit at the next patch. A capture that goes on fits the tile anew."""
        self._stop.set()
        with contextlib.suppress(BaseException):
            self.ended(None)
