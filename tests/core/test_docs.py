"""What the pages name is there: files, modules, links."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import arto.core
import pytest

ROOT = Path(arto.core.__file__).resolve().parents[1]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), *(ROOT / f for f in ("README.md", "CHANGELOG.md"))]
FILE = re.compile(r"\b(?:core|tests|arto_addon|bench|tools|docs|typings)/[\w./-]+\.\w+")
NAME = re.compile(r"`(core(?:\.\w+)+)`")
LINK = re.compile(r"\]\(([^)#:]+)\)")


def is_there(name: str) -> bool:
    """Whether a dotted name leads to a module of the core, or to something in one."""
    module, *rest = f"arto.{name}".split(".")
    thing = importlib.import_module(module)
    for part in rest:
        if not hasattr(thing, part):
            try:
                importlib.import_module(f"{thing.__name__}.{part}")
            except (ImportError, AttributeError):
                return False
        thing = getattr(thing, part)
    return True


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_a_page_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not [name for name in FILE.findall(text) if not (ROOT / name).exists()]
    assert not [name for name in NAME.findall(text) if not is_there(name)]
    assert not [link for link in LINK.findall(text) if not (page.parent / link).exists()]


def test_a_name_that_leads_nowhere_is_found() -> None:
    assert is_there("core.field.tile.checksum_of") and is_there("core.fit.evidence.DROPPED")
    assert not is_there("core.evidence.DROPPED") and not is_there("core.hemicube.NO_FACES")
    assert FILE.findall("see core/proxy.py") == ["core/proxy.py"]
