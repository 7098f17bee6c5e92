"""What a script for a compositor is known by as ARTO's own, as long as nobody has changed it.

A script is written to be changed. So each has a line with a digest of its text: one that the artist
has saved since is the artist's, and stays.

Examples
--------
>>> text = stamped(f"# {LINE}\\nversion 12.0 v1\\n")
>>> is_own(text), is_own(text.replace("12.0", "15.1")), is_own("version 12.0 v1\\n")
(True, False, False)
"""

from __future__ import annotations

import hashlib
import re

_NONE = "0" * 16
# What a script must have somewhere, once; `stamped` fills the digest in.
LINE = f"ARTO mix {_NONE}"
_LINE = re.compile("ARTO mix [0-9a-f]{16}")


def stamped(text: str) -> str:
    """Fill the digest of a script into its line.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    return text.replace(LINE, f"ARTO mix {_digest(text)}", 1)


def is_own(text: str) -> bool:
    """Say whether ARTO has written a script as it is.

    Parameters
    ----------
    text : str

    Returns
    -------
    bool
    """
    found = _LINE.search(text)
    return found is not None and stamped(text.replace(found[0], LINE)) == text


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]
