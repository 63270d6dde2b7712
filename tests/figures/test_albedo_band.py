"""The chart of an error bar by angle: its band lies where the bars are, and nowhere else."""

import math

import numpy as np
import pytest
from matplotlib.axes import Axes

from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.figures.albedo_band import HEIGHT, albedo_band, albedo_ticks

BAND, LINE = (0x9D, 0xB4, 0xCC), (0x12, 0x38, 0x5F)
WIDTH = 320


def bars(*errors: float | None, kind: BarKind = BarKind.RIGHT) -> ErrorBars:
    angles = (5.0, 20.0, 40.0, 60.0, 75.0)
    by_angle = tuple(
        ErrorBar("albedo", kind if error is not None else BarKind.WITHDRAWN, error, 0.9, (at, at))
        for at, error in zip(angles, errors, strict=False)
    )
    return ErrorBars((ErrorBar("albedo", kind, 0.1, 0.9, (0.0, 75.0)),), by_angle)


def columns(pixels: np.ndarray) -> np.ndarray:
    """How many pixels of a column are of the band."""
    return (pixels == BAND).all(2).sum(0)


def test_the_band_is_as_high_as_the_bars_and_as_wide_as_was_measured() -> None:
    pixels = albedo_band(bars(0.05, 0.05, 0.1, 0.1, 0.1), WIDTH)
    assert pixels is not None
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    high = columns(pixels)
    # 254 pixels stand for 90°, and the chart begins at the 58th.
    at = {degrees: high[58 + round(254 * degrees / 90)] for degrees in (2, 12, 50, 67, 82)}
    assert at[2] == at[82] == 0
    assert at[50] == pytest.approx(at[67], abs=1)
    assert at[50] / at[12] == pytest.approx((0.1 + 1 - 1 / 1.1) / (0.05 + 1 - 1 / 1.05), rel=0.1)
    part = albedo_band(bars(0.05, 0.05, 0.05, None, None), WIDTH)
    assert part is not None
    assert columns(part)[58 + 254 * 50 // 90] == 0


def test_one_angle_is_a_stroke_and_none_is_no_chart() -> None:
    stroke = albedo_band(bars(0.05), WIDTH)
    assert stroke is not None
    assert (stroke < 128).any()
    assert columns(stroke).sum() == 0
    assert albedo_band(bars(None, None), WIDTH) is None
    assert albedo_band(ErrorBars(()), WIDTH) is None


def edges(pixels: np.ndarray, column: int) -> tuple[int, int]:
    """First and last row of the band in a column."""
    rows = np.flatnonzero((pixels[:, column] == BAND).all(1))
    return int(rows[0]), int(rows[-1])


@pytest.mark.parametrize("most", [0.012, 0.1, 0.89, 4.2, 8.9, 18.0])
def test_the_largest_bar_ends_inside_the_chart_between_two_ticks_or_near_the_last(most: float) -> None:
    pixels = albedo_band(bars(most / 4, most / 4, most / 4, most, most), WIDTH)
    assert pixels is not None
    top, bottom = edges(pixels, 58 + 254 * 67 // 90)
    # The axes are 80 pixels high, between 22 above and 34 below; a bar of a factor is as long below as above.
    assert 22 < top < bottom < HEIGHT - 34
    assert top - 22 == pytest.approx(HEIGHT - 34 - bottom, abs=2)
    reach = 1.15 * math.log(1 + most)
    ticks = [ratio for ratio, _ in albedo_ticks(most, reach)]
    assert max(ticks) >= (1 + most) ** 0.45
    assert all(abs(math.log(ratio)) <= reach for ratio in ticks)


def test_ticks_have_the_words_of_the_sentence_above_the_chart() -> None:
    words = [label for _, label in albedo_ticks(4.2, 1.15 * math.log(5.2))]
    assert words == ["1", "×5", "÷5", "×2", "÷2"]
    words = [label for _, label in albedo_ticks(0.05, 1.15 * math.log(1.05))]
    assert words == ["0", "+5%", "−5%", "+2%", "−2%"]
    # Nothing is 100% darker on a logarithmic axis.
    assert "−100%" not in [label for _, label in albedo_ticks(1.0, 1.15 * math.log(2))]


@pytest.mark.parametrize("most", [30.0, 700.0, 1e6])
def test_a_cut_bar_has_a_triangle_and_its_factor(most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    annotate = Axes.annotate
    monkeypatch.setattr(
        Axes, "annotate", lambda self, text, *a, **k: (written.append(text), annotate(self, text, *a, **k))[1]
    )
    pixels = albedo_band(bars(0.5, 0.5, 0.5, 0.5, most), WIDTH)
    assert pixels is not None
    at = 58 + round(254 * 75 / 90)
    line = (pixels == LINE).all(2)
    # Wider than the bar, at both ends of it.
    assert line[18:26, at - 2 : at + 3].sum(1).max() >= 4
    assert line[-38:-30, at - 2 : at + 3].sum(1).max() >= 4
    assert written == [">×1000" if most > 1000 else f"×{1 + most:.0f}"]
    # The others are visible beside it.
    assert columns(pixels)[58 + 254 * 12 // 90] >= 5


def test_factors_of_cut_bars_do_not_cover_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    monkeypatch.setattr(Axes, "annotate", lambda self, text, *a, **k: written.append(text))
    albedo_band(bars(30.0, 0.5, 0.5, 0.5, 40.0), WIDTH)
    assert written == ["×41", "×31"]
    close = ErrorBars((), tuple(ErrorBar("albedo", BarKind.MEASURED, 30.0 + at, 1, (at, at)) for at in (70.0, 75.0)))
    written.clear()
    albedo_band(close, WIDTH)
    assert written == ["×106"]
