"""The chart of an error bar by angle: its band lies where the bars are, and nowhere else."""

import numpy as np
import pytest

from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.figures.albedo_band import HEIGHT, albedo_band

BAND = (0x9D, 0xB4, 0xCC)
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


def test_a_bar_of_a_factor_runs_out_of_the_chart_and_leaves_the_others_visible() -> None:
    pixels = albedo_band(bars(0.5, 0.5, 0.5, 8.0, 8.0), WIDTH)
    assert pixels is not None
    assert columns(pixels)[58 + 254 * 12 // 90] >= 8
