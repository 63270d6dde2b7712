"""The features from which homofact computes error bars and the warning, by name.

Each feature is the logarithm of a figure plus a small constant; below this constant, the figure is noise. A linear
model of logarithms corresponds to a product of powers of the figures. `FEATURES` describes the features that are the
same for all quantities. The features that depend on the quantity (`OF_QUANTITY`) come from interpolations of the
samples (`bar.reading`), at the angles in the measured range.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from homofact.evaluation.energy import ALBEDO_DEGREES

if TYPE_CHECKING:
    from homofact.evaluation.verdict.figures import Figures

FEATURES = {
    "mended": "part of the fit's error that the nearest samples correct, RMS of logs by light",
    "bias": "the part of it on which both halves of the samples agree",
    "apart": "fit beside the plain reading of the other half of the samples, RMS of logs by light",
    "unexplained": "share of the variance of held-out logs that the fit does not explain",
    "misplaced": "share of the held-out light that is misplaced",
    "gap": "held-out over training log MSE",
    "off": "light in the band of angles that is farthest off",
    "top": "light of the brightest samples under the fit",
    "step": "largest step of the fit's albedo from angle to angle",
    "energy": "largest albedo of the fit",
    "reciprocity": "light of the fit that changes where light and viewer are swapped",
    "data_reciprocity": "the same of the samples",
    "scatter": "disagreement of neighbouring samples",
    "noise": "scatter of the darkest samples",
    "outliers": "light by which few samples stand out",
    "zeros": "share of the samples that are zero in a channel",
    "clipped": "light at samples that share the largest value",
    "rounded": "light that rounding to levels misses",
    "repeated": "light by which samples of the same directions differ",
    "ring": "a ring of angles beside its neighbours",
    "unmeasured": "share of the fit's light beyond the measurement",
    "unresolved": "share of the brightest light that stands between samples",
    "rising": "exponent of the highlight where the samples end",
    "innermost": "how near to the mirror direction was measured",
    "contrast": "how bright the samples there are",
    "samples": "number of samples",
    "effective": "number of samples that hold the light",
    "highest": "how far from the normal was measured",
    "odds": "largest odds of a suspicion",
    "surface_apart": "light by which the fit differs from a surface through the samples",
    "surface_lamp": "the same of a picture under a lamp",
}
OF_QUANTITY = {
    "own_mended": "log of the corrected fit's light over the fit's",
    "own_read": "log of the interpolation's light over the fit's",
    "own_chance": "what two halves of the samples differ by",
    "own_gap": "how far the light is from the nearest sample",
    "own_unmeasured": "share of this light beyond the measurement",
    "own_surface": "log of the light of a surface through the samples over the fit's",
}
_MOST_APART = 2.0  # of logs of light: a reading that is farther off says no more
GAP_FLOOR = 0.1  # added to the ratio of held-out to training error before its logarithm
RANGE_MARGIN = 2.0  # degrees: an albedo just beyond the outermost samples is measured as well


def angles_in_range(lowest: float, highest: float) -> tuple[int, ...]:
    """Return the indices of `energy.ALBEDO_DEGREES` up to `highest` + `RANGE_MARGIN` degrees; at least the first."""
    inside = [k for k, at in enumerate(ALBEDO_DEGREES) if at <= highest + RANGE_MARGIN]
    return tuple(inside) or (0,)


def common_features(figures: "Figures", odds: Mapping[str, float]) -> dict[str, float]:
    """Return the features of `FEATURES` for a fit to samples; `odds` has the odds of each suspicion by name."""
    reading, light, data, errors, coverage = (
        figures.reading, figures.light, figures.data, figures.errors, figures.coverage,
    )  # fmt: skip
    assert reading is not None
    return {
        "mended": _log(reading.mended, 0.003),
        "bias": _log(reading.bias, 0.003),
        "apart": _log(reading.apart, 0.01),
        "unexplained": _log(1 - errors.explained, 0.001),
        "misplaced": _log(errors.misplaced, 0.003),
        "gap": _log(errors.gap, GAP_FLOOR),
        "off": _log(_apart(light.off), 0.003),
        "top": _log(_apart(light.highlight), 0.005),
        "step": _log(_apart(light.step), 0.01),
        "energy": _log(light.albedo, 0.1),
        "reciprocity": _log(light.reciprocity, 0.003),
        "data_reciprocity": _log(light.data_reciprocity or 0.0, 0.01),
        "scatter": _log(data.scatter or 0.0, 0.01),
        "noise": _log(data.noise or 0.0, 0.001),
        "outliers": _log(data.outliers, 0.003),
        "zeros": _log(data.zeros, 0.001),
        "clipped": _log(data.clipped, 0.001),
        "rounded": _log(data.rounded, 0.001),
        "repeated": _log(data.repeated, 0.003),
        "ring": _log(_apart(data.ring) if data.ring_where else 0.0, 0.02),
        "unmeasured": _log(coverage.unmeasured, 0.003),
        "unresolved": _log(coverage.unresolved, 0.05),
        "rising": _log(max(coverage.rising, 0.0), 0.1),
        "innermost": _log(coverage.innermost, 0.05),
        "contrast": _log(coverage.contrast, 0.3),
        "samples": _log(coverage.samples, 1.0),
        "effective": _log(reading.effective, 1.0),
        "highest": _log(90 - coverage.highest, 2.0),
        "odds": _log(max(odds.values(), default=1.0), 1.0),
        "surface_apart": _log(reading.surface_apart, 0.002),
        "surface_lamp": _log(reading.surface_lamp, 0.003),
    }


def features_of(
    figures: "Figures", odds: Mapping[str, float], quantity: str, angle: int | None = None
) -> dict[str, float]:
    """Return all features of a quantity ("albedo", "highlight", "sky"), or of the albedo at one angle.

    `angle` is an index into `ALBEDO_DEGREES`. Without it, the features of `OF_QUANTITY` are the largest over the angles
    in range for the albedo, and their means for the sky.
    """
    reading = figures.reading
    assert reading is not None
    inside = angles_in_range(figures.coverage.lowest, figures.coverage.highest) if angle is None else (angle,)
    if quantity == "highlight":
        own = (
            abs(reading.highlight), abs(reading.read_highlight), reading.highlight_chance, reading.highlight_gap,
            max(reading.unmeasured[k] for k in inside), abs(reading.surface_highlight),
        )  # fmt: skip
    else:
        columns = (
            reading.albedo,
            reading.read_albedo,
            reading.chance,
            reading.gap,
            reading.unmeasured,
            reading.surface,
        )
        chosen = [[abs(column[k]) for k in inside] for column in columns]
        own = tuple(max(each) if quantity == "albedo" else sum(each) / len(each) for each in chosen)
    floors = (0.001, 0.005, 0.002, 0.005, 0.002, 0.001)
    logs = {
        name: _log(min(value, _MOST_APART), floor) for name, value, floor in zip(OF_QUANTITY, own, floors, strict=True)
    }
    return common_features(figures, odds) | logs


def _apart(ratio: float | None) -> float:
    """|log| of a ratio; 0 where there is none."""
    return 0.0 if ratio is None else abs(math.log(min(max(ratio, 1e-6), 1e6)))


def _log(value: float, floor: float) -> float:
    """log(value + floor); of what is no number that of a huge one."""
    return math.log(min(value, 1e6) + floor) if math.isfinite(value) else math.log(1e6)
