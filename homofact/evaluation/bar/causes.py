"""Explain a warning: the figures that raise the probability of a bad fit most, compared with a typical fit.

The warning is a logistic function of a linear model (`bar.table`). So the contribution of each feature to the log odds
is known: its weight times its difference from the calibration mean. Contributions of features that measure the same
thing are added.
"""

import math
from collections.abc import Mapping

from homofact.errors import Advice
from homofact.evaluation.bar.features import GAP_FLOOR
from homofact.evaluation.bar.table import LinearModel, table
from homofact.evaluation.wording import figure

# Log odds from which on a figure counts as a cause, and how many are named.
_WORTH, _MOST = 0.5, 2
# What each figure of a quantity measures, by the figure whose words stand for both.
_SAME = {
    "own_mended": "mended", "own_read": "apart", "own_chance": "scatter", "own_gap": "samples",
    "own_unmeasured": "unmeasured", "own_surface": "surface_apart",
}  # fmt: skip

# The setting that removes a cause.
_ADVICE = {"reciprocity": f"a fit with {Advice('reciprocal', True)} has none"}
# Figures of what was not measured, by which a fit that is right wherever it was measured resembles bad ones.
_UNMEASURED = {"unmeasured", "unresolved", "rising", "innermost", "samples", "effective", "highest"}
# A figure below the usual one is a cause of these alone; of the others that would be no reason to anyone.
_LESS_IS_WORSE = {"samples", "effective"}
_EITHER_WAY = {"contrast"}

WORDS = {
    "mended": "the error that a correction by the nearest samples removes",
    "bias": "the error on which both halves of the samples agree",
    "apart": "the difference in logarithms between the fit and an interpolation of the samples",
    "unexplained": "the variation of the samples that the fit does not explain",
    "misplaced": "the misplaced light",
    "gap": "the held-out error over the training error",
    "off": "the error of the light in the worst band of angles",
    "top": "the error of the highlight",
    "step": "the jump of the albedo from angle to angle",
    "energy": "the largest albedo",
    "reciprocity": "the light that changes when light and viewer are swapped",
    "data_reciprocity": "the change of the samples when light and viewer are swapped",
    "scatter": "the disagreement of neighbouring samples",
    "noise": "the scatter of the darkest samples",
    "outliers": "the light of a few samples that stand out",
    "zeros": "the share of samples that are zero",
    "clipped": "the light of samples at the largest value",
    "rounded": "the light that rounding misses",
    "repeated": "the difference of repeated samples",
    "ring": "the step of one ring of angles",
    "unmeasured": "the fit's light at angles without measurements",
    "unresolved": "the light of the highlight between samples",
    "rising": "the rise of the highlight where the samples end",
    "innermost": "the angle from the mirror direction to the nearest samples",
    "contrast": "the brightness near the mirror direction",
    "samples": "the number of samples",
    "effective": "the number of samples that carry the light",
    "highest": "the range of grazing angles without measurements",
    "odds": "the suspicion that the data are faulty",
    "surface_apart": "the difference in light between the fit and an interpolation of the samples",
    "surface_lamp": "the difference between a picture of the fit and one of an interpolation of the samples",
}


def gap_in_words(gap: float, is_held_out: bool = True) -> str:
    """Return the ratio of held-out to training error beside the usual ratio, as text for messages.

    If nothing was held out, the ratio comes from the search's own validation, or is 1 for a method without validation.
    The usual ratio is the geometric mean over the calibration fits to correct samples.

    Examples
    --------
    >>> gap_in_words(1.08)
    'held out / training 1.08 (usual: 1.3)'
    >>> gap_in_words(2.93)
    'held out / training 2.93 (usual: 1.3)'
    """
    if not is_held_out and gap == 1:
        return "nothing held out"
    mean = table().bars["right"]["albedo"].model.columns["gap"][1]
    what = "held out" if is_held_out else "nothing held out, the search's validation"
    return f"{what} / training {figure(gap)} (usual: {math.exp(mean) - GAP_FLOOR:.2g})"


def causes(model: LinearModel, features: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Return (feature, part of the log odds, ratio to the usual value) of each main cause, largest part first.

    The list has at least one cause if any feature raises the odds and is worse than usual.
    """
    parts: dict[str, float] = {}
    times: dict[str, float] = {}
    for name, (weight, mean, low, high) in model.columns.items():
        part = weight * (min(max(features[name], low), high) - mean)
        group = _SAME.get(name, name)
        parts[group] = parts.get(group, 0.0) + part
        # The ratio of the figure that has the largest part in it.
        if name == group or group not in times:
            times[group] = math.exp(features[name] - mean)
    bad = (name for name in parts if name in _EITHER_WAY or (times[name] >= 1) != (name in _LESS_IS_WORSE))
    raised = sorted(((parts[name], name) for name in bad if parts[name] > 0), reverse=True)
    kept = [each for each in raised[:_MOST] if each[0] >= _WORTH] or raised[:1]
    return [(name, part, times[name]) for part, name in kept]


def lacks_measurements(model: LinearModel, features: Mapping[str, float]) -> bool:
    """Return whether all main causes are a lack of measurements."""
    return {name for name, *_ in causes(model, features)} <= _UNMEASURED


def causes_in_words(model: LinearModel, features: Mapping[str, float]) -> str:
    """Return the main causes in words: "the number of samples is 0.2 times that of most fits"."""
    return "; ".join(
        f"{WORDS[name]} is {times:.2g} times that of most fits" + (f" ({_ADVICE[name]})" if name in _ADVICE else "")
        for name, _, times in causes(model, features)
    )
