"""Charts: the Pareto front's law, what a plan runs, and a ledger that never takes one run for another."""

import csv
import random
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import homofact.evaluate.chart
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import Source, open_source
from homofact.errors import BadInput, Status
from homofact.evaluate.appearance import FIGURES, Figures
from homofact.evaluate.chart import Run, plan, run_chart
from homofact.evaluate.chart_ledger import ChartRow, Identity, Ledger
from homofact.evaluate.chart_points import ChartPoint, points_of, reference
from homofact.evaluate.compare import fit_and_measure
from homofact.evaluate.pareto import dominates, front
from homofact.figures.chart import cost_chart, time_chart, write_charts
from homofact.figures.label_places import place_labels
from homofact.figures.log_axis import plain_number, round_ticks
from homofact.methods.fitting import Method
from homofact.methods.table import METHODS, made_each, settings_of_class

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
    monkeypatch.setattr(homofact.evaluate.chart, "fit_and_measure", counting)
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
    assert {run.series for run in runs} == {"mccool", "cole", "search (gradient)", "search (nlopt-PRAXIS)"}
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
    return run_chart(source, deterministic(), Ledger(path)), path


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
        run_chart(source, runs, Ledger(path), started=interrupt)
    assert [run.settings for run in runs[:after]] == counting.fitted
    assert path.exists() == (after > 0)
    before = path.read_text() if after else ""

    counting.fitted.clear()
    told: list[int] = []
    rows = run_chart(source, runs, Ledger(path), started=lambda place, _: told.append(place))
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
    assert run_chart(source, runs, Ledger(path)) == rows
    assert counting.fitted == []


def test_a_line_that_was_cut_is_run_again_and_the_others_are_not(
    source: Source, whole: tuple[list[ChartRow], Path], tmp_path: Path, counting: Counting
) -> None:
    runs, path = deterministic(), tmp_path / "a.csv"
    rows, text = whole[0], whole[1].read_text()
    last = text.rstrip("\n").rfind("\n") + 1
    for place in (last + 1, (last + len(text)) // 2, len(text) - 1):
        path.write_text(text[:place])
        counting.fitted.clear()
        again = run_chart(source, runs, Ledger(path))
        assert counting.fitted == [runs[-1].settings]
        assert again[:-1] == rows[:-1]
        assert len(without_times(path)) == len(runs)
    path.write_text("somebody's words")
    with pytest.raises(BadInput, match="other columns"):
        Ledger(path)


def test_a_fit_that_was_cut_short_is_no_line(source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def cut_short(*arguments: Any) -> Any:
        row = fit_and_measure(*arguments)
        return replace(row, report=replace(row.report, status=Status.INTERRUPTED))

    monkeypatch.setattr(homofact.evaluate.chart, "fit_and_measure", cut_short)
    with pytest.raises(KeyboardInterrupt):
        run_chart(source, deterministic()[:1], Ledger(tmp_path / "a.csv"))
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


@pytest.mark.parametrize("other", OTHERS)
def test_other_settings_and_sources_are_not_mixed(
    other: str, source: Source, tmp_path: Path, counting: Counting
) -> None:
    runs = plan(methods("mccool"), (1,), (3, 4), ("gradient",))
    path = tmp_path / "a.csv"
    first = run_chart(source, runs, Ledger(path))
    counting.fitted.clear()
    change, more, part = OTHERS[other]
    changed = plan(methods("mccool", **more), (1,), (3, 4), ("gradient",))
    second = run_chart(change(source), changed, Ledger(path), part)
    assert len(counting.fitted) == len(runs)
    assert len(second) == len(runs)
    assert {row.settings + row.samples_sha256 for row in first}.isdisjoint(
        row.settings + row.samples_sha256 for row in second
    )
    # The old lines are still there for the old run, and only for that.
    counting.fitted.clear()
    assert run_chart(source, runs, Ledger(path)) == first
    assert counting.fitted == []


def test_what_a_method_ignores_does_not_cost_a_new_fit(source: Source, tmp_path: Path, counting: Counting) -> None:
    path = tmp_path / "a.csv"
    first = run_chart(source, plan(methods("mccool"), (1,), (4,), ("gradient",)), Ledger(path))
    again = plan(methods("mccool"), (2, 3), (4,), ("nlopt-PRAXIS",))
    assert run_chart(source, again, Ledger(path)) == first
    assert len(counting.fitted) == 1


def test_times_of_another_machine_are_not_taken(
    source: Source, tmp_path: Path, counting: Counting, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = plan(methods("mccool"), (1,), (4,), ("gradient",))
    run_chart(source, runs, Ledger(tmp_path / "a.csv"))
    monkeypatch.setattr(homofact.evaluate.chart, "machine", lambda: "an abacus")
    rows = run_chart(source, runs, Ledger(tmp_path / "a.csv"))
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


def test_what_an_eye_would_say_stands_in_the_csv(source: Source, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    (row,) = run_chart(source, plan(methods("mccool"), (1,), (3,), ("gradient",)), Ledger(path))
    assert row.appearance.albedo_worst is not None
    assert row.record()["appearance"]["floor"] == 0
    header, line = csv.reader(path.read_text().splitlines())
    cells = dict(zip(header, line, strict=True))
    assert {name: float(cells[name]) for name in FIGURES} == asdict(row.appearance)
    # A source of samples alone has empty cells, which come back as they were.
    alone = replace(source, reflectance=Scattered(source.samples))
    (other,) = run_chart(alone, plan(methods("mccool"), (1,), (3,), ("gradient",)), Ledger(tmp_path / "b.csv"))
    assert other.appearance == Figures()
    found = Ledger(tmp_path / "b.csv").find(Identity(*(getattr(other, each.name) for each in fields(Identity))))
    assert found == other


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ("version", r"line 2: found a result of homofact 0\.0\.7, expected a new folder, or --force"),
        ("columns", r"found other columns than those of homofact .*expected a new folder, or --force"),
        ("cell", r"line 2: textures_asked is '.*', expected a new folder"),
        ("short", r"line 2: found \d+ cells of 44, expected a new folder"),
        ("empty", r"found other columns"),
    ],
)
def test_a_file_that_cannot_be_gone_on_with_is_named(how: str, expected: str, source: Source, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    runs = plan(methods("mccool"), (1,), (3,), ("gradient",))
    run_chart(source, runs, Ledger(path))
    path.write_text(spoiled(path.read_text(), how))
    with pytest.raises(BadInput, match=expected) as caught:
        Ledger(path)
    assert str(caught.value).startswith(str(path))
    # Begun anew it is replaced, but not before there is something to put in its place.
    before = path.read_text()
    fresh = Ledger(path, fresh=True)
    assert path.read_text() == before
    run_chart(source, runs, fresh)
    assert len(Ledger(path)) == 1


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match=r"a\.csv: cannot be read as a chart's CSV"):
        Ledger(tmp_path / "a.csv")


def test_a_fit_that_is_refused_says_which(tmp_path: Path) -> None:
    few = open_source("material:blinn-phong-50", count=6)
    with pytest.raises(BadInput, match=r"^search \(gradient\), 1 × 4²: samples: found 5"):
        run_chart(few, plan(methods("search"), (1,), (4,), ("gradient",)), Ledger(tmp_path / "a.csv"))
    assert list(tmp_path.iterdir()) == []


def test_a_record_has_what_a_comparison_has(source: Source, tmp_path: Path) -> None:
    runs = plan(methods("search"), (1,), (4,), ("gradient",))
    row = run_chart(source, runs, Ledger(tmp_path / "a.csv"))[0]
    theirs = fit_and_measure(source, runs[0].settings).record()
    mine = row.record()
    assert set(theirs) - set(mine) == {"mean", "shapes", "split", "subset", "verdict"}
    assert set(mine["seconds"]) == set(theirs["seconds"])
    assert mine["error"] == theirs["error"]
    assert (mine["method"], mine["search"], mine["held_out_part"]) == ("search", "gradient", 0.2)


@pytest.fixture(scope="module")
def many(source: Source, tmp_path_factory: pytest.TempPathFactory) -> list[ChartRow]:
    """Rows as of a large chart: one true one, with made-up costs and errors."""
    runs = plan(methods("mccool"), (1,), (8,), ("gradient",))
    true = run_chart(source, runs, Ledger(tmp_path_factory.mktemp("rows") / "a.csv"))[0]
    draw = random.Random(0)
    rows = [true]
    for label, search in (("cole", ""), ("search", "gradient"), ("search", "nlopt-PRAXIS")):
        for size in (8, 16, 32):
            for textures in (1, 2, 3):
                error = true.held_out.log_mse * 2 ** draw.uniform(-6, 1)
                row = replace(
                    true, label=label, search=search, size=size, textures=textures, textures_asked=textures,
                    bytes=12 * textures * size**2, fetches=textures + (label == "cole"),
                    seconds_fit=10 ** draw.uniform(-2, 2), held_out=replace(true.held_out, log_mse=error),
                )  # fmt: skip
                rows.append(row)
    return rows


def test_both_charts_are_drawn_and_drawn_alike(many: list[ChartRow], tmp_path: Path) -> None:
    paths = write_charts(tmp_path, "a", many)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    assert {path.name for path in paths} == {f"a_{what}.{kind}" for what in ("time", "cost") for kind in ("png", "svg")}
    first = [path.read_bytes() for path in paths]
    write_charts(tmp_path, "a", many)
    assert [path.read_bytes() for path in paths] == first


def labels_of(figure: Any) -> list[tuple[Any, Any]]:
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    return [(text, text.get_window_extent(renderer)) for axes in figure.axes for text in axes.texts if text.get_text()]


@pytest.mark.parametrize("draw", [time_chart, cost_chart])
def test_every_point_has_a_label_that_is_on_no_other(draw: Any, many: list[ChartRow]) -> None:
    figure = draw(many)
    panels = 1 if draw is time_chart else 2
    labels = labels_of(figure)
    assert len(labels) == panels * len(many)
    for place, (one, box) in enumerate(labels):
        for other, its in labels[place + 1 :]:
            if one.axes is other.axes:
                assert not box.padded(-0.5).overlaps(its.padded(-0.5)), (one.get_text(), other.get_text())


def test_shares_are_of_mccools_lowest_error_here(many: list[ChartRow]) -> None:
    worse = replace(many[0], size=4, held_out=replace(many[0].held_out, log_mse=many[0].held_out.log_mse * 3))
    rows = [worse, *many]
    assert reference(points_of(rows)) == ChartPoint((many[0],))
    best = min(rows, key=lambda row: row.held_out.log_mse)
    share = best.held_out.log_mse / many[0].held_out.log_mse
    words = [text.get_text() for text, _ in labels_of(time_chart(rows))]
    assert f"{best.textures}×{best.size}²  ×{share:.2g}" in words
    # Without McCool there is nothing to be a share of, and other fixed lists are not McCool's.
    others = [replace(row, label="mccool:h+d") if row.label == "mccool" else row for row in many]
    assert reference(points_of(others)) is None
    assert not any("  ×" in text.get_text() for text, _ in labels_of(time_chart(others)))


def by_seeds(many: list[ChartRow]) -> list[ChartRow]:
    """Each of the rows by three seeds, their errors one apart by a factor of 1, 1.2 and 2."""
    return [
        replace(
            row, seed=seed, seconds_fit=row.seconds_fit * (1 + seed / 10),
            held_out=replace(row.held_out, log_mse=row.held_out.log_mse * factor),
        )
        for row in many
        for seed, factor in enumerate((1.0, 1.2, 2.0))
    ]  # fmt: skip


def test_runs_by_several_seeds_are_one_point(many: list[ChartRow]) -> None:
    points = points_of(by_seeds(many))
    assert len(points) == len(many)
    for point, row in zip(points, many, strict=True):
        assert [each.seed for each in point.rows] == [0, 1, 2]
        error = row.held_out.log_mse
        assert (point.error.low, point.error.high) == (error, 2 * error)
        assert point.error.mean == pytest.approx(1.4 * error)
        record = point.record()
        assert record["error"]["held_out"]["log_mse"] == point.error.mean
        assert record["spread"]["error"]["held_out"]["log_mse"] == point.error.record()
        assert record["spread"]["seconds"]["fit"] == point.seconds.record()
        assert record["seeds"] == [0, 1, 2]
    assert points_of(many)[0].record() == many[0].record()
    kept = [replace(many[1], textures=textures, seed=textures) for textures in (1, 2)]
    assert points_of(kept)[0].textures == "1–2"


@pytest.mark.parametrize("draw", [time_chart, cost_chart])
def test_a_bar_goes_from_the_least_to_the_greatest(draw: Any, many: list[ChartRow]) -> None:
    rows = by_seeds(many)
    upright = {
        tuple(line.get_ydata()) for axes in draw(rows).axes for line in axes.lines
        if len(line.get_xdata()) == 2 and line.get_xdata()[0] == line.get_xdata()[1]
    }  # fmt: skip
    assert upright == {(point.error.low, point.error.high) for point in points_of(rows)}
    figure = draw(rows)
    assert any("mean of up to 3 fits by different seeds" in text.get_text() for text in figure.texts)
    labels = labels_of(figure)
    assert len(labels) == len(many) * (1 if draw is time_chart else 2)


def test_seeds_are_runs_of_one_split(source: Source, tmp_path: Path) -> None:
    runs = plan(methods("cole", seed=4), (1,), (3,), ("gradient",), 2)
    assert [(run.settings.seed, run.split_seed) for run in runs] == [(4, 4), (5, 4)]
    assert [run.name for run in runs] == ["cole, 1 × 3²", "cole, 1 × 3², seed 5"]
    rows = run_chart(source, runs, Ledger(tmp_path / "a.csv"))
    assert [(row.seed, row.split_seed) for row in rows] == [(4, 4), (5, 4)]
    alone = fit_and_measure(source, runs[1].settings, split_seed=4)
    assert rows[1].held_out == alone.held_out != rows[0].held_out
    assert Ledger(tmp_path / "a.csv").find(
        Identity(**{each.name: getattr(rows[1], each.name) for each in fields(Identity)})
    )
    # A fit of the same seed on the split of its own is another run.
    own = plan(methods("cole", seed=5), (1,), (3,), ("gradient",))
    assert run_chart(source, own, Ledger(tmp_path / "a.csv"))[0].held_out != rows[1].held_out
    # What has no seed is not fitted again by another.
    assert len(plan(methods("nmf"), (1,), (3,), ("gradient",), 3)) == 1
    with pytest.raises(BadInput, match="seeds: found 0, expected at least 1"):
        plan(methods("cole"), (1,), (3,), ("gradient",), 0)


def test_rows_that_cannot_be_drawn_are_counted_or_refused(many: list[ChartRow], tmp_path: Path) -> None:
    bad = [replace(row, held_out=replace(row.held_out, log_mse=value)) for row, value in zip(many, (0.0, np.inf))]  # noqa: B905
    figure = time_chart([*many[2:], *bad])
    assert any("2 of 28 runs are not drawn" in text.get_text() for text in figure.texts)
    with pytest.raises(BadInput, match="none of 2 rows has an error above 0"):
        write_charts(tmp_path, "a", bad)


@pytest.mark.parametrize("seed", range(3))
def test_labels_find_room_among_forty_points(seed: int) -> None:
    draw = np.random.default_rng(seed)
    points = [(float(x), float(y)) for x, y in draw.uniform((20, 20), (580, 380), (40, 2))]
    places = place_labels(points, [(30.0, 9.0)] * 40, (0, 0, 600, 400))
    for i, one in enumerate(places):
        assert 0 <= one.box[0] < one.box[2] <= 600
        assert 0 <= one.box[1] < one.box[3] <= 400
        for other in places[i + 1 :]:
            apart = (
                one.box[2] <= other.box[0] or other.box[2] <= one.box[0]
                or one.box[3] <= other.box[1] or other.box[3] <= one.box[1]
            )  # fmt: skip
            assert apart
        assert not any(one.box[0] < x < one.box[2] and one.box[1] < y < one.box[3] for x, y in points)
    assert place_labels([], [], (0, 0, 1, 1)) == []


@pytest.mark.parametrize("low", [1e-9, 3e-5, 0.021, 0.4, 7.0, 3000.0])
@pytest.mark.parametrize("span", [1.5, 3.0, 20.0, 1e3, 1e8])
@pytest.mark.parametrize("most", [5, 9])
def test_ticks_are_few_and_round(low: float, span: float, most: int) -> None:
    ticks = round_ticks(low, low * span, most=most)
    assert 1 <= len(ticks) <= most
    assert len(ticks) >= 2 or span < 2
    assert ticks == sorted(ticks)
    for tick in ticks:
        assert low * 0.999 <= tick <= low * span * 1.001
        digit = tick / 10 ** np.floor(np.log10(tick) + 1e-9)
        assert min(abs(digit - each) for each in (1, 1.5, 2, 3, 5, 7)) < 1e-6


def test_a_ticks_number_is_plain() -> None:
    assert [plain_number(value) for value in (0.02, 1.0, 500.0, 0.0003)] == ["0.02", "1", "500", "0.0003"]
    assert (plain_number(1e-7), plain_number(3e6)) == ("$10^{-7}$", r"$3\cdot10^{6}$")


def test_no_state_of_matplotlib_is_left_changed(many: list[ChartRow], tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    write_charts(tmp_path, "a", many)
    assert dict(matplotlib.rcParams) == before
