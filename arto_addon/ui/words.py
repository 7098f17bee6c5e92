"""Sentences in the artist's language: translated before their values are put in."""

from __future__ import annotations

import bpy


def tr(text: str, **values: object) -> str:
    """The sentence in the language of the interface, with its values."""
    out = bpy.app.translations.pgettext_iface(text)
    if not values:
        return out
    try:
        return out.format(**values)
    except (KeyError, IndexError, ValueError):
        return text.format(**values)  # of a translation that names another value
