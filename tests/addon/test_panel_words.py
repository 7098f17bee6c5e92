"""What the panels say: in the artist's language, and with the names that stand on the buttons."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest
from arto.arto_addon.ui import translations
from arto.arto_addon.ui.places import _lines
from arto.arto_addon.world import hdris
from arto.core.errors import SceneError

ADDON = Path(translations.__file__).parents[1]
# Where the words of a call are: by the call's name, the number of the argument.
SAYS = {"say": 2, "slot": 2, "tr": 0}


def _texts(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _texts(node.body)
        yield from _texts(node.orelse)


def _said(path: Path) -> Iterator[str]:
    """The sentences and names that a module of the panels shows."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Assign):
            names = {getattr(target, "id", "") for target in node.targets}
            if names & {"bl_label", "label"}:
                yield from _texts(node.value)
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in SAYS and len(node.args) > SAYS[name]:
            yield from _texts(node.args[SAYS[name]])
        if name in {"label", "prop", "operator"}:
            for keyword in node.keywords:
                if keyword.arg == "text":
                    yield from _texts(keyword.value)


def test_every_sentence_is_in_every_language() -> None:
    modules = [*(ADDON / "ui").glob("*.py"), ADDON / "live" / "line.py", ADDON / "live" / "live.py"]
    said = {text for path in modules for text in _said(path) if re.search("[A-Za-z]{2}", text)}
    assert len(said) > 60
    for language, table in translations.table().items():
        known = {english for _, english in table}
        assert not said - known, language
        # what stands in braces is put in: it must be the same
        for (_, english), other in table.items():
            assert sorted(re.findall("{.*?}", english)) == sorted(re.findall("{.*?}", other))


def test_messages_name_buttons_as_they_are() -> None:
    labels = {cls.bl_label for cls in bpy.types.Operator.__subclasses__() if "ARTO" in cls.__name__}
    for cls in list(bpy.types.Operator.__subclasses__()):
        labels |= {c.bl_label for c in cls.__subclasses__() if "ARTO" in c.__name__}
    assert "Use It Here" in labels and "Relight" in labels
    named = set()
    for path in ADDON.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                named |= set(re.findall(r"\bpress ((?:[A-Z]\w+ ?)+)", node.value))
    assert len(named) >= 4
    for name in (name.strip() for name in named):
        assert name.startswith("F12") or any(name.startswith(label) for label in labels), name


def test_lines_break_where_the_text_does() -> None:
    assert _lines("one two\nthree", 40) == ["one two", "three"]


def test_what_is_no_picture_is_no_hdri(tmp_path) -> None:
    """Blender takes any file for an image: the .blend that is open, for one."""
    blend = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "empty.exr").write_text("")
    for name in ("shot.blend", "notes.txt", "empty.exr", "gone.exr", ""):
        with pytest.raises(SceneError, match="choose an HDRI"):
            hdris.check(tmp_path / name)
    for form, end in (("OPEN_EXR", "exr"), ("HDR", "hdr"), ("PNG", "png"), ("JPEG", "jpg")):
        image = bpy.data.images.new("One", 4, 2, float_buffer=True)
        image.pixels.foreach_set([0.5] * 32)
        image.file_format, image.filepath_raw = form, str(tmp_path / f"one.{end}")
        image.save()
        hdris.check(tmp_path / f"one.{end}")
