"""The table of separated light fields, in its short form."""

import importlib
from pathlib import Path

import pytest


def test_the_errors_grow_with_the_noise(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    script = importlib.import_module("scripts.relighting.light_field_numbers")
    assert script.main(["--short", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "light_field.md").read_text(encoding="utf-8")
    assert "a smoke test" in text
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")
    ]
    header, rows = rows[0], rows[2:]
    assert len(rows) == 4 * 3 * 4
    sun = [row for row in rows if row[:2] == ["sun", "phong-30"]]
    for name in ("error of L", "error of ρ̃"):
        errors = [float(row[header.index(name)]) for row in sun]
        assert errors == sorted(errors)
        assert errors[0] < 1e-12 < errors[1]
