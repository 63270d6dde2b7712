"""Fits by several seeds and on several splits: each fit as by itself, and the figures of their spread."""

import json
import math
from dataclasses import replace

import pytest

import homofact.evaluation.compare
import homofact.evaluation.repeats
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput, Status
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.repeats import RepeatedRows, fit_repeats
from homofact.evaluation.spread import Spread
from homofact.methods.cole import Cole
from homofact.methods.mccool import McCool

pytestmark = pytest.mark.usefixtures("unseen")

COLE = Cole(textures=1, size=4, restarts=1, search_size=3, search_samples=60, seed=3)


@pytest.fixture(scope="module")
def source() -> Source:
    return open_source("material:blinn-phong-50", count=300)


@pytest.fixture(scope="module")
def several(source: Source) -> RepeatedRows:
    return fit_repeats(source, COLE, 3)


def test_figures_by_hand() -> None:
    found = Spread.of([1.0, 2.0, 6.0])
    assert (found.count, found.mean, found.low, found.high) == (3, 3.0, 1.0, 6.0)
    assert found.deviation == pytest.approx(math.sqrt((4 + 1 + 9) / 2))
    assert Spread.of([2.0]) == Spread(1, 2.0, 2.0, 2.0, None)


def test_each_row_is_the_fit_of_its_seed_on_the_first_one_s_split(source: Source, several: RepeatedRows) -> None:
    assert several.seeds == (3, 4, 5)
    assert several.first.held_out == fit_and_measure(source, COLE).held_out
    for row in several.rows[1:]:
        assert row.split == several.first.split
        alone = fit_and_measure(source, row.settings, split_seed=3)
        assert (alone.held_out, alone.train) == (row.held_out, row.train)
        # Another fit than by the split's own seed, and not another split.
        assert row.held_out != several.first.held_out


def test_the_spread_is_over_the_rows(several: RepeatedRows) -> None:
    errors = [row.held_out.log_mse for row in several.rows]
    found = several.held_out["log_mse"]
    assert (found.low, found.high) == (min(errors), max(errors))
    assert found.mean == pytest.approx(sum(errors) / 3)


def test_the_record_has_means_spreads_and_every_row(several: RepeatedRows) -> None:
    record = json.loads(json.dumps(several.record()))
    assert record["seeds"] == [3, 4, 5]
    assert record["error"]["train"]["mae"] == several.train["mae"].mean
    assert record["spread"]["error"]["train"]["mae"] == several.train["mae"].record()
    assert record["spread"]["seconds"]["fit"]["max"] == max(row.seconds_fit for row in several.rows)
    assert [row["seed"] for row in record["rows"]] == [3, 4, 5]
    assert {row["split"]["seed"] for row in record["rows"]} == {3}
    assert RepeatedRows(several.rows[:1]).record() == several.first.record()


def test_what_cannot_be_meant_is_refused(source: Source, several: RepeatedRows) -> None:
    with pytest.raises(BadInput, match="seeds: found 0, expected at least 1"):
        fit_repeats(source, COLE, 0)
    with pytest.raises(BadInput, match="seeds: found no fit"):
        RepeatedRows(())
    other = fit_and_measure(source, McCool(size=4), split_seed=9)
    # A split by another seed is a repeat; another part held out is not.
    assert RepeatedRows((several.first, other)).splits == (3, 9)
    with pytest.raises(BadInput, match="splits: found fits to other samples or other parts"):
        RepeatedRows((several.first, replace(other, split=replace(other.split, held_out=0.5))))
    with pytest.raises(BadInput, match="splits: found 0, expected at least 1"):
        fit_repeats(source, COLE, splits=0)
    with pytest.raises(BadInput, match="splits: found 2 with nothing held out"):
        fit_repeats(source, COLE, splits=2, held_out=0)


def test_splits_hold_out_other_samples_and_keep_the_seed_of_the_fit(source: Source) -> None:
    method = McCool(size=4, seed=3)
    found = fit_repeats(source, method, seeds=2, splits=2)
    drawn = [(row.split.seed, row.settings.seed) for row in found.rows]
    assert drawn == [(3, 3), (3, 4), (4, 3), (4, 4)]
    assert (found.seeds, found.splits) == ((3, 4), (3, 4))
    for row in found.rows:
        alone = fit_and_measure(source, row.settings, split_seed=row.split.seed)
        assert (alone.held_out, alone.train) == (row.held_out, row.train)
    assert len({row.held_out.log_mse for row in found.rows if row.settings.seed == 3}) == 2
    assert found.of_split(4).rows == found.rows[2:]
    record = found.record()
    assert (record["seeds"], record["splits"]) == ([3, 4], [3, 4])
    assert [row["split"]["seed"] for row in record["rows"]] == [3, 3, 4, 4]
    assert fit_repeats(source, method, seeds=[7], splits=[1, 8]).splits == (1, 8)


def test_an_interrupt_ends_it(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted: list[ComparisonRow] = []

    def stopped(*arguments: object) -> ComparisonRow:
        row = fit_and_measure(*arguments)  # type: ignore[arg-type]
        fitted.append(row)
        return replace(row, report=replace(row.report, status=Status.INTERRUPTED)) if len(fitted) == 2 else row

    monkeypatch.setattr(homofact.evaluation.repeats, "fit_and_measure", stopped)
    assert fit_repeats(source, COLE, 4).seeds == (3, 4)


def test_an_interrupted_fit_is_the_last_of_a_comparison(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*arguments: object) -> ComparisonRow:
        row = fit_and_measure(*arguments)  # type: ignore[arg-type]
        return replace(row, report=replace(row.report, status=Status.INTERRUPTED))
