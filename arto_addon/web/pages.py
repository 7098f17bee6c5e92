"""The text of a page: its template, style and script, and where its shot is."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from pathlib import Path

# What a page is made of; it comes with the extension.
PAGE = Path(__file__).resolve().parent / "page"
SCRIPTS = ("shot.js", "light.js", "picture.js", "page.js")
# The files of a page's folder.
SHOT, INDEX = "shot.artoweb", "index.html"


def page(
    title: str,
    ratio: float,
    worlds: Sequence[str],
    pictures: Sequence[str],
    single: str,
    shot: bytes | None = None,
) -> str:
    """Give the text of a page.

    title: of the shot; ratio: of its width to its height; worlds: the names of its lights;
    pictures: an address of a picture for each, shown where the light cannot turn; single: the name
    of the page that is one file; shot: what is put into the page, by default it is read beside it.
    """
    data = {
        "title": title,
        "ratio": round(ratio, 5),
        "worlds": list(worlds),
        "pictures": list(pictures),
        "single": single,
        "url": None if shot is not None else SHOT,
        "base64": None if shot is None else base64.b64encode(shot).decode(),
    }
    # a text in a script must not end the script
    text = json.dumps(data).replace("<", "\\u003c")
    parts = {
        "TITLE": html.escape(title),
        "STYLE": (PAGE / "page.css").read_text(encoding="utf-8"),
        "SCRIPT": "\n".join((PAGE / name).read_text(encoding="utf-8") for name in SCRIPTS),
        "DATA": text,
    }
    out = (PAGE / "page.html").read_text(encoding="utf-8")
    # what is put in last is looked at for no more marks
    for mark in ("STYLE", "TITLE", "SCRIPT", "DATA"):
        before, *after = out.split(mark) if mark == "TITLE" else out.split(mark, 1)
        out = before + "".join(parts[mark] + rest for rest in after)
    return out


def address(picture: bytes) -> str:
    """The address of a picture that is in the page itself. picture: the bytes of a JPEG."""
    return "data:image/jpeg;base64," + base64.b64encode(picture).decode()
