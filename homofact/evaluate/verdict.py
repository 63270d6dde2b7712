"""Whether a fit is to be trusted, and why not: every fit ends with a verdict that its user sees.

The verdict needs the fit, what it was made from and the held-out samples, and where there is a source to be asked, the
fit's appearance beside it. What is measured is measured here; `evaluate.findings` says what is off.
"""

import math
from dataclasses import replace

import torch
from torch import Tensor

from homofact.brdf.faults import ALBEDO_DEGREES, albedo
from homofact.brdf.samples import Samples
from homofact.brdf.scatter import local_scatter
from homofact.brdf.symmetry import light_azimuths, reciprocity_of, reciprocity_of_samples
from homofact.errors import Report
from homofact.evaluate.appearance import Appearance
from homofact.evaluate.findings import Verdict, findings
from homofact.evaluate.metrics import SixErrors
from homofact.evaluate.peak import texels_per_radian
from homofact.factor.fitted import Fitted
from homofact.linear.robust import scale_of
from homofact.methods.fitting import Method

GRAZING_DEGREES = 85.0  # beyond `ALBEDO_DEGREES`: where extrapolated lobes grow
PEAK_SHARE = 0.005
OUTLIER, FEW_OUTLIERS = 6.0, 0.05
_DRAWN = 2000
_MOST_SAMPLES = 40_000


def judge(
    fitted: Fitted,
    report: Report,
    settings: Method,
    train: Samples,
    test: Samples,
    errors: tuple[SixErrors, SixErrors],
    seen: Appearance | None = None,
) -> Verdict:
    """The verdict on a fit of `train`, whose `errors` on (what it was given, `test`) are known.

    `seen` is its appearance beside its source, None where that cannot be asked. `train` are the training samples as
    measured: azimuth copies agree with each other perfectly and would hide it.
    """
    transform = fitted.transform
    drawn = train.subset(_MOST_SAMPLES, settings.seed)
    values = fitted.evaluate(drawn.wi, drawn.wo)
    misses = (transform.forward(values) - transform.forward(drawn.values)).square().mean(1).sqrt()
    expected, found = (transform.forward(v) for v in (test.values, fitted.evaluate(test.wi, test.wo)))
    zero = transform.forward(torch.zeros(1, len(train.channels), dtype=torch.float64))
    scatter = local_scatter(drawn, settings.seed)
    swapped = reciprocity_of_samples(drawn, settings.seed)
    azimuths = light_azimuths(train.isotropic)
    angles = (*ALBEDO_DEGREES, GRAZING_DEGREES)
    width = None if seen is None else seen.energy.half_width
    verdict = Verdict(
        status=report.status,
        condition=report.details.get("condition"),
        determined=report.details.get("determined"),
        gap=errors[1].log_mse / max(errors[0].log_mse, 1e-300),
        misfit=math.sqrt(errors[0].log_mse),
        explained=_explained(expected, found),
        peak=_peak(drawn.values, values),
        cut=float(((found <= zero + 1e-9) & (expected > zero + math.log(2))).double().mean()),
        reciprocity=reciprocity_of(fitted, _DRAWN, settings.seed)["p95"],
        data_reciprocity=None if swapped is None else swapped["median"],
        scatter=None if scatter is None else scatter.relative,
        outliers=_outliers(misses),
        albedo=max(float(albedo(fitted, angle, a, 24, 32).max()) for angle in angles for a in azimuths),
        albedo_ratio=None if seen is None else seen.energy.albedo_worst,
        highlight=None if seen is None else seen.energy.highlight,
        texels_across=None if width is None else width * texels_per_radian(fitted),
        floor=None if seen is None else seen.energy.floor,
        findings=(),
    )
    noise = None if scatter is None else scatter.floor
    return replace(verdict, findings=tuple(findings(verdict, settings, train, transform.epsilon, noise, errors[1])))


def _explained(expected: Tensor, found: Tensor) -> float:
    """1 − Σ(found − expected)²/Σ(expected − mean)², of the worst channel; 1 for a channel without variance met."""
    missed = (found - expected).square().sum(0)
    there = (expected - expected.mean(0)).square().sum(0)
    # A constant BRDF has no variance to explain; what counts then is whether it is met.
    return float((1 - missed / there.clamp_min(1e-6 * len(expected))).min())


def _peak(expected: Tensor, found: Tensor) -> float:
    """Median of found over expected at the brightest samples, means over the channels."""
    brightness = expected.mean(1)
    brightest = brightness.topk(max(8, round(PEAK_SHARE * len(brightness))) if len(brightness) >= 8 else 1).indices
    return float((found.mean(1)[brightest] / brightness[brightest].clamp_min(1e-300)).median())


def _outliers(misses: Tensor) -> float:
    """Share of the squared error held by samples missed by `OUTLIER` robust deviations, where these are few."""
    far = misses > OUTLIER * scale_of(misses)
    total = float(misses.square().sum())
    if total == 0 or float(far.double().mean()) > FEW_OUTLIERS:
        return 0.0
    return float(misses[far].square().sum()) / total
