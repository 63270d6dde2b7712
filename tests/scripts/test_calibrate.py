"""The calibration of the error bars: its cases are drawn apart, its models are what they are said to be."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from homofact.evaluation.bar.table import Table
from homofact.stability.fault import CasePart
from homofact.stability.faults import FAULTS

Script = Callable[[str], ModuleType]


def test_a_case_comes_again_and_parts_share_nothing(script: Script, tmp_path: Path) -> None:
    cases = script("verdict.drawn_cases")
    one, two = (cases.drawn_case(CasePart.FIRST, 4, tmp_path) for _ in range(2))
    assert one.name == two.name
    assert one.samples.values.equal(two.samples.values)
    for part in CasePart:
        drawn = [cases.drawn_case(part, number, tmp_path) for number in range(10)]
        assert {case.fault.part for case in drawn if case.fault} == {part}
        assert [case.right for case in drawn] == [number % 5 < 3 for number in range(10)]
    assert sum(fault.part is CasePart.REPORT for fault in FAULTS.values()) >= 8
    assert {"tilted", "highlight-shifted"} <= set(FAULTS)
    assert [name for name, fault in FAULTS.items() if not fault.knowable] == ["scaled", "offset", "gamma"]


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_leaves_samples_that_can_be_fitted(script: Script, tmp_path: Path, name: str) -> None:
    cases, fault = script("verdict.drawn_cases"), FAULTS[name]
    clean = cases.measured(cases.drawn_case(CasePart.FIRST, 0, tmp_path).material, "lobe", 2500, 1)
    for strength in (fault.strengths[0], fault.strengths[-1]):
        planted = fault.plant(clean, float(strength), 3)
        assert len(planted) >= 40
        assert float(planted.values.min()) >= 0
        assert math.isfinite(float(planted.values.sum()))
        assert fault.plant(clean, float(strength), 3).values.equal(planted.values)
    # The mildest may hit none of so few samples.
    assert len(planted) != len(clean) or not (planted.values.equal(clean.values) and planted.wo.equal(clean.wo))


def test_ridge_finds_what_made_the_numbers_and_clips_what_it_has_not_seen(script: Script) -> None:
    module = script("verdict.regression")
    chance = np.random.default_rng(0)
    rows = [{"a": a, "b": b, "still": 1.0} for a, b in chance.normal(size=(400, 2))]
    target = np.array([2 + 3 * row["a"] - row["b"] for row in rows])
    standard = module.Standard(rows, ("a", "b", "still"))
    offset, weights = module.ridge(standard.of(rows), target, 1e-6)
    record = standard.record(offset, weights)
    assert set(record["columns"]) == {"a", "b"}
    table = Table.of({"made": {}, "bars": {}, "angles": {}, "warning": record, "threshold": 0.5})
    assert table.warning.value({"a": 0.5, "b": -0.5, "still": 1.0}) == pytest.approx(4.0, abs=0.1)
    far = [table.warning.value({"a": a, "b": 0.0, "still": 1.0}) for a in (5.0, 50.0)]
    assert far[0] == far[1] < 12


def test_a_logistic_tells_one_class_from_the_other(script: Script) -> None:
    module = script("verdict.regression")
    x = np.linspace(-2, 2, 200)[:, None]
    offset, weights = module.logistic(x, x[:, 0] > 0.5, 1e-4)
    assert -offset / weights[0] == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("count", "place"), [(9, 9), (19, 18), (99, 90), (5, 5)])
def test_nine_of_ten_are_within_the_quantile(script: Script, count: int, place: int) -> None:
    assert script("verdict.regression").conformal_quantile(range(1, count + 1)[::-1], 0.9) == place


def test_groups_weigh_the_same_in_their_quantile(script: Script) -> None:
    quantile = script("verdict.regression").quantile_of_groups
    # Ninety small misses of one group, and two of ten of another that are above 3.
    missed = [*(k / 100 for k in range(90)), *(1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 3.1, 3.2)]
    groups = ["a"] * 90 + ["b"] * 10
    assert quantile(missed, groups, 0.9) == 1.7
    assert quantile(missed, groups, 0.95) == 3.1
    assert quantile(missed, ["a"] * 100, 0.9) == 0.89
    assert quantile(missed[::-1], groups[::-1], 0.9) == 1.7
    assert quantile([], [], 0.9) == 1.0


def test_a_rate_has_its_interval(script: Script) -> None:
    low, high = script("verdict.regression").wilson(9, 10)
    assert (low, high) == (pytest.approx(0.596, abs=1e-3), pytest.approx(0.982, abs=1e-3))


def test_the_threshold_leaves_few_bad_fits_without_a_warning(script: Script) -> None:
    module = script("verdict.calibrating")
    scores = [k / 100 for k in range(100)]
    threshold = module.threshold_of(scores, [True] * 100)
    assert sum(score <= threshold for score in scores) == round(100 * module.SILENT)


@pytest.mark.slow
def test_a_table_is_made_and_reported_on(script: Script, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module = script("verdict.calibrate")
    store, table, out = tmp_path / "fits.jsonl", tmp_path / "table.json", tmp_path / "report.md"
    common = ["--short", "--data", str(tmp_path), "--store", str(store), "--table", str(table)]
    assert module.main(common) == 0
    kept = store.read_text(encoding="utf-8")
    made = table.read_text(encoding="utf-8")
    assert json.loads(made)["made"]["fits"] == len(kept.splitlines()) == 12
    # What the store holds is not fitted again, and the same table comes of it.
    assert module.main(common) == 0
    assert store.read_text(encoding="utf-8") == kept
    assert table.read_text(encoding="utf-8") == made
    assert module.main([*common, "--report", "2", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "Coverage of the stated bars" in text
    assert "a smoke test" in text
    capsys.readouterr()
