"""The columns of a report's tables: figures that have values, their short titles, and notes on how to read them."""

from collections.abc import Sequence

from homofact.evaluation.metric_table import REPORTED, Metric
from homofact.evaluation.wording import listed
from homofact.sweeps.summary import IN_ALL_DIRECTIONS, LIMITS, FitRow, Limit, value_of, with_values

TITLES = {
    "log_mse": "log MSE",
    "mae": "MAE, sr⁻¹",
    "albedo_worst": "albedo",
    "energy_overall": "energy",
    "highlight": "highlight",
    "rms_cosine": "rms",
    "psnr_light": "lamp dB",
    "psnr_sky": "sky dB",
    "light_limit": "light within",
    "highlight_limit": "highlight within",
    "sky_limit": "sky within",
}
_ERRORS = (
    "The errors log MSE and MAE are measured on held-out samples. log MSE compares ratios. MAE compares"
    " differences in sr⁻¹, so the brightest samples dominate it. If they rank two fits differently, look at the"
    " pictures of the fits."
)
_LIGHT = (
    "Albedo (at the worst angle), energy (all light) and highlight (the brightest 1% of the light) divide the light of"
    " the fit by the light of the source, so 1 is right. rms is the relative RMS of f cosθi cosθo. lamp dB and sky dB"
    " are PSNRs of pictures."
)
_LIMITS = (
    'The columns "light within", "highlight within" and "sky within" show the limits that the verdict estimates for the'
    " errors of the total reflected light, the highlight and a picture under a sky; ×2 is a factor of 2. Each verdict"
    " states how often its limits hold."
)


def notes(rows: Sequence[FitRow]) -> list[str]:
    """Return how to read the columns of these fits, and which columns are left out and why."""
    shown = with_values(rows)
    said = [_ERRORS]
    if any(isinstance(each, Metric) and each.computed_from == "light" for each in shown):
        said.append(_LIGHT)
    if any(isinstance(each, Limit) for each in shown):
        said.append(_LIMITS)
    absent = [TITLES[metric.name] for metric in REPORTED if metric not in shown]
    of_light = [TITLES[metric.name] for metric in REPORTED if metric.computed_from == "light"]
    materials = dict.fromkeys(row.source for row in rows)
    samples = dict.fromkeys(row.source for row in rows if row.limits)
    if absent:
        reason = IN_ALL_DIRECTIONS if len(samples) == len(materials) else "No fit has a value there."
        said.append(f"Columns left out: {listed(absent)}. {reason}")
    elif samples:
        said.append(
            f"Lists of samples ({len(samples)} of {len(materials)} materials) have these limits instead of"
            f" {listed(of_light)}. {IN_ALL_DIRECTIONS}"
        )
    return said


def median_notes(rows: Sequence[FitRow]) -> list[str]:
    """Return how the medians of ratios and of limits are computed, where these have columns."""
    shown = with_values(rows)
    ratios = [TITLES[each.name] for each in shown if each.good == "one"]
    said = []
    if ratios:
        said.append(
            f"For ratios that should be 1 ({', '.join(ratios)}), the table shows the median factor of error, too dark"
            " or too bright alike."
        )
    if any(limit in shown for limit in LIMITS):
        said.append("An unknown limit counts as the largest.")
    if any(value_of(row, each.name) is None for row in rows for each in shown):
        said.append("Medians omit fits without a value.")
    return said
