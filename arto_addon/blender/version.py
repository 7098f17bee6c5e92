"""Which Blender this is."""

from __future__ import annotations

import bpy

# True from Blender 5 on; else this is 4.5 LTS. In Blender 5 the compositor's tree is a node group
# like any other, every material and world has nodes, and the working space can be changed.
FIVE = bpy.app.version >= (5, 0, 0)
