"""scripts/editing/editing_numbers.py in its short form: every table has its rows, and figures are of the right size."""

import importlib
from pathlib import Path

import pytest


@pytest.mark.slow
def test_the_tables_of_editing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    arguments = ["--short", "--out", str(tmp_path / "n.md")]
    assert importlib.import_module("scripts.editing.editing_numbers").main(arguments) == 0
    text = (tmp_path / "n.md").read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(): [cell.strip() for cell in line.strip("|").split("|")[1:]]
            for line in text.splitlines() if line.startswith("|")}  # fmt: skip
    assert rows["stored, MB"][0] == "642"
    for name in ("tray: specular: distribution", "body: specular: alpha", "handle: specular: half"):
        settled, low_rank = float(rows[name][4]), float(rows[name][5])
        assert settled < 1e-6
        assert low_rank < 0.05
    texels = rows["theta_h-theta_d + theta_d-phi_d: texels"]
    assert float(texels[0].rstrip("%")) < 1
    assert texels[2:] == ["+0", "+0"]
    assert rows["wi + d: texture"][3] == "+1"
    assert {"CT", "AS", "HF", "LV", "HD"} <= set(rows)
