"""A world as it was before a kit was put into it, to be put back whole."""

from __future__ import annotations

import bpy

from ..blender.nodes import shader_tree
from . import base as of_base


class Former:
    """A copy of a world without a kit, for the time in which a kit in it may be given up.

    The nodes that a kit replaces are gone, so they cannot be put back one by one.
    """

    def __init__(self, world: bpy.types.World) -> None:
        self._copy: bpy.types.World | None = world.copy()
        self._kept = world.use_fake_user

    def put_back(self, world: bpy.types.World) -> bpy.types.World:
        """Let all that uses a world use what it was before -> that world, of the same name."""
        copy = self._copy
        assert copy is not None
        self._copy = None
        name, made = world.name, _groups_of(world)
        world.use_fake_user = False
        world.user_remap(copy)
        bpy.data.worlds.remove(world)
        copy.name, copy.use_fake_user = name, self._kept
        for group in made:
            if not group.users:
                bpy.data.node_groups.remove(group)
        return copy

    def let_go(self) -> None:
        """Remove the copy: the kit stays."""
        if self._copy is not None:
            bpy.data.worlds.remove(self._copy)
        self._copy = None


def _groups_of(world: bpy.types.World) -> list[bpy.types.NodeTree]:
    """The groups of a kit in a world."""
    tree = shader_tree(world)
    found = {n.node_tree for n in (tree.nodes if tree else ()) if n.bl_idname == "ShaderNodeGroup"}
    return [group for group in found if of_base.is_group(group) and not group.library]
