"""The pages as a site: all of them are in it, and a link that leads nowhere ends the build."""

import shutil
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("myst_parser", reason="the site's generator needs Python 3.12 or later")

from arto.tools import site


def test_every_page_is_in_the_site_and_a_broken_link_is_found(tmp_path: Path, monkeypatch) -> None:
    first = site.build(tmp_path / "site")
    text = first.read_text(encoding="utf-8")
    pages = sorted((site.ROOT / "docs").glob("*.md"))
    assert len(pages) > 10
    assert not [p.stem for p in pages if f'href="{p.stem}.html"' not in text]
    assert (tmp_path / "site" / "_images").is_dir()

    for name in ("docs", "README.md", "CHANGELOG.md", "CITATION.cff"):
        place = tmp_path / "other" / name
        if name == "docs":
            shutil.copytree(site.ROOT / name, place)
        else:
            place.write_text((site.ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    with (tmp_path / "other" / "docs" / "guide.md").open("a", encoding="utf-8") as page:
        page.write("\nSee [nothing](no-such-page.md).\n")
    monkeypatch.setattr(site, "ROOT", tmp_path / "other")
    with pytest.raises(subprocess.CalledProcessError):
        site.build(tmp_path / "broken")
