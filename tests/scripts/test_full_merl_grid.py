"""The large-input benchmark in its short form: every method reads the same grid and leaves its figures."""

import importlib
import sys

import pytest


@pytest.mark.slow
def test_every_method_reads_and_fits_the_grid(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "full_merl_grid", raising=False)
    script = importlib.import_module("scripts.data.full_merl_grid")
    assert script.main(["--short", "--material", "phong-10"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    rows = {
        cells[0]: [float(x) for x in cells[1:]]
        for cells in ([c.strip() for c in x.split("|")[1:-1]] for x in lines[2:])
    }
    assert set(rows) == set(script.METHODS)
    assert len({row[0] for row in rows.values()}) == 1
    for row in rows.values():
        # Read and fit are parts of the total; the peak holds at least the libraries.
        assert 0 < row[1] + row[2] <= row[3] * 1.01
        assert row[4] > 100
    assert rows["search"][6] < rows["mccool"][6]
