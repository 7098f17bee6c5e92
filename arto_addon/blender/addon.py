"""The name that Blender has for the extension's own module."""

from __future__ import annotations

# The name that the option `--addons` takes: `bl_ext.<repository>.arto` in Blender, and `arto` where
# the package is installed for tests.
ADDON = __name__.rpartition(".arto_addon")[0]
