"""The one door to the OpenEXR library: no other module imports it.

Blender carries an OpenEXR of its own. The library of the wheel would find Blender's symbols before
its own, and compressed reads would then report errors for good pixels. The wheels inside the
extension are therefore changed so that they find their own symbols first (tools/wheel_symbols.py).
RTLD_DEEPBIND does not solve this: it also bypasses the allocator that Blender puts in the place of
malloc, and Blender aborts.
"""

from __future__ import annotations

from typing import Any


def openexr() -> Any:
    """Import the OpenEXR module when it is first needed.

    Returns
    -------
    module
        `OpenEXR` of the wheel.

    Examples
    --------
    >>> openexr().__name__
    'OpenEXR'
    """
    import OpenEXR

    return OpenEXR
