"""The planes around a stage, as the renders of a capture need them."""

from __future__ import annotations

from contextlib import ExitStack

from ...core.capture.head import CaptureHead
from ...core.capture.kinds import Route
from ...core.capture.names import GRAIN
from ..stage.stage import Stage, set_region
from . import planes
from .plan import render_plan


def plan_of(head: CaptureHead) -> list[list[tuple[int, str]]]:
    """The (patch, pattern name) images of each render of a tile. Raises CaptureSetError."""
    names = [*head.patterns.patterns, *([GRAIN] if head.grain else [])]
    return render_plan(head.told_route, head.hemicube, names)


class Around:
    """The planes around a stage, which stay from one tile to the next.

    Cycles prepares the scene again when planes come or go. So they are changed only where a render
    needs others than the last.
    """

    def __init__(self, on: Stage) -> None:
        self._on = on
        self._held = ExitStack()
        self._images: list[tuple[int, str]] | None = None

    def __enter__(self) -> Around:
        return self

    def __exit__(self, *_: object) -> None:
        self._images = None
        self._held.close()

    def set_tile(self, head: CaptureHead, number: int, images: list[tuple[int, str]]) -> None:
        """Make the stage ready to render some images of a tile."""
        set_region(self._on.scene, head.tiles[number].region)
        self.set_images(head, images)

    def set_images(self, head: CaptureHead, images: list[tuple[int, str]]) -> None:
        """Put up the planes that some images need, in whatever region."""
        on = self._on
        if images == self._images:
            return
        self.__exit__()
        # the scene's own lamps are in every render; the first render separates them by group
        sampled = head.route == Route.SAMPLED
        own = not sampled and images == plan_of(head)[0]
        faint, portals = head.radiance or 1.0, bool(head.portals)
        self._held.enter_context(
            planes.lit(on, head.hemicube, head.patterns, images, sampled, own, faint, portals)
        )
        self._images = images
