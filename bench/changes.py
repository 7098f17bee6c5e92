"""The page docs/capture-changes.md, made of what a capture changes on its stage."""

from __future__ import annotations

from arto.arto_addon.stage.settings import CHANGES


def page() -> str:
    """The table as a page of the docs."""
    rows = [f"| `{c.setting}` | {c.to} | {c.why} |" for c in CHANGES]
    looks = [f"- `{c.setting}`: {c.look.replace('{}', 'its value')}." for c in CHANGES if c.look]
    return "\n".join(
        [
            "# What a capture changes, and why",
            "",
            "A capture works on a copy of the scene, which is removed at the end. Your scene",
            "stays as it is. The table has the settings that are changed on the copy.",
            "`capture.json` has the value of each before and while it was changed. The output",
            "is 32-bit float EXR, with nothing drawn over the picture. The world is black.",
            "Light groups, AOVs and passes are those of the capture.",
            "",
            "| setting | while capturing | why |",
            "|---|---|---|",
            *rows,
            "",
            "The render of the world's lamps is an ordinary render, and keeps your clamps.",
            "",
            "## Where the relit picture looks otherwise than your render",
            "",
            *looks,
            "",
            "(Made by `python -m bench changes docs/capture-changes.md`.)",
            "",
        ]
    )
