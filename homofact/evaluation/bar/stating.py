"""Choose the error bars of a fit: measured errors if the source can be evaluated, else estimates of `bar.table`."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.evaluation.appearance import Appearance
from homofact.evaluation.bar.error_bar import BarKind, ErrorBar, ErrorBars
from homofact.evaluation.bar.features import angles_in_range, features_of
from homofact.evaluation.bar.table import QUANTITIES, RATE, BarModel, Table
from homofact.evaluation.energy import ALBEDO_DEGREES

if TYPE_CHECKING:
    from homofact.evaluation.verdict.figures import Figures

_HIGHEST = ALBEDO_DEGREES[-1]
_WHOLE = 15.0  # degrees: what was measured from nearer to the normal than this is stated from 0
_HUGE = 1e6


def measured_bars(seen: Appearance) -> ErrorBars:
    """Return the measured errors of a fit against a source that was evaluated everywhere."""
    whole = (0.0, _HIGHEST)
    ratios = [max(row, key=_error) for row in seen.energy.albedo_ratio]
    light = {"albedo": max(ratios, key=_error), "highlight": seen.energy.highlight}
    bars = [_measured(name, ratio, whole) for name, ratio in light.items()]
    pictures = {"sky": seen.off_sky, "lamp": seen.off_light}
    bars += [
        ErrorBar(name, BarKind.MEASURED, error, 1.0, whole) for name, error in pictures.items() if not math.isnan(error)
    ]
    by_angle = tuple(
        _measured("albedo", ratio, (degrees, degrees))
        for degrees, ratio in zip(seen.energy.degrees, ratios, strict=True)
    )
    return ErrorBars(tuple(bars), by_angle)


def stated_bars(figures: "Figures", odds: Mapping[str, float], constants: Table, doubt: str) -> ErrorBars:
    """Return the estimated bars of a fit to samples; a `doubt`, given in words, selects those for faulty samples.

    `odds` has the odds of each suspicion. The bar of a single angle is never wider than the bar of the worst angle.
    Separate models estimate them, and a bound for the worst angle also applies to each angle.
    """
    kind = BarKind.FAULT if doubt else BarKind.RIGHT
    models = "fault" if doubt else "right"
    degrees = stated_range(figures)
    bounds = {name: _bound(constants.bars[models][name], features_of(figures, odds, name), name) for name in QUANTITIES}
    bars = tuple(ErrorBar.stated(name, kind, bounds[name], RATE, degrees, doubt) for name in QUANTITIES)
    inside = angles_in_range(figures.coverage.lowest, figures.coverage.highest)
    by_angle = []
    for k in inside:
        bound = _bound(constants.angles[models][k], features_of(figures, odds, "albedo", k), "albedo")
        at = ALBEDO_DEGREES[k]
        unmeasured = 0.0 if figures.reading is None else figures.reading.unmeasured[k]
        least = min(bound, bounds["albedo"])
        by_angle.append(ErrorBar.stated("albedo", kind, least, RATE, (at, at), doubt, unmeasured))
    return ErrorBars(bars, tuple(by_angle))


def withdrawn_bars(figures: "Figures", reason: str) -> ErrorBars:
    """Return bars that are all withdrawn."""
    degrees = stated_range(figures)
    return ErrorBars(tuple(ErrorBar(name, BarKind.WITHDRAWN, None, RATE, degrees, reason) for name in QUANTITIES))


def stated_range(figures: "Figures") -> tuple[float, float]:
    """Return the range of θ in degrees that the bars cover: the measured range, within that of the calibration."""
    coverage = figures.coverage
    lowest = 0.0 if coverage.lowest < _WHOLE else coverage.lowest
    return lowest, min(coverage.highest, _HIGHEST)


def _bound(model: BarModel, features: Mapping[str, float], quantity: str) -> float:
    """The bound as a share: of light that of a logarithm, of a picture itself."""
    bound = model.bound(features)
    return bound if quantity == "sky" else math.expm1(min(bound, math.log(_HUGE)))


def _measured(quantity: str, ratio: float, degrees: tuple[float, float]) -> ErrorBar:
    """The bar of light whose ratio to the source's was measured."""
    return ErrorBar(
        quantity, BarKind.MEASURED, _error(ratio), 1.0, degrees, ratio=ratio if math.isfinite(ratio) else None
    )


def _error(ratio: float) -> float:
    """How far a ratio is from 1, as a share of the smaller side."""
    if not ratio > 0 or math.isinf(ratio):
        return _HUGE
    return math.expm1(min(abs(math.log(ratio)), math.log(_HUGE)))
