"""Descriptions with a digest: JSON whose last line tells whether the lines before it were changed.

A description without a digest is of the version before, or somebody took the line out to change the
rest.

Examples
--------
>>> text = text_of({"height": 540})
>>> parsed(text)
{'height': 540}
>>> parsed(text.replace("540", "541"))
Traceback (most recent call last):
...
ValueError: it is damaged: its digest differs; ...
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from .files import write_text

# The name of the digest, what stands before it, and what a description ends with.
DIGEST = "digest"
# The most lists and objects of a description: each takes far more memory than its two letters.
MOST_LISTS = 1_000_000
_BEFORE, _END = f',\n "{DIGEST}": ', "\n}"


def write(path: Path, data: dict[str, Any]) -> None:
    """Write a description and its digest, whole or not at all.

    Parameters
    ----------
    path : Path
    data : dict
        As `json` writes it, with one value at the least.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    write_text(path, text_of(data))


def text_of(data: dict[str, Any]) -> str:
    """Give the text that `write` writes.

    Parameters
    ----------
    data : dict

    Returns
    -------
    str
    """
    return _signed(json.dumps(data, indent=1)[: -len(_END)]) + "\n"


def parsed(text: str) -> dict[str, Any]:
    """Parse a description, and compare it with its digest where it has one.

    Parameters
    ----------
    text : str
        With the ends of lines of any system.

    Returns
    -------
    dict
        Without the digest.

    Raises
    ------
    ValueError
        The text is no JSON object, has too many lists, or was changed.
    """
    if text.count("[") + text.count("{") > MOST_LISTS:
        raise ValueError(f"it has more than {MOST_LISTS} lists")
    data = json.loads(text, parse_constant=_refuse)
    if not isinstance(data, dict):
        raise ValueError("it is no description")
    text = text.replace("\r\n", "\n").rstrip()
    if data.pop(DIGEST, None) is not None and _signed(text.rpartition(_BEFORE)[0]) != text:
        raise ValueError(
            "it is damaged: its digest differs; if it was changed on purpose, take out its line "
            f"'{DIGEST}'"
        )
    return data


def _signed(body: str) -> str:
    """A description with its digest. body: the description without its end."""
    found = hashlib.blake2b(body.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()
    return f'{body}{_BEFORE}"{found}"{_END}'


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")
