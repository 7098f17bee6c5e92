"""Sentences in the artist's language: translated before their values are put in."""

from __future__ import annotations

import bpy


def tr(text: str, **values: object) -> str:
    """Translate a sentence to the language of the interface, then put its values in."""
    out = bpy.app.translations.pgettext_iface(text)
    if not values:
        return out
    try:
        return out.format(**values)
    except (KeyError, IndexError, ValueError):
        return text.format(**values)  # the translation names a value that is not given
