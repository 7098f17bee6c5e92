"""The image editors of the window, and how a picture is shown in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Editor:
    """An open image editor, and the window that it is in."""

    window: bpy.types.Window
    area: bpy.types.Area

    @property
    def space(self) -> bpy.types.SpaceImageEditor:
        return self.area.spaces.active

    @property
    def image(self) -> bpy.types.Image | None:
        """The image that the editor shows."""
        return self.space.image

    @property
    def _region(self) -> bpy.types.Region:
        return next(r for r in self.area.regions if r.type == "WINDOW")

    def show(self, image: bpy.types.Image | None) -> None:
        """Show an image, as large as fits.

        Blender keeps a zoom for each image. An image that takes the place of another one of ARTO's,
        of the same size, is shown as near and from the same side: the artist looks at one picture.
        """
        before = self.image
        if before == image:
            return
        if bpy.app.background:
            self.space.image = image
            return
        same = before is not None and image is not None and _alike(before, image)
        near, middle = self._view() if same else (0.0, (0.5, 0.5))
        self.space.image = image
        if image is None:
            return
        with bpy.context.temp_override(window=self.window, area=self.area, region=self._region):
            bpy.ops.image.view_all(fit_view=True)
            if near:
                bpy.ops.image.view_zoom_ratio(ratio=near)
                width, height = image.size
                offset = (middle[0] - 0.5) * width, (middle[1] - 0.5) * height
                bpy.ops.image.view_pan(offset=offset)
        self.area.tag_redraw()

    def _view(self) -> tuple[float, tuple[float, float]]:
        """How near the image is shown, and the place of the image in the middle of the editor."""
        region = self._region
        place = region.view2d.region_to_view(region.width / 2, region.height / 2)
        return self.space.zoom[0], (place[0], place[1])


def _alike(one: bpy.types.Image, other: bpy.types.Image) -> bool:
    """Whether two images are pictures of ARTO's of the same size."""
    ours = all(image.name.startswith("ARTO ") for image in (one, other))
    return ours and tuple(one.size) == tuple(other.size)


def editors() -> Iterator[Editor]:
    """The image editors that are open; none without a window."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager else ():
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                yield Editor(window, area)


def reveal(image: bpy.types.Image) -> None:
    """Show an image in an open image editor; without one, where Blender would show a render."""
    if bpy.app.background:
        return
    found = _best()
    if found is None:
        bpy.ops.render.view_show("INVOKE_DEFAULT")
        found = _best()
    if found is not None:
        found.show(image)
        found.area.tag_redraw()


def _best() -> Editor | None:
    """The image editor to show a picture in; an editor that already shows a picture comes first."""
    found = []
    for each in editors():
        if each.area.ui_type == "IMAGE_EDITOR" and each.space.mode == "VIEW":
            shown = each.image
            ours = shown is None or shown.type == "RENDER_RESULT" or "ARTO" in shown.name
            found.append((not ours, -each.area.width * each.area.height, each))
    return min(found, key=lambda f: f[:2])[2] if found else None


def replace(name: str, image: bpy.types.Image | None) -> None:
    """Show an image in all editors that show the image of a name."""
    for editor in editors():
        if editor.image is not None and editor.image.name == name:
            editor.show(image)


def redraw() -> None:
    """Draw the pictures in the image editors anew."""
    for editor in editors():
        for region in editor.area.regions:
            if region.type == "WINDOW":
                region.tag_redraw()
