"""How long fits will take: the model's order of magnitude, what finished fits tell, and the words."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from homofact.brdf.source import Source, open_source
from homofact.evaluation.chart import estimate_charts, plan, run_chart
from homofact.evaluation.chart_ledger import ChartLedger
from homofact.evaluation.estimate import TimeEstimate, about, fit_seconds, training_count
from homofact.evaluation.split import Split
from homofact.methods.cole import Cole
from homofact.methods.common import at_azimuths
from homofact.methods.table import METHODS, made_each, methods_with, settings_of_class

PAINT = str(Path(__file__).resolve().parents[2] / "data_synthetic" / "synthetic_cornell.brdf")
COLE = Cole(textures=1, restarts=1, search_size=3, search_samples=60)


@pytest.fixture(scope="module")
def source() -> Source:
    return open_source("material:blinn-phong-50", count=300)


@pytest.mark.parametrize("name", METHODS)
def test_more_of_anything_takes_longer(name: str) -> None:
    method: Any = METHODS[name]
    base = method(size=8)
    more_textures = {"mccool": {"projections": ("wi", "h", "wo")}}.get(name, {"textures": 4})
    for more in ({"size": 32}, {"size": 9} if name in ("svd", "nmf") else more_textures):
        assert fit_seconds(replace(base, **more), 10_000) > fit_seconds(base, 10_000)
    assert fit_seconds(base, 100_000) > fit_seconds(base, 10_000)


def test_the_chart_of_the_readme_takes_less_than_a_minute(tmp_path: Path) -> None:
    """It took 43 s on two cores."""
    paint = open_source("material:lafortune-blue-paint")
    methods = made_each(("mccool", "cole"), {}) | made_each(("search",), {"effort": "quick"})
    runs = plan(methods, (1, 2, 3), (8, 16), ("gradient",))
    found = estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], runs)
    assert found.left == len(runs) == 14
    assert 43 / 2 < found.seconds_left < 43 * 2


@pytest.mark.parametrize("name", methods_with("budget"))
def test_a_guard_bounds_the_search(name: str) -> None:
    method: Any = METHODS[name]
    # A search among known mixes is over before any guard.
    longer = {"effort": "thorough"} if name in methods_with("effort") else {}
    free, guarded = method(**longer), method(budget=1.0, **longer)
    assert fit_seconds(guarded, 1000) < 2 < fit_seconds(free, 1000)
    assert fit_seconds(replace(guarded, budget=1e6), 1000) == fit_seconds(free, 1000)


@pytest.mark.parametrize("path", [PAINT, "material:blinn-phong-50"])
@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("subset", [0, 100])
def test_the_samples_are_counted_as_the_fit_gets_them(path: str, name: str, subset: int) -> None:
    source, settings = open_source(path, count=300), METHODS[name]()
    train = Split.of(source, 0.2, 0, subset).parts(source)[0]
    if "copies" in settings_of_class(METHODS[name]):
        train = at_azimuths(train, settings, knows_azimuth=True)
    assert training_count(source, settings, 0.2, subset) == len(train)


def test_finished_fits_correct_the_others() -> None:
    found = TimeEstimate([("cole", 10.0), ("cole", 30.0), ("search", 5.0), ("search", 5.0)])
    assert (found.left, found.seconds_left, found.words()) == (4, 50.0, "4 fits, about 50 s")
    found.finish(0, 30.0)
    # Cole's took three times as long; what that says of others goes to twice at most.
    assert found.seconds_left == 3 * 30 + 2 * 10
    found.finish(2, 5.0)
    assert found.seconds_left == 3 * 30 + 5
    found.finish(1, 90.0)
    assert (found.left, found.words()) == (1, "1 fit, under 10 s")
    several = TimeEstimate([("cole", 1.0)] * 4)
    several.finish_first(2, 8.0)
    assert (several.left, several.seconds_left) == (2, 8.0)


@pytest.mark.slow
def test_what_a_ledger_has_is_done_and_tells_of_the_rest(source: Source, tmp_path: Path) -> None:
    ledger = ChartLedger(tmp_path / "a.csv")
    runs = plan({"cole": COLE}, (1, 2), (3, 4), ("gradient",))
    told: list[int] = []
    rows = run_chart(source, runs[:2], ledger, ended=lambda place, _: told.append(place))
    assert told == [0, 1]
    found = estimate_charts([(source, ledger)], runs)
    assert found.left == 2
    # The search of the last begins as that of the one before it does.
    modelled = [fit_seconds(run.settings, 240, known) for run, known in zip(runs, (0, 0, 0, 1), strict=True)]
    measured = sum(row.seconds_total - row.seconds_read for row in rows)
    assert found.seconds_left == pytest.approx(sum(modelled[2:]) * measured / sum(modelled[:2]))


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0, "under 10 s"), (10, "about 10 s"), (61, "about 70 s"), (90, "about 2 min"), (305, "about 6 min"),
        (3600, "about 60 min"), (9000, "about 2.5 h"),
    ],
)  # fmt: skip
def test_words(seconds: float, words: str) -> None:
    assert about(seconds) == words


def test_a_search_that_an_earlier_fit_has_done_takes_no_time_again(tmp_path: Path) -> None:
    """Cole's: one texture's search is the first part of two textures', and that of larger textures at one size."""
    paint = open_source("material:lafortune-blue-paint", count=2000)
    base = {"cole": Cole()}
    both = plan(base, (1, 2), (16,), ("gradient",))
    alone = [estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], [run]).seconds_left for run in both]
    together = estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], both).seconds_left
    assert together < alone[1] + 0.4 * alone[0]
    sizes = plan(base, (2,), (16, 24), ("gradient",))
    assert estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], sizes).seconds_left < 1.4 * alone[1]
    smaller = plan(base, (2,), (8, 16), ("gradient",))
    assert estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], smaller).seconds_left > 1.6 * alone[1]
