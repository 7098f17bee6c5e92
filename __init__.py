"""ARTO, the Blender extension: change the light of a finished shot.

Blender imports this package and calls `register`. Blender's own modules are imported there and not
at the top, so that tools without Blender can import `arto.core`.
"""


def register() -> None:
    from . import arto_addon

    arto_addon.register()


def unregister() -> None:
    from . import arto_addon

    arto_addon.unregister()
