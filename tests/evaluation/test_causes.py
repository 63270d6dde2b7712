"""Why a verdict warns and where a fit is good: the causes of the score, the angles of the bars, what is advised."""

import math
from dataclasses import replace

import pytest

from homofact.cli.verdicts import cause_lines, where_lines
from homofact.evaluation.bar.causes import WORDS, causes, causes_in_words, gap_in_words, lacks_measurements
from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.evaluation.bar.features import FEATURES, OF_QUANTITY
from homofact.evaluation.bar.table import LinearModel, table
from homofact.evaluation.verdict.noting import _NOTES


def model(**columns: tuple[float, float]) -> LinearModel:
    """Weights and means of features; nothing is clipped."""
    return LinearModel(0.1, {name: (*both, -100.0, 100.0) for name, both in columns.items()})


def test_causes_are_what_raises_the_odds_most() -> None:
    own = model(reciprocity=(1.0, -5.0), scatter=(2.0, -3.0), outliers=(0.4, -5.0), noise=(-1.0, -5.0))
    found = causes(own, {"reciprocity": -3.0, "scatter": -2.5, "outliers": -4.0, "noise": 0.0})
    assert [(name, round(part, 9)) for name, part, _ in found] == [("reciprocity", 2.0), ("scatter", 1.0)]
    assert found[0][2] == pytest.approx(math.exp(2))
    # Small parts are left out, unless there is nothing else.
    usual = {"reciprocity": -5.0, "scatter": -2.9, "outliers": -5.0, "noise": -5.0}
    assert [name for name, _, _ in causes(own, usual | {"reciprocity": -3.0})] == ["reciprocity"]
    assert [name for name, _, _ in causes(own, usual)] == ["scatter"]
    assert causes(own, {"reciprocity": -5.0, "scatter": -3.0, "outliers": -5.0, "noise": 0.0}) == []


def test_figures_of_one_thing_are_summed() -> None:
    own = model(own_unmeasured=(-0.5, -3.0), unmeasured=(0.5, -4.0), reciprocity=(0.3, -5.0))
    found = causes(own, {"unmeasured": -2.0, "own_unmeasured": -1.0, "reciprocity": -4.0})
    assert [name for name, _, _ in found] == ["reciprocity"]


def test_a_figure_beyond_what_was_seen_counts_up_to_there() -> None:
    own = LinearModel(0.0, {"gap": (1.0, 0.0, -1.0, 0.75), "scatter": (1.0, 0.0, -1.0, 5.0)})
    assert [name for name, _, _ in causes(own, {"gap": 9.0, "scatter": 2.0})] == ["scatter", "gap"]


def test_every_feature_has_words_of_its_own() -> None:
    assert WORDS.keys() == FEATURES.keys()
    usual = {name: mean for name, (_, mean, _, _) in table().warning.columns.items()}
    assert set(usual) <= {*FEATURES, *OF_QUANTITY}
    assert causes_in_words(table().warning, usual) == ""
    raised = usual | {"reciprocity": usual["reciprocity"] + math.log(6)}
    assert causes_in_words(table().warning, raised) == (
        "the light that changes when light and viewer are swapped is 6 times that of most fits (a fit with"
        " `reciprocal=True` has none)"
    )


def test_a_ratio_of_one_set_of_samples_is_none() -> None:
    assert "training" not in gap_in_words(1.0, is_held_out=False)
    assert "validation / training 3" in gap_in_words(3.0, is_held_out=False)


@pytest.mark.parametrize("gap", [0.9, 1.9, 2.1, 40.0])
def test_the_ratio_of_errors_has_the_usual_one(gap: float) -> None:
    words = gap_in_words(gap)
    assert words.startswith(f"held out / training {gap:.3g} (usual: ")
    usual = float(words.partition("usual: ")[2].rstrip(")").partition(";")[0])
    mean = table().bars["right"]["albedo"].model.columns["gap"][1]
    assert usual == pytest.approx(math.exp(mean) - 0.1, rel=0.05)
    assert 1 < usual < 2


def bars(*errors: float | None) -> ErrorBars:
    kinds = (BarKind.RIGHT, BarKind.WITHDRAWN)
    made = [ErrorBar("albedo", kinds[e is None], e, 0.9, (15.0 * k, 15.0 * k)) for k, e in enumerate(errors)]
    whole = ErrorBar("albedo", BarKind.RIGHT, 0.1, 0.9, (0.0, 15.0 * (len(made) - 1)))
    return ErrorBars((whole,), tuple(made))


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ((0.03, 0.04, 0.15, 0.16, 0.5), "good at 0–30° (within 15%) and bad at 45–60° (within 50%)"),
        ((0.4, 0.03), "bad at 0° (within 40%) and good at 15° (within 3%)"),
        ((0.03, 0.4, 0.05), "good at 0° (within 3%), bad at 15° (within 40%) and good at 30° (within 5%)"),
        ((0.03, None), "good at 0° (within 3%) and unknown at 15°"),
        ((1.5, 0.2, 0.1), "bad at 0–15° (within a factor of 2.5) and good at 30° (within 10%)"),
    ],
)
def test_a_sentence_says_where_a_fit_is_good(errors: tuple[float | None, ...], words: str) -> None:
    assert bars(*errors).by_angle_sentence() == f"by angle of incidence, total reflected light is {words}"


@pytest.mark.parametrize("errors", [(), (0.1,), (0.03, 0.04), (1.5, 0.2)])
def test_what_is_the_same_at_all_angles_is_not_said_again(errors: tuple[float, ...]) -> None:
    assert bars(*errors).by_angle_sentence() == ""


def test_a_sentence_names_the_angles_whose_bars_rest_on_extrapolation() -> None:
    made = bars(0.03, 0.03, 0.2, None, 0.06)
    shares = (0.04, 0.10, 0.15, 0.9, 0.22)  # below 5%, above the bar, below the bar, without a bar, above the bar
    by_angle = tuple(replace(bar, unmeasured=share) for bar, share in zip(made.by_angle, shares, strict=True))
    assert [bar.rests_on_extrapolation for bar in by_angle] == [False, True, False, False, True]
    assert ErrorBars((), by_angle).extrapolated_sentence() == (
        "at 15° and 60° incidence, 10% and 22% of the light leaves in directions without measurements: the limits of"
        " total reflected light there (3% and 6%) rest on extrapolation"
    )
    assert ErrorBars((), by_angle[:2]).extrapolated_sentence().endswith("there (3%) rests on extrapolation")
    assert made.extrapolated_sentence() == ""


def test_no_advice_leads_to_a_fit_that_cannot_be_exported() -> None:
    gamut = next(note for note in _NOTES if note.name == "gamut")
    assert gamut.advice(None, 0.5) is None  # pyright: ignore[reportArgumentType]
    assert "export refuses" in gamut.remedy


def test_lines_are_printed_where_there_is_something_to_say() -> None:
    class Said:
        def __init__(self, cause: str, own: ErrorBars) -> None:
            self.cause, self.bars = cause, own

    warned, silent = Said("why", bars(0.1, 0.4)), Said("", bars(0.1))
    assert cause_lines(warned) == ["Why it warns: why"]  # pyright: ignore[reportArgumentType]
    assert where_lines(warned)[0].startswith("Where: by angle")  # pyright: ignore[reportArgumentType]
    assert cause_lines(silent) == where_lines(silent) == []  # pyright: ignore[reportArgumentType]


def test_a_figure_on_the_good_side_of_the_usual_one_is_no_cause() -> None:
    # A negative weight raises the odds where an error is small: true of the calibration, and no reason to anyone.
    own = model(apart=(-1.0, -2.0), samples=(-1.0, 5.0), reciprocity=(1.0, -5.0))
    assert causes(own, {"apart": -4.0, "samples": 5.0, "reciprocity": -5.0}) == []
    assert [name for name, *_ in causes(own, {"apart": -4.0, "samples": 3.0, "reciprocity": -4.0})] == [
        "samples", "reciprocity",
    ]  # fmt: skip


def test_a_lack_of_measurements_is_told_from_errors() -> None:
    model = table().warning
    usual = {name: mean for name, (_, mean, _, _) in model.columns.items()}
    assert lacks_measurements(model, usual | {"highest": usual["highest"] + 1.5})
    assert not lacks_measurements(model, usual | {"misplaced": usual["misplaced"] + 1.5})
