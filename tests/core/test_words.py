"""Every public name of `core` is documented, and the examples in the documentation are true."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import enum
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import arto.core
import pytest

CORE = Path(arto.core.__file__).parent
MODULES = [
    ".".join(("arto", "core", *path.relative_to(CORE).with_suffix("").parts))
    for path in sorted(CORE.rglob("*.py"))
    if path.name != "__init__.py"
]
HEADING = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)


def sections(text: str) -> dict[str, str]:
    """The sections of a docstring by their headings; what stands before them is ''."""
    found = HEADING.split(inspect.cleandoc(text))
    return {"": found[0]} | dict(zip(found[1::2], found[2::2], strict=True))


def named_in(section: str) -> set[str]:
    """The names that a section describes: `a : int`, or `a, b : (n,) float` for several."""
    lines = [line for line in section.splitlines() if line and not line.startswith(" ")]
    names = (name for line in lines for name in line.split(" : ")[0].split(","))
    return {name.strip().lstrip("*") for name in names}


def public(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """The public functions, classes and methods that a module defines, by name."""
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", "") == module.__name__
        if name.startswith("_") or not own or not (inspect.isfunction(thing) or _is_class(thing)):
            continue
        yield name, thing
        if _is_class(thing):
            for inner, method in vars(thing).items():
                if not inner.startswith("_"):
                    yield f"{name}.{inner}", method


def _is_class(thing: Any) -> bool:
    return inspect.isclass(thing)


def _parameters(thing: Any) -> set[str]:
    if dataclasses.is_dataclass(thing):
        return {f.name for f in dataclasses.fields(thing) if not f.name.startswith("_")}
    if inspect.isclass(thing) and getattr(thing, "_is_protocol", False):
        return set(thing.__annotations__)
    if inspect.isclass(thing) and thing.__init__ is object.__init__:
        return set()
    if inspect.isclass(thing) and issubclass(thing, enum.Enum):
        return set()
    names = set(inspect.signature(thing).parameters) - {"self", "cls"}
    return {name for name in names if not name.startswith("_")}


def faults(name: str, thing: Any) -> list[str]:
    """What a docstring lacks, in words."""
    if isinstance(thing, staticmethod | classmethod):
        thing = thing.__func__
    if isinstance(thing, property) or hasattr(thing, "attrname"):
        inner = thing.fget if isinstance(thing, property) else thing.func
        return [] if inspect.getdoc(inner) else [f"{name} has no docstring"]
    if not (inspect.isfunction(thing) or inspect.isclass(thing)):
        return []
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return [] if thing.__doc__ else [f"{name} has no docstring"]
    said = thing.__doc__
    if not said or (dataclasses.is_dataclass(thing) and said.startswith(f"{thing.__name__}(")):
        return [f"{name} has no docstring"]
    found = sections(said)
    described = named_in(found.get("Parameters", "")) | named_in(found.get("Attributes", ""))
    out = [f"{name} does not describe '{p}'" for p in sorted(_parameters(thing) - described)]
    gives = not inspect.isclass(thing) and thing.__annotations__.get("return") != "None"
    if gives and not {"Returns", "Yields"} & found.keys():
        out.append(f"{name} does not say what it returns")
    if not re.match(r"[^\n]+[.:?](\n|$)|[^\n]+\n[^\n]+[.:?](\n|$)", found[""]):
        out.append(f"{name} does not begin with a sentence")
    return out


def is_a_model(module: ModuleType, name: str) -> bool:
    """Whether a method is one of a support model's three, which `supports.base` describes."""
    room = module.__name__.startswith("arto.core.supports.") and not name.startswith("Support.")
    return room and name.rpartition(".")[2] in {"fit", "average", "plane"}


def test_a_fault_is_found() -> None:
    def good(a: int, b: int) -> int:
        """Add.

        Parameters
        ----------
        a, b : int

        Returns
        -------
        int
        """
        return a + b

    def bad(a: int, b: int) -> int:
        """Add.

        Parameters
        ----------
        a : int
        """
        return a + b

    assert faults("good", good) == []
    assert faults("bad", bad) == ["bad does not describe 'b'", "bad does not say what it returns"]


@pytest.mark.parametrize("name", MODULES)
def test_every_public_name_is_documented(name: str) -> None:
    module = importlib.import_module(name)
    names = [(n, thing) for n, thing in public(module) if not is_a_model(module, n)]
    assert [fault for n, thing in names for fault in faults(n, thing)] == []


@pytest.mark.parametrize("name", MODULES)
def test_examples_are_true(name: str) -> None:
    module = importlib.import_module(name)
    found = [t for t in doctest.DocTestFinder(exclude_empty=True).find(module) if t.examples]
    assert found, f"{name} has no example"
    runner = doctest.DocTestRunner(
        verbose=False, optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    )
    for test in found:
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


def test_every_example_stands_in_a_docstring_that_is_run() -> None:
    """Private functions and nested ones too: the finder sees all but functions in functions."""
    for name in MODULES:
        tree = ast.parse((CORE.parent / Path(*name.split(".")[1:])).with_suffix(".py").read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                inner = [n for n in ast.walk(node) if isinstance(n, ast.FunctionDef) and n != node]
                assert not [n.name for n in inner if ">>>" in (ast.get_docstring(n) or "")]
