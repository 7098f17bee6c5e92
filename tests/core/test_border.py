"""`core` and Blender do not know each other; modules stay small; EXR files have one door; imports
flow one way."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import arto.core
import pytest

CORE = Path(arto.core.__file__).parent
MODULES = sorted(CORE.rglob("*.py"))
NAMES = [".".join(("arto", "core", *m.relative_to(CORE).with_suffix("").parts)) for m in MODULES]
BLENDER = {"bpy", "mathutils", "gpu", "bmesh", "bpy_extras", "bl_ui", "blf", "imbuf"}


def imported(module: Path) -> set[str]:
    """The first name of everything that a module imports, wherever in it."""
    out = set()
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            out |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            out |= {node.module.split(".")[0]} if node.module and not node.level else set()
            out |= {a.name for a in node.names} if node.level else set()
            if node.level and node.module:
                out |= set(node.module.split("."))
        elif isinstance(node, ast.Constant) and node.value in BLENDER | {"OpenImageIO"}:
            out.add(str(node.value))  # import_module("bpy")
    return out


def test_the_walk_sees_imports_of_every_kind(tmp_path: Path) -> None:
    sly = tmp_path / "sly.py"
    sly.write_text(
        "def f():\n import bpy.types\n from mathutils import Vector\n"
        " import_module('gpu')\n from ..arto_addon import plate\n"
    )
    assert {"bpy", "mathutils", "gpu", "arto_addon"} <= imported(sly)
    assert len(MODULES) > 15


@pytest.mark.parametrize("module", MODULES, ids=lambda m: str(m.relative_to(CORE)))
def test_core_module_is_free_of_blender_and_small(module: Path) -> None:
    assert not imported(module) & (BLENDER | {"arto_addon"})
    # each library of EXR files is imported in one module
    assert ("OpenEXR" in imported(module)) == (module.name == "open_exr.py")
    assert ("OpenImageIO" in imported(module)) == (module.name == "open_image_io.py")
    assert len(module.read_text().splitlines()) < 400


HOUSE = [
    p
    for folder in ("arto_addon", "bench", "tools")
    for p in sorted((CORE.parent / folder).rglob("*.py"))
]


@pytest.mark.parametrize("module", HOUSE, ids=lambda m: str(m.relative_to(CORE.parent)))
def test_every_module_is_small_and_documented(module: Path) -> None:
    text = module.read_text()
    assert len(text.splitlines()) < 400
    assert ast.get_docstring(ast.parse(text))


def test_settings_need_no_blender() -> None:
    files = [p for p in HOUSE if p.parent.name == "settings"]
    assert "table" in {p.stem for p in files}
    assert not set().union(*map(imported, files)) & BLENDER


TESTS = sorted((CORE.parent / "tests").rglob("test_*.py"))


@pytest.mark.parametrize("module", TESTS, ids=lambda m: m.stem)
def test_no_test_module_leans_on_another(module: Path) -> None:
    """What tests share is in the `_tools` beside them: a test that moves then breaks no other."""
    assert not {name for name in imported(module) if name.startswith("test_")}


def test_the_house_is_as_the_architecture_says() -> None:
    """Every module of the core and of the add-on is named there, and every folder of the add-on."""
    said = (CORE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    there = {
        p.stem for p in [*MODULES, *HOUSE] if p.is_relative_to(CORE) or "arto_addon" in p.parts
    }
    there |= {p.parent.name for p in HOUSE if p.parent.parent.name == "arto_addon"}
    assert not {name for name in there - {"__init__"} if f"`{name}`" not in said}


# The rooms in the order of their imports: each may import those before it, and none after it. A
# module that stands alone is a room by itself. docs/architecture.md quotes both lists.
FLOW = {
    "core": """errors < units < memory < regular < picture_files < checksum < before < marked
    < files < places < arrays < signed < region < file_names < description < values < shot
    < metrics < patterns < measure < faces < partition < dome < hemicube < mix < exr < cryptomatte
    < capture < light < kit < supports < field < fit < lights < relight < catcher < preview
    < inside < place < match < verify < finish < photographs < web""",
    "arto_addon": """interrupt < work < settings < blender < stage < shot < kit < world < plate
    < fit < capture < photographer < relight < match < sheet < web < shoot < photographs < job
    < resident < live < farm < ui""",
}


def named(file: Path) -> str:
    """The dotted name of a module: `core.exr.layout`, and `core.exr` for the room's own file."""
    return ".".join(file.relative_to(CORE.parent).with_suffix("").parts).removesuffix(".__init__")


def imports_of(file: Path, modules: set[str]) -> set[str]:
    """The modules of the house that a module imports, wherever in it."""
    folder = named(file).split(".")[: None if file.name == "__init__.py" else -1]
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if not isinstance(node, ast.ImportFrom) or not node.level:
            continue
        above = folder[: len(folder) - node.level + 1]
        source = ".".join([*above, *(node.module or "").split(".")]).strip(".")
        for alias in node.names:
            whole = f"{source}.{alias.name}"
            found.add(whole if whole in modules else source)
    return found & modules


def graph(files: list[Path]) -> dict[str, set[str]]:
    modules = {named(file) for file in files}
    return {named(file): imports_of(file, modules) - {named(file)} for file in files}


def circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle, as many as there are; empty for none."""
    left = dict(imports)
    while free := [module for module, others in left.items() if not others & left.keys()]:
        for module in free:
            del left[module]
    return sorted(left)


def test_a_circle_of_imports_is_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == [*"abcd"]
    assert circle({"a": {"b"}, "b": {"c"}, "c": set()}) == []


def test_no_import_goes_in_a_circle() -> None:
    imports = graph([*MODULES, *sorted((CORE.parent / "arto_addon").rglob("*.py"))])
    # the walk sees an import of a name, of a module, and of a room
    assert {"core.region", "core.supports"} <= imports["core.field.merged"]
    assert sum(map(len, imports.values())) > 300
    assert not circle(imports)


@pytest.mark.parametrize("world", FLOW)
def test_rooms_import_one_way(world: str) -> None:
    files = sorted((CORE.parent / world).rglob("*.py"))
    order = FLOW[world].replace("<", " ").split()
    against = []
    for module, others in graph(files).items():
        rooms = [module.split(".")[1]] if "." in module else []
        for room in rooms:
            assert room in order, f"'{room}' is new: give it a place in FLOW and on the page"
            for other in (o for o in others if "." in o):
                if order.index(other.split(".")[1]) > order.index(room):
                    against.append(f"{module} imports {other}")
    assert not against


@pytest.mark.parametrize("world", FLOW)
def test_the_page_says_the_order_of_the_rooms(world: str) -> None:
    said = (CORE.parent / "docs" / "architecture.md").read_text().split()
    assert " ".join(FLOW[world].split()) in " ".join(said)


def in_new_process(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_importing_core_loads_nothing_of_blender_and_no_library_of_files() -> None:
    names = [n.removesuffix(".__init__") for n in NAMES]
    loads = f"import importlib, sys; [importlib.import_module(n) for n in {names}]"
    unwanted = BLENDER | {"OpenEXR", "OpenImageIO"}
    found = in_new_process(f"{loads}; print(sorted(set(sys.modules) & {unwanted}))")
    assert found == "[]"


def test_the_root_package_imports_where_there_is_no_bpy() -> None:
    # None in sys.modules makes `import bpy` fail, as where Blender is not installed
    code = (
        "import sys; sys.modules['bpy'] = None; import arto; "
        "print(callable(arto.register), callable(arto.unregister)); "
        "print('arto.arto_addon' in sys.modules)"
    )
    assert in_new_process(code) == "True True\nFalse"
