"""Plots for people: what is drawn is what was measured, every entry of a key is drawn, ticks keep apart."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from homofact.evaluation.spread import Spread
from homofact.figures.info_picture import _round_steps
from homofact.figures.plot import _HELD_OUT, _TRAINING, _dots
from homofact.figures.point_labels import PointLabel, label_points
from homofact.figures.side_by_side import side_by_side
from homofact.planning.figure import plot_plan
from homofact.planning.figure_points import spots_of
from homofact.planning.ladder import WHOLE, Candidate
from homofact.planning.scene import NO_BUDGET
from homofact.planning.tolerance import Tolerance


@pytest.mark.parametrize("most", [*np.geomspace(1e-3, 1e3, 97), 0.1, 1.0, 2.5, 5.0])
def test_radial_ticks_are_few_round_and_inside(most: float) -> None:
    steps = _round_steps(most)
    assert 1 <= len(steps) <= 5
    assert 0 < steps[0] <= steps[-1] <= most * (1 + 1e-6)
    digits = steps[0] / 10 ** math.floor(math.log10(steps[0]) + 1e-9)
    assert min(abs(digits - each) for each in (1, 2, 5)) < 1e-9


def dots(*pairs: tuple[Spread, Spread]) -> tuple[dict[str, list[tuple[float, float]]], list[str], tuple[float, float]]:
    """(places of the markers by colour, numbers written, the x axis)."""
    axis = Figure().subplots()
    _dots(axis, pairs)
    found: dict[str, list[tuple[float, float]]] = {}
    for line in axis.lines:
        if line.get_marker() == "o":
            x, y = np.asarray(line.get_xydata())[0]
            found.setdefault(to_hex(line.get_color()), []).append((float(x), float(y)))
    return found, [text.get_text() for text in axis.texts], axis.get_xlim()


def test_dots_of_a_comparison_are_its_numbers() -> None:
    found, words, (low, high) = dots((Spread.of([0.01]), Spread.of([0.02])), (Spread.of([3.0]), Spread.of([0.5])))
    assert found == {_TRAINING: [(0.01, 0), (3.0, 1)], _HELD_OUT: [(0.02, 0), (0.5, 1)]}
    assert words == ["0.01", "0.02", "3", "0.5"]
    assert low < 0.01 < 3 < high
    # Of several seeds: the two apart, so that neither's line hides the other's.
    found, _, _ = dots((Spread.of([0.01, 0.02]), Spread.of([0.02, 0.04])))
    (x, y), (other, below) = found[_TRAINING][0], found[_HELD_OUT][0]
    assert (x, other) == pytest.approx((0.015, 0.03))
    assert y < 0 < below


def test_an_error_of_0_is_written_and_the_axis_is_of_the_others() -> None:
    _, words, (low, _) = dots((Spread.of([0.0]), Spread.of([0.0])), (Spread.of([0.1]), Spread.of([0.2])))
    assert words[:2] == ["0", "0"]
    assert low > 0.01
    assert dots((Spread.of([0.0]), Spread.of([0.0])))[2][0] > 0


def material(name: str, choice: Candidate, **asked: tuple[Candidate, int, float]) -> Any:
    found = {
        candidate: SimpleNamespace(bytes=size, error=error, fetches=1) for candidate, size, error in asked.values()
    }
    return SimpleNamespace(
        name=name, walk=SimpleNamespace(asked=found, choice=choice, met=True, kept=lambda rung: rung),
        outcome=found[choice], judges=(),
        errors=(), material=SimpleNamespace(pixels=None), budget=NO_BUDGET, tolerance=Tolerance((("reflected", 0.2),)),
    )  # fmt: skip


COLOUR, LAMBERT = Candidate("constant"), Candidate("lambert-9")
BYTES, FLOATS = Candidate("search", 1, 4, WHOLE), Candidate("search", 1, 4)


def plan(*materials: Any) -> Any:
    scene = SimpleNamespace(name="shop", lightings=(SimpleNamespace(name="sun"),))
    words = Tolerance((("reflected", 0.2),)).describe()
    facts = {"bytes": 60, "fits": 1, "exhaustive_fits": 30, "tolerance_words": words}
    return SimpleNamespace(distinct=materials, scene=scene, **facts)


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that are drawn."""
    saved: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda self, *_, **__: (saved.append(self), Path(_[0]).touch()))
    return saved


def key_words(axes: Axes) -> list[str]:
    """The entries of the key."""
    key = axes.get_legend()
    assert key is not None
    return [text.get_text() for text in key.get_texts()]


def drawn_markers(axes: Axes) -> set[tuple[str, bool]]:
    """Shape and hollowness of every marker in the axes."""
    return {(str(line.get_marker()), to_hex(line.get_markerfacecolor()) == "#ffffff") for line in axes.lines}


def test_every_entry_of_a_plan_s_key_is_drawn_as_it_stands_there(tmp_path: Path, saved: list[Figure]) -> None:
    paint = material("paint", BYTES, a=(COLOUR, 12, 3.0), b=(LAMBERT, 12, 3.01), c=(BYTES, 48, 0.5))
    plot_plan(tmp_path / "p.png", plan(paint))
    axes = saved[0].axes[0]
    assert key_words(axes) == [
        "one colour", "search, 8 bits", "chosen", "smallest error for the bytes", "tolerance",
    ]  # fmt: skip
    assert {("o", False), ("h", True)} <= drawn_markers(axes)


def test_a_plan_has_the_names_of_the_terminal_beside_its_markers_and_bars(tmp_path: Path, saved: list[Figure]) -> None:
    lobes = Candidate("ggx:2")
    paint = material("paint", lobes, a=(COLOUR, 12, 30.0), c=(BYTES, 48, 3.0), d=(lobes, 52, 0.7))
    plot_plan(tmp_path / "p.png", plan(paint))
    left, right = saved[0].axes
    words = {text.get_text() for text in left.texts if text.get_text()}
    assert words == {each.words for each in (COLOUR, BYTES, lobes)}
    assert [label.get_text() for label in right.get_yticklabels()][1] == f"{lobes.words}, 52 bytes"
    assert "GGX model" in key_words(left)


@pytest.mark.parametrize("choice", [COLOUR, LAMBERT])
def test_two_ways_to_light_one_colour_have_two_names_if_their_errors_differ(
    choice: Candidate, tmp_path: Path, saved: list[Figure]
) -> None:
    nine = "one colour, light as 9 numbers"
    clay = material("clay", choice, a=(COLOUR, 12, 0.5), b=(LAMBERT, 12, 0.9), c=(BYTES, 48, 0.4))
    plot_plan(tmp_path / "p.png", plan(clay))
    left, right = saved[0].axes
    words = {text.get_text() for text in left.texts if text.get_text()}
    assert words == {"one colour", nine, BYTES.words}
    name = nine if choice == LAMBERT else "one colour"
    assert [label.get_text() for label in right.get_yticklabels()][1] == f"{name}, 12 bytes"
    assert key_words(left)[:2] == ["one colour", nine]
    assert len({marker for marker, hollow in drawn_markers(left) if not hollow} & {"o", "v"}) == 2
    # The key is inside the axes, however long its entries are.
    key = left.get_legend()
    assert key is not None
    box, frame = key.get_window_extent(), left.get_window_extent()
    assert frame.x0 < box.x0 < box.x1 < frame.x1


def test_what_lies_on_one_spot_is_one_spot_with_the_choice_first() -> None:
    paint = material(
        "paint", LAMBERT, a=(COLOUR, 12, 0.9), b=(LAMBERT, 12, 0.91), c=(BYTES, 12, 0.5), d=(FLOATS, 48, math.inf)
    )
    assert [(spot.candidates, spot.chosen) for spot in spots_of(paint)] == [
        ((LAMBERT, COLOUR), True), ((BYTES,), False),
    ]  # fmt: skip


def test_a_plan_that_asked_once_has_no_panel_of_one_point(tmp_path: Path, saved: list[Figure]) -> None:
    plot_plan(tmp_path / "one.png", plan(material("clay", COLOUR, a=(COLOUR, 12, 0.9), b=(LAMBERT, 12, 0.9))))
    plot_plan(tmp_path / "two.png", plan(material("clay", BYTES, a=(COLOUR, 12, 2.0), b=(BYTES, 48, 0.9))))
    assert [len(figure.axes) for figure in saved] == [1, 2]
    words = [text.get_text() for text in saved[1].axes[0].texts]
    assert {"one colour", "1 texture of 4², 8 bits (search)"} <= set(words)


def test_labels_stay_off_each_other_and_off_the_points() -> None:
    figure = Figure(figsize=(4, 4))
    axes = figure.subplots()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    figure.canvas.draw()
    points = [(0.5, 0.5), (0.5, 0.52), (0.52, 0.5)]
    label_points(figure, axes, [PointLabel("a label", each, "black") for each in points])
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
    assert len(boxes) == 3
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
        assert not any(box.contains(*axes.transData.transform(each)) for each in points)


def test_markers_side_by_side_move_as_little_as_they_can() -> None:
    assert side_by_side([(0, 0), (40, 0), (0, 8)], [3, 3, 3]) == [0, 0, 0]
    # The first stays, the others take the nearest free places right and left of it.
    assert side_by_side([(0, 0), (0, 0), (0, 0)], [3, 3, 3]) == [0, 7, -7]
    # Beside a ring there is more to move.
    assert side_by_side([(0, 0), (0, 0)], [8, 3]) == [0, 12]
    # No farther than a seventh of a decade or so, even if all places are taken: then where it is seen best.
    crowd = side_by_side([(0, 0)] * 12, [3.0] * 12)
    assert max(map(abs, crowd)) <= 14
    assert len(set(crowd[:5])) == 5
    assert crowd[5:] != [0] * 7
