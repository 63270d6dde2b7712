"""How long fits will take: the model's order of magnitude, what finished fits tell, and the words."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput
from homofact.evaluation import estimate as module
from homofact.evaluation.chart import estimate_charts, plan, run_chart
from homofact.evaluation.chart_ledger import ChartLedger
from homofact.evaluation.estimate import TimeEstimate, fit_seconds, solved_samples, training_count
from homofact.evaluation.split import Split
from homofact.methods.cole import Cole
from homofact.methods.common import at_azimuths
from homofact.methods.mccool import McCool
from homofact.methods.method import Method
from homofact.methods.search import Search
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


def test_textures_beyond_the_memory_are_refused_before_any_estimate(source: Source) -> None:
    for method in (Search(size=3000), Cole(size=3000), McCool(size=3000)):
        with pytest.raises(BadInput, match=r"3000 texels wide.* GB of memory"):
            training_count(source, method, 0.2)
    assert solved_samples(source, Search(size=3000), 0.2) == training_count(source, Search(), 0.2)


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, which the test sets."""
    clock = [0.0]
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    return clock


def test_finished_fits_correct_the_others() -> None:
    found = TimeEstimate([("cole", 100.0), ("cole", 300.0), ("search", 50.0), ("search", 50.0)])
    assert (found.left, found.seconds_left, found.words()) == (4, 500.0, "4 fits, about 4 to 17 min")
    found.finish(0, 200.0)
    # Cole's took twice as long; so will the other methods, as far as is known.
    assert found.seconds_left == pytest.approx(2 * 300 + 2 * 100, rel=0.02)
    found.finish(2, 50.0)
    assert found.seconds_left == pytest.approx(2 * 300 + 50, rel=0.02)
    found.finish(1, 600.0)
    assert (found.left, found.words()) == (1, "1 fit, about 30 to 90 s")


def test_the_first_fit_which_loads_libraries_changes_little() -> None:
    found = TimeEstimate([("mccool", 0.5)] * 10 + [("search", 20.0)] * 10)
    found.finish(0, 5.0)
    assert found.seconds_left < 3.1 * 200 + 9 * 0.5 * 5


@pytest.mark.parametrize("slower", [0.6, 1.0, 1.7, 3.0])
def test_every_range_of_a_machine_at_a_constant_speed_contains_the_truth_and_narrows(
    slower: float, now: list[float]
) -> None:
    kinds = {"mccool": 2.0, "cole": 30.0, "search": 8.0}
    found = TimeEstimate([(kind, seconds) for kind, seconds in kinds.items() for _ in range(5)] * 2)
    total = slower * 2 * 5 * sum(kinds.values())
    ratios = []
    while found.left:
        place = found.done
        found.begin()
        for part in (0.0, 0.5, 0.9):
            begun = now[0]
            left = found.time_left().after(part * slower * found._jobs[place][1])
            truth = total - begun - left.passed
            _, least, most = left.now
            if place:
                assert least <= truth <= most + 1e-9
            assert "longer" not in left.words()
        now[0] += slower * found._jobs[place][1]
        found.end()
        if found.left:
            _, least, most = found.time_left().now
            ratios.append(most / least)
    assert ratios[-1] < 2 < ratios[0] < 4.5
    # Once every kind is known, one number is near enough.
    found = TimeEstimate([(kind, seconds) for kind, seconds in kinds.items() for _ in range(12)])
    for place, (_, seconds) in enumerate(found._jobs):
        if place % 12 < 9:
            found.finish(place, slower * seconds)
    assert re.fullmatch(r"9 fits, about \d+ (s|min)", found.words())


def test_what_runs_is_timed_until_it_ends_or_the_next_begins(now: list[float]) -> None:
    found = TimeEstimate([("a", 10.0)] * 4)
    found.begin()
    now[0] = 10.0
    found.begin()
    now[0] = 30.0
    found.end()
    found.end()
    assert found._measured == {0: 10.0, 1: 20.0}
    # What ends late is no part of another.
    now[0] = 100.0
    found.begin(3)
    now[0] = 105.0
    found.skip(2)
    found.begin()
    assert (found._measured[3], found.left, found.done) == (5.0, 0, 3)
    assert found.time_left().now == (0.0, 0.0, 0.0)


def test_several_workers_share_the_rest_but_for_the_longest_part() -> None:
    found = TimeEstimate([("a", 10.0)] * 8)
    alone, two = found.time_left(), found.time_left(workers=2)
    assert two.seconds == alone.seconds / 2
    assert two.least == pytest.approx((alone.least - 5) / 2)
    assert two.most == pytest.approx((alone.most + 20) / 2)
    found = TimeEstimate([("a", 10.0)])
    assert found.time_left(workers=2) == found.time_left()


def test_parts_whose_number_is_unknown_widen_the_range() -> None:
    found = TimeEstimate([("a", 10.0)])
    left = found.time_left(further=[("b", 20.0, 0.0, 100.0)])
    assert (left.seconds, left.least, left.most) == (30.0, 5.0, 220.0)
    assert left.words() == ""


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
    assert found.seconds_left == pytest.approx(sum(modelled[2:]) * (measured + 1) / (sum(modelled[:2]) + 1))


def test_a_search_that_an_earlier_fit_has_done_takes_no_time_again(tmp_path: Path) -> None:
    """Cole's: one texture's search is the first part of two textures', and that of larger textures at one size."""
    paint = open_source("material:lafortune-blue-paint", count=2000)
    base = {"cole": Cole()}
    both = plan(base, (1, 2), (16,), ("gradient",))
    alone = [estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], [run]).seconds_left for run in both]
    together = estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], both).seconds_left
    assert together < alone[1] + 0.6 * alone[0]
    sizes = plan(base, (2,), (16, 24), ("gradient",))
    assert estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], sizes).seconds_left < 1.4 * alone[1]
    smaller = plan(base, (2,), (8, 16), ("gradient",))
    assert estimate_charts([(paint, ChartLedger(tmp_path / "a.csv"))], smaller).seconds_left > 1.6 * alone[1]


@pytest.mark.parametrize("method", [McCool(size=6), Cole(textures=1, size=6, restarts=1), Search(textures=1, size=6)])
def test_what_is_refused_before_a_fit_needs_no_more_than_the_fit(
    method: Method, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or large fits would be refused that fit into memory."""
    asked: dict[str, int] = {}

    def kept(when: str) -> Callable[..., None]:
        def keep(settings: object, shapes: Sequence[object], rows: int, searched: int = 0) -> None:
            asked.setdefault(when, rows * len(shapes))

        return keep

    source = open_source("material:phong-10", count=400)
    source = replace(source, samples=replace(source.samples, all_azimuths=False))
    monkeypatch.setattr("homofact.methods.memory.refuse_too_large", kept("before"))
    for name in ("mccool_fit", "cole_fit", "search_task"):
        monkeypatch.setattr(f"homofact.methods.{name}.refuse_too_large", kept("fit"))
    training_count(source, method, 0.0)
    method.fit(source.samples)
    assert 0 < asked["before"] <= asked["fit"]
