"""The extension's own module, by the name that Blender has for it."""

from __future__ import annotations

# As `--addons` takes it: `bl_ext.<repository>.arto`, `arto` where it is installed for tests.
ADDON = __name__.rpartition(".arto_addon")[0]
