"""How terms are shared out over materials: the best split by trying all, and the script in its short form."""

import importlib
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    pytest.importorskip("embreex", reason="embreex is not installed: pip install 'homofact[relight]'")
    pytest.importorskip("mitsuba", reason="mitsuba is not installed: pip install 'homofact[mitsuba]'")
    return importlib.import_module("scripts.relighting.relight_terms")


@pytest.mark.parametrize("total", [3, 7, 11, 30])
def test_no_split_is_better_than_the_best(script: Any, total: int) -> None:
    """Curves that rise now and then, as those of pairs do."""
    rng = np.random.default_rng(total)
    errors = [np.abs(rng.normal(size=9)) / np.arange(1, 10) for _ in range(3)]
    counts = script.best_split(errors, total)
    assert min(counts) >= 1
    assert sum(counts) <= total
    tried = [
        sum(each[k] for each, k in zip(errors, split, strict=True))
        for split in product(range(1, 9), repeat=3)
        if sum(split) <= total
    ]
    assert sum(each[k] for each, k in zip(errors, counts, strict=True)) == pytest.approx(min(tried))


@pytest.mark.slow
def test_the_short_form_shares_out_as_many_terms_by_every_rule(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "terms.png"
    assert script.main(["--short", "--data", str(tmp_path), "--out", str(tmp_path), "--plot", str(picture)]) == 0
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("| ")
    ][2:]
    assert [row[0] for row in rows[-5:]] == ["share 99%", "light", "expected", "one K", "best"]
    for first in range(0, len(rows), 5):
        of_rules = rows[first : first + 5]
        assert all(int(row[2]) <= int(of_rules[0][2]) for row in of_rules)
        errors = [float(row[4].rstrip("%")) for row in of_rules]
        assert errors[4] == min(errors)
    assert picture.stat().st_size > 5000
