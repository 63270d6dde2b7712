"""Pictures of charts: points, labels that are on no other, bars over seeds, ticks."""

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from refusals import refused

from homofact.brdf.source import open_source
from homofact.evaluation.chart import plan, run_chart
from homofact.evaluation.chart_ledger import ChartLedger, ChartRow
from homofact.evaluation.chart_points import ChartPoint, best_lower_on, points_of, reference
from homofact.figures.chart import cost_chart, time_chart, write_charts
from homofact.figures.chart_panel import FRONT_COLOUR
from homofact.figures.label_places import place_labels
from homofact.figures.log_axis import plain_number, round_ticks
from homofact.methods.table import made_each


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> list[ChartRow]:
    """Rows as of a large chart: one true one, with made-up costs and errors."""
    source = open_source("material:blinn-phong-50", count=150)
    runs = plan(made_each(("mccool",), {"size": 8}), (1,), (8,), ("gradient",))
    true = run_chart(source, runs, ChartLedger(tmp_path_factory.mktemp("rows") / "a.csv"))[0]
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


@pytest.mark.slow
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


@pytest.mark.parametrize("draw", [time_chart, cost_chart])
def test_title_and_caption_stay_within_the_picture(draw: Any, many: list[ChartRow]) -> None:
    long = ", ".join([*["a processor of a long name"] * 8, "scipy 1.17.1"])
    figure = draw([replace(row, machine=long) for row in many])
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    assert any("scipy" in text.get_text() for text in figure.texts)
    for text in figure.texts:
        box = text.get_window_extent(renderer)
        assert 0 <= box.x0 < box.x1 <= figure.bbox.width, text.get_text()
        assert 0 <= box.y0 < box.y1 <= figure.bbox.height, text.get_text()


@pytest.mark.slow
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
    # On another split it is another run of the same point.
    (point,) = points_of([replace(many[1], split_seed=split, seed=seed) for split in (7, 3) for seed in (2, 1)])
    assert [(row.split_seed, row.seed) for row in point.rows] == [(3, 1), (3, 2), (7, 1), (7, 2)]
    assert (point.record()["seeds"], point.record()["splits"]) == ([1, 2], [3, 7])
    # Bytes and textures are those of one and the same fit, the largest, and fetches the most of any.
    large, small = replace(many[1], bytes=90, fetches=1, seed=1), replace(many[1], bytes=60, fetches=3, seed=2)
    (point,) = points_of([large, small])
    assert (point.record()["bytes"], point.record()["fetches"]) == (90, 3)
    kept = [replace(many[1], textures=textures, seed=textures) for textures in (1, 2)]
    assert points_of(kept)[0].textures == "1–2"


def test_the_best_point_is_held_against_each_other_split_by_split(many: list[ChartRow]) -> None:
    def rows(size: int, errors: dict[int, list[float]]) -> list[ChartRow]:
        return [
            replace(many[1], size=size, split_seed=split, seed=seed, held_out=replace(many[1].held_out, log_mse=error))
            for split, several in errors.items()
            for seed, error in enumerate(several)
        ]

    best = rows(8, {0: [1.0, 3.0], 1: [2.0], 2: [1.0]})
    # Seeds of a split count once: 2 against 1.9 and 2.5. A split of its own is not counted.
    worse, wide = rows(16, {0: [1.9], 1: [5.0], 2: [4.0]}), rows(32, {0: [2.5], 1: [2.5], 2: [2.5], 7: [0.1, 8.0]})
    assert best_lower_on(points_of([*worse, *best, *wide])) == [2, None, 3]
    assert best_lower_on(points_of(best)) == [None]


@pytest.mark.slow
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


def test_rows_that_cannot_be_drawn_are_counted_or_refused(many: list[ChartRow], tmp_path: Path) -> None:
    bad = [replace(row, held_out=replace(row.held_out, log_mse=value)) for row, value in zip(many, (0.0, np.inf))]  # noqa: B905
    figure = time_chart([*many[2:], *bad])
    assert any("2 of 28 runs are left out" in text.get_text() for text in figure.texts)
    with refused(where="a"):
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


def test_a_label_is_as_far_from_its_point_as_the_point_s_own_radius_asks_for() -> None:
    points, radii = [(100.0, 100.0), (300.0, 100.0), (500.0, 100.0)], [3.0, 8.0, 20.0]
    places = place_labels(points, [(30.0, 9.0)] * 3, (0, 0, 600, 200), radius=radii)
    for (x, y), radius, place in zip(points, radii, places, strict=True):
        x0, y0, x1, y1 = place.box
        apart = np.hypot(x - np.clip(x, x0, x1), y - np.clip(y, y0, y1))
        assert radius < apart <= radius + 3
        assert not place.leader
    # A large disc is left free by the labels of others too.
    beside = place_labels(
        [(100.0, 100.0)], [(30.0, 9.0)], (0, 0, 600, 200), others=[(130.0, 100.0)], radius=[3.0, 25.0]
    )
    assert beside[0].box[2] < 106


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


@pytest.mark.slow
def test_no_state_of_matplotlib_is_left_changed(many: list[ChartRow], tmp_path: Path) -> None:
    before = dict(matplotlib.rcParams)
    write_charts(tmp_path, "a", many)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("labels", [pytest.param(("mccool", "ggx"), marks=pytest.mark.slow), ("ggx",)])
def test_a_model_without_textures_stands_at_no_fetches_and_has_its_bytes_as_label(
    labels: tuple[str, ...], many: list[ChartRow], tmp_path: Path
) -> None:
    source = open_source("material:blinn-phong-50", count=150)
    runs = plan(made_each(labels, {"size": 8} if "mccool" in labels else {}), (1,), (8,), ("gradient",))
    rows = run_chart(source, runs, ChartLedger(tmp_path / "a.csv"))
    assert [row.name for row in rows] == ["mccool, 2 × 8²", "ggx"][-len(labels) :]
    assert [run.name for run in runs][-1] == "ggx"
    write_charts(tmp_path, "a", rows)
    fetches = cost_chart(rows).axes[1]
    low, high = fetches.get_xlim()
    assert low < 0 < min(high, max(row.fetches for row in rows) + 1)
    assert [text.get_text() for text in fetches.get_xticklabels()] == ["0", "3"][: len(labels)]
    words = {text.get_text().split("  ")[0] for text, _ in labels_of(cost_chart(rows))}
    assert words == {"2×8²", "32 bytes"} if len(labels) == 2 else words == {"32 bytes"}


def test_a_point_stands_at_the_most_bytes_of_its_fits(many: list[ChartRow]) -> None:
    first = many[1]
    rows = [first, replace(first, seed=first.seed + 1, bytes=5 * first.bytes, fetches=first.fetches + 3)]
    figure = cost_chart(rows)
    for axes, cost in zip(figure.axes[:2], (5 * first.bytes, first.fetches + 3), strict=False):
        marked = [line for line in axes.lines if line.get_marker() not in ("None", "")]
        assert [np.asarray(line.get_xdata()).tolist() for line in marked] == [[cost]]


def test_the_front_begins_at_its_first_point(many: list[ChartRow]) -> None:
    figure = cost_chart(many)
    for axes in figure.axes[:2]:
        line = next(line for line in axes.lines if line.get_color() == FRONT_COLOUR)
        corners, *points = (np.asarray(each.get_xydata()).tolist() for each in (line, *axes.lines))
        assert [corners[0]] in points
