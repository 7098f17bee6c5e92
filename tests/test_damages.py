"""Damages, kills and files of others: `python -m bench safety`, with fewer kills."""

from __future__ import annotations

import pytest

from bench import safety, safety_kills


@pytest.mark.parametrize("kind", [kind for kind in safety.KINDS if kind != "large"])
def test_nothing_wrong_is_shown_and_nothing_is_lost(kind, monkeypatch, capfd) -> None:
    monkeypatch.setattr(safety, "KINDS", {kind: safety.KINDS[kind]})
    monkeypatch.setattr(safety_kills, "EACH", 2)
    rows = safety.safety()
    capfd.readouterr()  # the library of EXR warns of each part
    assert [row for row in rows if row["outcome"] not in ("right", "typed error")] == []
    assert rows[0]["outcome"] == "right"
    assert len(rows) > 1 or kind == "writers"
