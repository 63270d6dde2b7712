"""The picture of a plan, drawn of made-up outcomes: no words in the axes of the bars, lines that only fall."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from plan_cases import PAINT, fits_of

from homofact.planning import figure
from homofact.planning.figure import plot_plan
from homofact.planning.figure_points import spots_of
from homofact.planning.ladder import CONSTANT, Candidate
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.scene import SceneMaterial
from homofact.planning.search import LadderOutcome, Walk
from homofact.planning.tolerance import Errors, Tolerance

LONG = "A name of a material that is long"
ERRORS = {
    Candidate(CONSTANT): 90.0, Candidate("search", 1, 4, "png8"): 30.0, Candidate("search", 1, 8, "png8"): 60.0,
    Candidate("search", 2, 8, "png8"): 20.0, Candidate("svd", 5, 32): 25.0,
}  # fmt: skip


def plan_of() -> ScenePlan:
    """A plan of one material that misses its limit twentyfold."""
    asked = {
        rung: LadderOutcome(error, rung.most_bytes(3), rung.most_fetches(True), rung.textures, "delta_e", error / 1.15)
        for rung, error in ERRORS.items()
    }
    choice = Candidate("search", 2, 8, "png8")
    light: Any = SimpleNamespace(lighting=SimpleNamespace(name="studio"))
    walk = Walk(1.0, asked, choice, False)
    material = MaterialPlan(
        SceneMaterial("own", 1.0, name=LONG), fits_of(PAINT), (light,), Tolerance.of(delta_e=1.0), walk
    )
    material.__dict__["errors"] = (Errors(0.1, 17.0, 18.0, 30.0, 0.1, 0.1),)
    scene: Any = SimpleNamespace(name="two", tolerance=material.tolerance, lightings=(light.lighting,))
    return ScenePlan(scene, (material,), None, 4, 6, 30)


def crowd_of(materials: int) -> ScenePlan:
    """A plan of materials whose points crowd round the tolerance."""
    (own,) = plan_of().materials
    sizes = [(count, size, store) for count in (1, 2, 3) for size in (4, 8, 16) for store in ("png8", "float32")]
    every = [Candidate(CONSTANT), *(Candidate("search", *size) for size in sizes)]
    crowd = []
    for k in range(materials):
        asked = {}
        for n, rung in enumerate(every):
            error = (4 + k) * (12 / rung.most_bytes(3)) ** 0.6 * (1 + 0.2 * ((3 * k + 5 * n) % 7 - 3) / 3)
            asked[rung] = LadderOutcome(error, rung.most_bytes(3), 3, rung.textures, "delta_e", error)
        choice = min((rung for rung in asked if asked[rung].error <= 1), key=lambda rung: asked[rung].bytes)
        name = f"material {k}"
        plan = replace(own, material=SceneMaterial(name, 1 / materials, name=name), walk=Walk(1.0, asked, choice, True))
        plan.__dict__["errors"] = own.errors
        crowd.append(plan)
    return replace(plan_of(), materials=tuple(crowd))


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """What is drawn."""
    made: list[Figure] = []

    class Kept(Figure):
        def __init__(self, *arguments: Any, **more: Any) -> None:
            super().__init__(*arguments, **more)
            made.append(self)

    monkeypatch.setattr(figure, "Figure", Kept)
    return made


@pytest.fixture
def drawn(tmp_path: Path, made: list[Figure]) -> Figure:
    plot_plan(tmp_path / "p.png", plan_of())
    return made[0]


def test_material_and_choice_stand_outside_the_axes_of_the_bars(drawn: Figure) -> None:
    bars = drawn.axes[1]
    assert [text.get_text() for text in bars.texts] == []
    labels = bars.get_yticklabels()
    assert [label.get_text() for label in labels] == [
        LONG[:31] + "…", "2 textures of 8², 8 bits (search), 384 bytes", "mean ΔE, studio",
    ]  # fmt: skip
    assert all(label.get_window_extent().x1 <= bars.get_window_extent().x0 for label in labels)
    assert all(label.get_window_extent().x0 >= 0 for label in labels)


def test_the_title_counts_all_fits(drawn: Figure) -> None:
    assert drawn.get_suptitle().split("\n") == [
        "two: mean ΔE at most 1, under studio",
        "tolerance missed for 1 of 1 material; 384 bytes; 6 of 30 possible fits made",
    ]


def test_a_long_title_breaks_into_lines_of_about_equal_length(tmp_path: Path, made: list[Figure]) -> None:
    plan = plan_of()
    sky: Any = SimpleNamespace(name="environment_of_a_long_name")
    plan.scene.__dict__["lightings"] = (sky,) * 5
    plot_plan(tmp_path / "p.png", plan)
    *asked, found = made[0].get_suptitle().split("\n")
    assert " ".join(asked) == f"two: mean ΔE at most 1, under {', '.join([sky.name] * 5)}"
    assert len(asked) == 2
    assert abs(len(asked[0]) - len(asked[1])) < len(sky.name) + 2
    assert found.startswith("tolerance missed")


def test_candidates_that_err_ten_thousand_times_as_much_are_counted_and_not_drawn(
    tmp_path: Path, made: list[Figure]
) -> None:
    plan = plan_of()
    asked = plan.materials[0].walk.asked
    far = {Candidate("mccool", 2, 32): 2.1e5, Candidate("mccool", 2, 64): math.inf, Candidate("svd", 5, 16): 1.9e5}
    for rung, error in far.items():
        asked[rung] = LadderOutcome(error, rung.most_bytes(3), 3, 2, "delta_e", error)
    plot_plan(tmp_path / "p.png", plan)
    left = made[0].axes[0]
    # The best of all errs 20 times its limit.
    assert left.get_title().endswith("(2 of them, with an error above 10,000, left out)")
    assert 1.9e5 < left.get_ylim()[1] < 1e8
    assert len(spots_of(plan.materials[0])) == len(ERRORS) + 1


def test_a_line_steps_down_to_each_smaller_error(drawn: Figure) -> None:
    (line,) = [each for each in drawn.axes[0].lines if each.get_alpha() == 0.5]
    assert np.asarray(line.get_xydata()).tolist() == [[12, 90], [48, 90], [48, 30], [384, 30], [384, 20]]
    key = drawn.axes[0].get_legend()
    assert key is not None
    assert "smallest error for the bytes" in [text.get_text() for text in key.get_texts()]


def test_the_key_covers_no_point_and_no_name(drawn: Figure) -> None:
    left = drawn.axes[0]
    key = left.get_legend()
    assert key is not None
    box = key.get_window_extent()
    points = [left.transData.transform((rung.most_bytes(3), error)) for rung, error in ERRORS.items()]
    assert not any(box.contains(*point) for point in points)
    assert not any(box.overlaps(text.get_window_extent()) for text in left.texts if text.get_text())


def test_each_name_is_beside_its_own_marker_and_on_nothing_else(drawn: Figure) -> None:
    left, point = drawn.axes[0], drawn.dpi / 72
    names = [text for text in left.texts if isinstance(text, Annotation) and text.get_text()]
    assert len(names) == len(ERRORS)
    boxes = [name.get_window_extent() for name in names]
    places = [left.transData.transform((float(name.xy[0]), float(name.xy[1]))) for name in names]
    for k, (name, box, (x, y)) in enumerate(zip(names, boxes, places, strict=True)):
        apart = np.hypot(x - np.clip(x, box.x0, box.x1), y - np.clip(y, box.y0, box.y1)) / point
        # From the marker's edge, or the ring's: about a letter's width.
        assert 0 < apart - (7 if name.get_fontweight() == "bold" else 3) < 4
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
        assert not any(box.contains(*other) for other in places)


@pytest.mark.parametrize("materials", [2, 6])
def test_a_crowded_plan_names_its_choices_and_covers_no_marker(
    materials: int, tmp_path: Path, made: list[Figure]
) -> None:
    plan = crowd_of(materials)
    plot_plan(tmp_path / "p.png", plan)
    left, point = made[0].axes[0], made[0].dpi / 72
    names = [text for text in left.texts if isinstance(text, Annotation) and text.get_text()]
    spots = [spot for each in plan.distinct for spot in spots_of(each)]
    chosen = [name for name in names if name.get_fontweight() == "bold"]
    assert len(chosen) == materials
    assert materials < len(names) < len(spots)
    # The key explains the marker of one colour.
    assert not any(name.get_text() == "one colour" for name in names)
    # That of the saved picture has other dots per inch.
    renderer = FigureCanvasAgg(made[0]).get_renderer()
    boxes = [name.get_window_extent(renderer) for name in names]
    markers = [line for line in left.lines if line.get_marker() in ("o", "h") and line.get_markersize() < 10]
    assert len(markers) == len(spots)
    places = [tuple(map(float, np.asarray(line.get_xydata())[0])) for line in markers]
    for k, (name, box) in enumerate(zip(names, boxes, strict=True)):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
        if name in chosen:
            continue  # always there, on the least that can be covered
        for place in places:
            x, y = left.transData.transform(place)
            apart = np.hypot(x - np.clip(x, box.x0, box.x1), y - np.clip(y, box.y0, box.y1)) / point
            assert place == tuple(map(float, name.xy)) or apart > 2.9


@pytest.mark.parametrize("materials", [2, 3])
def test_markers_are_side_by_side_and_choices_where_they_belong(
    materials: int, tmp_path: Path, made: list[Figure]
) -> None:
    plan = crowd_of(materials)
    plot_plan(tmp_path / "p.png", plan)
    left, point = made[0].axes[0], made[0].dpi / 72
    rings = [line for line in left.lines if line.get_marker() == "o" and line.get_markersize() > 10]
    chosen = sorted(spot.place for each in plan.distinct for spot in spots_of(each) if spot.chosen)
    bare = sorted(tuple(map(float, np.asarray(ring.get_xydata())[0])) for ring in rings)
    assert bare == chosen
    markers = [line for line in left.lines if line.get_marker() in ("o", "h") and line.get_markersize() < 10]
    pixels = left.transData.transform([np.asarray(line.get_xydata())[0] for line in markers]) / point
    gaps = np.hypot(*(pixels[:, None] - pixels[None]).transpose(2, 0, 1))[np.triu_indices(len(pixels), 1)]
    # Markers are 6.5 points across: no two cover more than their rims.
    assert gaps.min() > 5.5
    assert left.get_xlabel().endswith("(markers that would overlap are drawn side by side)")
