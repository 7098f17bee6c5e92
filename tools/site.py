"""Build the pages as a site: `python -m tools.site OUT` (needs `pip install -e ".[dev]"`).

The site has the same files that the repository has: the README is its first page, and `docs/` the
others. A link that leads nowhere ends the build.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Pages by part, by their reader: an artist, a compositor, a farm, and who wants to know
# how it works. What is missing here is listed last, so that no page is forgotten.
PARTS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("For artists", ("guide", "match", "live", "photographs", "scenes", "safety")),
    ("In a pipeline", ("plates", "comp", "farm", "capture-format", "field-format", "web-format")),
    ("Measured", ("accuracy", "speed", "heavy", "measurements", "settings", "identifiability")),
    ("How it is built", ("architecture", "capture-changes", "window")),
)
SETTINGS = {
    "extensions": "myst_parser",
    "project": "ARTO",
    "html_theme": "furo",
    "html_title": "ARTO",
    "myst_heading_anchors": "3",
}
_LINK = re.compile(r"(\]\()docs/")


def pages() -> list[str]:
    """The pages' names, those that no part lists last."""
    there = {page.stem for page in (ROOT / "docs").glob("*.md")}
    listed = [name for _, names in PARTS for name in names]
    return [name for name in listed if name in there] + sorted(there - set(listed))


def contents() -> str:
    """The list of all pages, for the end of the first one."""
    there, out = set(pages()), []
    listed = {name for _, names in PARTS for name in names}
    more = tuple(sorted(there - listed))
    for title, names in (*PARTS, ("More", (*more, "changelog"))):
        named = [name for name in names if name in there or name == "changelog"]
        out += ["", "```{toctree}", ":hidden:", f":caption: {title}", "", *named, "```"]
    return "\n".join(out)


def build(out: Path) -> Path:
    """Build the site into a folder -> its first page. Raises CalledProcessError."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "pages"
        shutil.copytree(ROOT / "docs", source)
        readme = (ROOT / "README.md").read_text(encoding="utf-8")
        first = _LINK.sub(r"\1", readme) + contents() + "\n"
        (source / "index.md").write_text(first, encoding="utf-8")
        shutil.copy(ROOT / "CHANGELOG.md", source / "changelog.md")
        shutil.copy(ROOT / "CITATION.cff", source)
        line = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-C"]
        for name, value in SETTINGS.items():
            line += ["-D", f"{name}={value}"]
        subprocess.run([*line, "-d", f"{folder}/cache", str(source), str(out)], check=True)
    return out / "index.html"


if __name__ == "__main__":
    print(build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "site"))
