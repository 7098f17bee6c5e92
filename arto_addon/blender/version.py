"""Which Blender this is."""

from __future__ import annotations

import bpy

# Blender 5 made the compositor's tree a node group like any other, gave every material and world
# its nodes, and may work in another colour space than that of its start. Before it is 4.5 LTS.
FIVE = bpy.app.version >= (5, 0, 0)
