"""The faces of the hemicube, and the leaves that a face can be cut into (paper 3).

Examples
--------
>>> centre, u, v = FACES["top"]
>>> centre, [name for name in FACES if name not in PRESETS["paper"]]
((0, 0, 1), ['front', 'bottom'])
"""

from __future__ import annotations

# By name: centre, direction of u, direction of v. Seen from inside, v is up on the four sides.
FACES: dict[str, tuple[tuple[int, int, int], ...]] = {
    "top": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "left": ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "right": ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "back": ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
    "front": ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    "bottom": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
FACE_NAMES = tuple(FACES)
SIDES = ("left", "right", "back", "front")
# The paper's four monitors, of which none is behind the camera, and all faces.
PRESETS: dict[str, tuple[str, ...]] = {
    "paper": ("top", "left", "right", "back"),
    "full": FACE_NAMES,
}

# A patch of a quadtree: face, how many patches of its size make up a side, row, column.
Leaf = tuple[str, int, int, int]
# The finest grid of a quadtree, and the grids that its leaves may be from.
FINEST = 16
LEAF_SIDES = (1, 2, 4, 8, FINEST)
