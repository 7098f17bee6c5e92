"""Whether a scene is still the one that a capture is of."""

from __future__ import annotations

from ...core.capture.head import CaptureHead
from .asked import Asked


def differences(this: Asked, head: CaptureHead) -> list[str]:
    """What is otherwise in the scene now than in the head of a capture, in words."""
    if head.shot is None:
        return ["it has no shot"]
    here = this.head
    out = [
        f"{name}: {now}, not {then}"
        for name, now, then in (
            ("samples", here.samples, head.samples),
            ("seed", here.seed, head.seed),
            ("adaptive", here.adaptive, head.adaptive),
            ("far", here.far, head.far),
            ("blender", here.blender, head.blender),
            ("colour space", here.colour_space, head.colour_space),
            ("catchers", here.catchers, head.catchers),
            ("portals", here.portals, head.portals),
        )
        if now != then
    ]
    planned = head.fingerprint or {}
    for thing in sorted(planned.keys() | this.found.keys()):
        if planned.get(thing) != this.found.get(thing):
            out.append(f"{thing} is another")
    for name in ("camera_matrix", "lens", "frame", "subframe", "width", "height"):
        if getattr(this.shot, name) != getattr(head.shot, name):
            out.append(f"the shot's {name.replace('_', ' ')} is another")
    return out
