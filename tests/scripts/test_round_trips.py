"""Two tables of one material differ by their interpolation, which falls with the spacing."""

import importlib
import sys
from pathlib import Path

import pytest


def test_tables_agree_to_interpolation(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "scripts"))
    monkeypatch.delitem(sys.modules, "round_trips", raising=False)
    assert importlib.import_module("round_trips").main(["--short"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")][2:]
    rows = [[float(cell) for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[0] for row in rows] == [15, 30]
    for row in rows:
        # At the 99th percentile: no more apart than both are from the model.
        assert row[6] <= row[2] + row[4]
    # Twice the nodes: between half (where a node is missed) and a quarter of the error.
    assert rows[1][5] < 0.55 * rows[0][5]
