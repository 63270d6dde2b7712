"""Charts: the Pareto front's law, what a plan runs, and a ledger that never takes one run for another."""

import csv
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictured import no_looks
from slow_cases import slow_among

import homofact.evaluation.chart
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput, Status
from homofact.evaluation.chart import Run, plan, run_chart
from homofact.evaluation.chart_ledger import ChartLedger, ChartRow, Identity
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.metric_table import LIGHT
from homofact.evaluation.pareto import dominates, front
from homofact.methods.method import Method
from homofact.methods.table import METHODS, made_each, settings_of_class

pytestmark = pytest.mark.usefixtures("unseen")
FAST: dict[str, Any] = {"restarts": 1, "search_size": 3, "search_samples": 60, "effort": 20}


def methods(*names: str, **more: Any) -> dict[str, Method]:
    own = {name: settings_of_class(METHODS[name]) for name in names}
    some = {each: value for each, value in FAST.items() if any(each in settings for settings in own.values())}
    return made_each(names, some | more)


@pytest.fixture(scope="module")
def source() -> Source:
    return open_source("material:blinn-phong-50", count=150)


def deterministic() -> tuple[Run, ...]:
    return plan(methods("mccool", "cole"), (1, 2), (3, 4), ("gradient",))


def without_times(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return [{k: v for k, v in row.items() if not k.startswith("seconds_")} for row in csv.DictReader(file)]


class Counting:
    """The measuring function, remembering what it was asked for."""

    def __init__(self) -> None:
        self.fitted: list[Method] = []

    def __call__(self, source: Source, settings: Method, *rest: Any) -> Any:
        self.fitted.append(settings)
        return fit_and_measure(source, settings, *rest)


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> Counting:
    counting = Counting()
    monkeypatch.setattr(homofact.evaluation.chart, "fit_and_measure", counting)
    return counting


# Few distinct values: ties and equal points are common.
COORDINATE = st.sampled_from([0.1, 0.2, 0.3, 1.0, 2.0, float("inf"), float("nan")])


@given(st.lists(st.tuples(COORDINATE, COORDINATE), max_size=12))
def test_the_front_is_what_nothing_dominates(points: list[tuple[float, float]]) -> None:
    found = front(points)
    finite = [i for i, point in enumerate(points) if bool(np.isfinite(point).all())]
    for i in found:
        assert i in finite
        assert not any(dominates(points[j], points[i]) for j in finite)
    for i in finite:
        if i not in found:
            assert any(dominates(points[j], points[i]) for j in found)
    costs, errors = [points[i][0] for i in found], [points[i][1] for i in found]
    assert costs == sorted(costs)
    assert errors == sorted(errors, reverse=True)


def test_a_plan_multiplies_out_what_a_method_reads() -> None:
    runs = plan(methods("mccool", "cole", "search"), (1, 2, 3), (8, 16), ("gradient", "nlopt-PRAXIS"))
    found = {label: [run for run in runs if run.label == label] for label in ("mccool", "cole", "search")}
    assert {label: len(each) for label, each in found.items()} == {"mccool": 2, "cole": 6, "search": 12}
    assert {run.textures for run in found["mccool"]} == {2}
    assert {run.series for run in runs} == {"mccool", "cole", "search", "search (nlopt-PRAXIS)"}
    assert len(set(runs)) == len(runs)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (({}, (1,), (8,), ("gradient",)), "methods: found none"),
        ((methods("search"), (), (8,), ("gradient",)), "textures: found none"),
        ((methods("search"), (1,), (), ("gradient",)), "sizes: found none"),
        ((methods("search"), (1,), (8,), ()), "searches: found none"),
        ((methods("search"), (1,), (8,), ("magic",)), "search: found 'magic', expected gradient"),
        (
            (methods("search"), (1,), (8,), ("nlopt-MAGIC",)),
            "search: found 'nlopt-MAGIC', expected behind",
        ),
        ((methods("search"), (0,), (8,), ("gradient",)), "textures: found 0"),
        ((methods("search"), (1,), (1,), ("gradient",)), "size: found 1"),
        ((methods("search", projections="h+d"), (1, 2), (8,), ("gradient",)), "found 2 for 1 textures"),
    ],
)
def test_a_plan_refuses_before_anything_is_fitted(arguments: Any, expected: str) -> None:
    with pytest.raises(BadInput, match=expected):
        plan(*arguments)


@pytest.fixture(scope="module")
def whole(source: Source, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[ChartRow], Path]:
    """The rows of a chart that nothing interrupts, and its file."""
    path = tmp_path_factory.mktemp("whole") / "whole.csv"
    # As the tests' own charts, whose fixture comes after this one.
    with no_looks():
        return run_chart(source, deterministic(), ChartLedger(path)), path


@pytest.mark.slow
@pytest.mark.parametrize("after", [0, 1, 3])
def test_an_interrupted_chart_goes_on_to_the_same_file(
    after: int, source: Source, whole: tuple[list[ChartRow], Path], tmp_path: Path, counting: Counting
) -> None:
    runs = deterministic()

    def interrupt(place: int, _: Run) -> None:
        if place == after:
            raise KeyboardInterrupt

    path = tmp_path / "parts.csv"
    with pytest.raises(KeyboardInterrupt):
        run_chart(source, runs, ChartLedger(path), started=interrupt)
    assert [run.settings for run in runs[:after]] == counting.fitted
    assert path.exists() == (after > 0)
    before = path.read_text() if after else ""

    counting.fitted.clear()
    told: list[int] = []
    rows = run_chart(source, runs, ChartLedger(path), started=lambda place, _: told.append(place))
    assert counting.fitted == [run.settings for run in runs[after:]]
    assert told == list(range(after, len(runs)))
    assert path.read_text().startswith(before)
    assert without_times(path) == without_times(whole[1])
    assert len(without_times(path)) == len(runs)
    assert [(row.name, row.held_out, row.train) for row in rows] == [
        (row.name, row.held_out, row.train) for row in whole[0]
    ]
    # And once more: nothing is left to fit, and the file gives back every number as it was.
    counting.fitted.clear()
    assert run_chart(source, runs, ChartLedger(path)) == rows
    assert counting.fitted == []


@pytest.mark.slow
def test_a_line_that_was_cut_is_run_again_and_the_others_are_not(
    source: Source, whole: tuple[list[ChartRow], Path], tmp_path: Path, counting: Counting
) -> None:
    runs, path = deterministic(), tmp_path / "a.csv"
    rows, text = whole[0], whole[1].read_text()
    last = text.rstrip("\n").rfind("\n") + 1
    for place in (last + 1, (last + len(text)) // 2, len(text) - 1):
        path.write_text(text[:place])
        counting.fitted.clear()
        again = run_chart(source, runs, ChartLedger(path))
        assert counting.fitted == [runs[-1].settings]
        assert again[:-1] == rows[:-1]
        assert len(without_times(path)) == len(runs)
    path.write_text("somebody's words")
    with pytest.raises(BadInput, match="other columns"):
        ChartLedger(path)


def test_a_fit_that_was_cut_short_is_no_line(source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def cut_short(*arguments: Any) -> Any:
        row = fit_and_measure(*arguments)
        return replace(row, report=replace(row.report, status=Status.INTERRUPTED))

    monkeypatch.setattr(homofact.evaluation.chart, "fit_and_measure", cut_short)
    with pytest.raises(KeyboardInterrupt):
        run_chart(source, deterministic()[:1], ChartLedger(tmp_path / "a.csv"))
    assert list(tmp_path.iterdir()) == []


def darker(source: Source) -> Source:
    return replace(source, samples=replace(source.samples, values=source.samples.values * 0.5))


OTHERS: dict[str, tuple[Callable[[Source], Source], dict[str, Any], float]] = {
    "another smoothing": (lambda source: source, {"smoothing": 0.5}, 0.2),
    "another epsilon": (lambda source: source, {"epsilon": 0.3}, 0.2),
    "another seed": (lambda source: source, {"seed": 1}, 0.2),
    "another part held out": (lambda source: source, {}, 0.3),
    "other values": (darker, {}, 0.2),
    "another kind of source": (
        lambda source: replace(source, samples=replace(source.samples, all_azimuths=False)),
        {},
        0.2,
    ),
}


@pytest.mark.parametrize(
    "other",
    slow_among(
        OTHERS, "another smoothing", "another seed", "another part held out", "other values", "another kind of source"
    ),
)
def test_other_settings_and_sources_are_not_mixed(
    other: str, source: Source, tmp_path: Path, counting: Counting
) -> None:
    runs = plan(methods("mccool"), (1,), (3, 4), ("gradient",))
    path = tmp_path / "a.csv"
    first = run_chart(source, runs, ChartLedger(path))
    counting.fitted.clear()
    change, more, part = OTHERS[other]
    changed = plan(methods("mccool", **more), (1,), (3, 4), ("gradient",))
    second = run_chart(change(source), changed, ChartLedger(path), part)
    assert len(counting.fitted) == len(runs)
    assert len(second) == len(runs)
    assert {row.settings + row.samples_sha256 for row in first}.isdisjoint(
        row.settings + row.samples_sha256 for row in second
    )
    # The old lines are still there for the old run, and only for that.
    counting.fitted.clear()
    assert run_chart(source, runs, ChartLedger(path)) == first
    assert counting.fitted == []


def test_what_a_method_ignores_does_not_cost_a_new_fit(source: Source, tmp_path: Path, counting: Counting) -> None:
    path = tmp_path / "a.csv"
    first = run_chart(source, plan(methods("mccool"), (1,), (4,), ("gradient",)), ChartLedger(path))
    again = plan(methods("mccool"), (2, 3), (4,), ("nlopt-PRAXIS",))
    assert run_chart(source, again, ChartLedger(path)) == first
    assert len(counting.fitted) == 1


def test_times_of_another_machine_are_not_taken(
    source: Source, tmp_path: Path, counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = plan(methods("mccool"), (1,), (4,), ("gradient",))
    run_chart(source, runs, ChartLedger(tmp_path / "a.csv"))
    monkeypatch.setattr(homofact.evaluation.chart, "machine", lambda: "an abacus")
    rows = run_chart(source, runs, ChartLedger(tmp_path / "a.csv"))
    assert [row.machine for row in rows] == ["an abacus"]
    assert len(counting.fitted) == 2


def spoiled(text: str, how: str) -> str:
    lines = text.splitlines()
    if how == "version":
        return text.replace(lines[1].rpartition(",")[2], "0.0.7")
    if how == "columns":
        return "\n".join(["a,b", *lines[1:]])
    if how == "cell":
        return "\n".join([lines[0], lines[1].replace(",direct,", ",").replace("blinn", "x,blinn", 1), ""])
    if how == "short":
        return "\n".join([*lines[:1], lines[1][:40], ""])
    return ""


@pytest.mark.slow
def test_what_an_eye_would_say_stands_in_the_csv(source: Source, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    (row,) = run_chart(source, plan(methods("mccool"), (1,), (3,), ("gradient",)), ChartLedger(path))
    assert row.appearance["albedo_worst"] is not None
    assert row.record()["appearance"]["floor"] == 0
    header, line = csv.reader(path.read_text().splitlines())
    cells = dict(zip(header, line, strict=True))
    assert {name: float(cells[name]) if cells[name] else None for name in LIGHT} == row.appearance
    assert [name for name in LIGHT if not cells[name]] == ["rms_measured", "floor_measured"]
    # A source of samples alone has empty cells, which come back as they were.
    alone = replace(source, reflectance=Scattered(source.samples))
    (other,) = run_chart(alone, plan(methods("mccool"), (1,), (3,), ("gradient",)), ChartLedger(tmp_path / "b.csv"))
    assert other.appearance == dict.fromkeys(LIGHT)
    found = ChartLedger(tmp_path / "b.csv").find(Identity(*(getattr(other, each.name) for each in fields(Identity))))
    assert found == other


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ("version", r"line 2: found a result of homofact 0\.0\.7, expected a new folder, or `force=True`"),
        ("columns", r"found other columns than those of homofact .*expected a new folder, or `force=True`"),
        ("cell", r"line 2: textures_asked is '.*', expected a new folder"),
        ("short", r"line 2: found \d+ cells of 49, expected a new folder"),
        ("empty", r"found other columns"),
    ],
)
def test_a_file_that_cannot_be_gone_on_with_is_named(how: str, expected: str, source: Source, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    runs = plan(methods("mccool"), (1,), (3,), ("gradient",))
    run_chart(source, runs, ChartLedger(path))
    path.write_text(spoiled(path.read_text(), how))
    with pytest.raises(BadInput, match=expected) as caught:
        ChartLedger(path)
    assert str(caught.value).startswith(str(path))
    # Begun anew it is replaced, but not before there is something to put in its place.
    before = path.read_text()
    fresh = ChartLedger(path, fresh=True)
    assert path.read_text() == before
    run_chart(source, runs, fresh)
    assert len(ChartLedger(path)) == 1


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match=r"a\.csv: cannot be read as a chart's CSV"):
        ChartLedger(tmp_path / "a.csv")


def test_a_fit_that_is_refused_says_which(tmp_path: Path) -> None:
    few = open_source("material:blinn-phong-50", count=6)
    with pytest.raises(BadInput, match=r"^search, 1 × 4²: samples: found 5"):
        run_chart(few, plan(methods("search"), (1,), (4,), ("gradient",)), ChartLedger(tmp_path / "a.csv"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_record_has_what_a_comparison_has(source: Source, tmp_path: Path) -> None:
    runs = plan(methods("search"), (1,), (4,), ("gradient",))
    row = run_chart(source, runs, ChartLedger(tmp_path / "a.csv"))[0]
    theirs = fit_and_measure(source, runs[0].settings).record()
    mine = row.record()
    assert set(theirs) - set(mine) == {"mean", "shapes", "split", "subset", "verdict"}
    assert set(mine["seconds"]) == set(theirs["seconds"])
    assert mine["error"] == theirs["error"]
    assert (mine["method"], mine["search"], mine["held_out_part"]) == ("search", "gradient", 0.2)


def test_every_seed_is_a_run_on_every_split() -> None:
    assert [run.split_seed for run in plan(methods("nmf"), (1,), (3,), ("gradient",), 3, (4, 5))] == [4, 5]
    both = plan(methods("cole", seed=4), (1,), (3,), ("gradient",), 2, (4, 5))
    drawn = [(run.split_seed, run.settings.seed) for run in both]
    assert sorted(drawn) == [(4, 4), (4, 5), (5, 4), (5, 5)]


@pytest.mark.slow
def test_seeds_are_runs_of_one_split(source: Source, tmp_path: Path) -> None:
    runs = plan(methods("cole", seed=4), (1,), (3,), ("gradient",), 2)
    assert [(run.settings.seed, run.split_seed) for run in runs] == [(4, 4), (5, 4)]
    assert [run.name for run in runs] == ["cole, 1 × 3²", "cole, 1 × 3², split 4, seed 5"]
    rows = run_chart(source, runs, ChartLedger(tmp_path / "a.csv"))
    assert [(row.seed, row.split_seed) for row in rows] == [(4, 4), (5, 4)]
    alone = fit_and_measure(source, runs[1].settings, split_seed=4)
    assert rows[1].held_out == alone.held_out != rows[0].held_out
    assert ChartLedger(tmp_path / "a.csv").find(
        Identity(**{each.name: getattr(rows[1], each.name) for each in fields(Identity)})
    )
    # A fit of the same seed on the split of its own is another run.
    own = plan(methods("cole", seed=5), (1,), (3,), ("gradient",))
    assert run_chart(source, own, ChartLedger(tmp_path / "a.csv"))[0].held_out != rows[1].held_out
    # What has no seed is not fitted again by another.
    assert len(plan(methods("nmf"), (1,), (3,), ("gradient",), 3)) == 1
    with pytest.raises(BadInput, match="seeds: found 0, expected at least 1"):
        plan(methods("cole"), (1,), (3,), ("gradient",), 0)
