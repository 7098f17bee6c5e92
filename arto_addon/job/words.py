"""What a job says, in an artist's words."""

from __future__ import annotations

import re

_RENDERS = re.compile(r"render (\d+) of (\d+): \d+ basis images")


def plain(text: str) -> str:
    """A job's text in an artist's words."""
    found = _RENDERS.fullmatch(text)
    if found is None:
        return text
    part, parts = found.groups()
    return "rendering" if parts == "1" else f"rendering, part {part} of {parts}"
