"""Whether a fit is to be trusted, and why not: every fit ends with a verdict that its user sees.

The verdict needs nothing but the fit, what it was made from and the held-out samples. Each check has a threshold,
named here, and a remedy of one line; `docs/stability.md` shows which check answers to which trouble.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.coverage import holes
from homofact.brdf.faults import ALBEDO_DEGREES, albedo
from homofact.brdf.samples import Samples
from homofact.brdf.scatter import local_scatter
from homofact.brdf.symmetry import light_azimuths, reciprocity_of, reciprocity_of_samples
from homofact.errors import Report, Status
from homofact.evaluate.metrics import SixErrors
from homofact.factor.fitted import Fitted
from homofact.linear.robust import scale_of
from homofact.methods.fitting import Method

LARGEST_CONDITION = 1e12
LEAST_DETERMINED = 0.5
LARGEST_GAP = 2.0
WORTH_A_GAP = 1e-3  # held-out log MSE under which a gap is of no concern
LARGEST_RECIPROCITY = 0.1
LARGEST_ALBEDO = 1.02
LARGEST_CUT = 0.05
LEAST_EXPLAINED = 0.9
PEAK_SHARE, LEAST_PEAK = 0.005, 0.5
OUTLIER, FEW_OUTLIERS, OUTLIERS_RULE = 6.0, 0.05, 0.5
LARGEST_SCATTER = 0.2
WORTH_A_FLOOR = 1e-3
LARGEST_MISFIT = 0.2
MISFIT_TO_SCATTER = 3.0
LARGEST_ZEROS = 0.01
LARGEST_HOLES = 0.3
SPREAD_OF_AZIMUTHS = 0.2
_DRAWN = 2000
_MOST_SAMPLES = 40_000


@dataclass(frozen=True)
class Finding:
    """Something off: `name` of the check, what was `found` (with what is expected), and a one-line `remedy`."""

    name: str
    found: str
    remedy: str

    def line(self) -> str:
        """The finding in one line."""
        return f"{self.found}: {self.remedy}"


@dataclass(frozen=True)
class Verdict:
    """The figures of every check, and the findings among them.

    Attributes
    ----------
    status : how the fit ended.
    condition : 1-norm condition number of the normal matrix; None where no linear system was solved.
    determined : share of texels that samples hold rather than smoothing; None likewise.
    gap : held-out over training log MSE.
    misfit : root mean squared error of the training logs.
    explained : share of the variance of the held-out logs that the fit explains, of its worst channel.
    peak : fit over data at the brightest training samples, median.
    cut : share of evaluations that are cut at zero while the data are not zero.
    reciprocity : 95th percentile of the fit's reciprocity error at drawn pairs.
    data_reciprocity : median of the training samples', None where too few have a swapped neighbour.
    scatter : disagreement of neighbouring training samples in log units, None for too few.
    outliers : share of the squared training error that its outermost few samples hold.
    albedo : largest ∫ f cosθ dω of the fit over channels and `brdf.faults.ALBEDO_DEGREES`.
    findings : what is off; none of them makes a trusted fit.
    """

    status: Status
    condition: float | None
    determined: float | None
    gap: float
    misfit: float
    explained: float
    peak: float
    cut: float
    reciprocity: float
    data_reciprocity: float | None
    scatter: float | None
    outliers: float
    albedo: float
    findings: tuple[Finding, ...]

    @property
    def trusted(self) -> bool:
        """Whether nothing was found."""
        return not self.findings

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary."""
        return asdict(self) | {
            "status": self.status.value,
            "trusted": self.trusted,
            "findings": [asdict(finding) for finding in self.findings],
        }


def judge(
    fitted: Fitted,
    report: Report,
    settings: Method,
    train: Samples,
    test: Samples,
    errors: tuple[SixErrors, SixErrors],
) -> Verdict:
    """The verdict on a fit of `train`, whose `errors` on (what it was given, `test`) are known.

    `train` are the training samples as measured: azimuth copies agree with each other perfectly and would hide it.
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
        albedo=max(float(albedo(fitted, angle, a, 24, 32).max()) for angle in ALBEDO_DEGREES for a in azimuths),
        findings=(),
    )
    noise = None if scatter is None else scatter.floor
    return replace(verdict, findings=tuple(_findings(verdict, settings, train, transform.epsilon, noise, errors[1])))


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


def _findings(
    verdict: Verdict,
    settings: Method,
    train: Samples,
    epsilon: float,
    noise: float | None,
    held_out: SixErrors,
) -> Iterator[Finding]:
    """What is off, the gravest first."""
    if verdict.status in (Status.INTERRUPTED, Status.FALLBACK):
        yield Finding("status", f"the fit ended with status {verdict.status.value}", verdict.status.remedy)
    if verdict.condition is not None and not verdict.condition <= LARGEST_CONDITION:
        yield Finding(
            "condition",
            f"the system's condition number is {verdict.condition:.1e}, expected at most {LARGEST_CONDITION:.0e}",
            "more smoothing (--smoothing), fewer textures or more samples",
        )
    if verdict.determined is not None and verdict.determined < LEAST_DETERMINED:
        yield Finding(
            "determined",
            f"samples hold {verdict.determined:.0%} of the texels and smoothing the rest,"
            f" expected {LEAST_DETERMINED:.0%}",
            "smaller textures (--size), fewer of them, or more samples",
        )
    if not verdict.explained >= LEAST_EXPLAINED:
        yield Finding(
            "explained",
            f"{max(verdict.explained, 0):.0%} of the held-out variation is explained, expected {LEAST_EXPLAINED:.0%}",
            "more textures or texels, less smoothing, another method; or data that contradict themselves",
        )
    if verdict.misfit > max(LARGEST_MISFIT, MISFIT_TO_SCATTER * (verdict.scatter or 0)):
        agree = "" if verdict.scatter is None else f", while neighbouring samples agree to {verdict.scatter:.0%}"
        yield Finding(
            "misfit",
            f"the fit misses its own samples by {verdict.misfit:.0%} RMS{agree}, expected {LARGEST_MISFIT:.0%}",
            "more textures or texels, or a method that suits the material better",
        )
    if verdict.gap > LARGEST_GAP and held_out.log_mse > WORTH_A_GAP:
        yield Finding(
            "gap",
            f"the held-out error is {verdict.gap:.3g} times the training error, expected at most {LARGEST_GAP:g}",
            "fewer textures or texels, more smoothing, or more samples",
        )
    if not LEAST_PEAK <= verdict.peak <= 1 / LEAST_PEAK:
        yield Finding(
            "peak",
            f"the brightest samples come out at {verdict.peak:.3g} of their value, expected {LEAST_PEAK:g} or more",
            "larger textures (--size) for a highlight narrower than a texel, or less smoothing",
        )
    if verdict.cut > LARGEST_CUT:
        yield Finding(
            "positivity",
            f"{verdict.cut:.0%} of the values that are not zero come out cut at zero, expected {LARGEST_CUT:.0%}",
            "a larger --epsilon, or more terms",
        )
    if verdict.albedo > LARGEST_ALBEDO:
        yield Finding(
            "energy",
            f"the fit gives back {verdict.albedo:.3g} of the light at some angle, expected at most {LARGEST_ALBEDO:g}",
            "check the measurement's units and its grazing angles (homofact info)",
        )
    if settings.reciprocal and (verdict.data_reciprocity or 0) > LARGEST_RECIPROCITY:
        yield Finding(
            "reciprocity",
            f"samples and their swapped neighbours differ by {verdict.data_reciprocity:.0%} in the median,"
            f" expected {LARGEST_RECIPROCITY:.0%} of a reciprocal fit",
            "--no-reciprocal to follow the data, or a better measurement",
        )
    elif verdict.reciprocity > LARGEST_RECIPROCITY and (verdict.data_reciprocity or 0) <= LARGEST_RECIPROCITY:
        yield Finding(
            "reciprocity",
            f"the fit is not reciprocal by {verdict.reciprocity:.0%} (95th percentile),"
            f" expected {LARGEST_RECIPROCITY:.0%}",
            "--reciprocal, or a method that keeps it",
        )
    if (verdict.scatter or 0) > LARGEST_SCATTER:
        yield Finding(
            "scatter",
            f"neighbouring samples disagree by {verdict.scatter:.0%}, expected {LARGEST_SCATTER:.0%}",
            "noise, contradictory samples, a highlight between them, or an anisotropic material read as isotropic",
        )
    if noise is not None and noise > 3 * epsilon and noise > WORTH_A_FLOOR:
        yield Finding(
            "epsilon",
            f"dark samples scatter by {noise:.2g} of the mean and epsilon is {epsilon:.2g}",
            f"--epsilon {noise:.1g}, so that noise near zero does not steer the fit",
        )
    zeros = float((train.values == 0).double().mean(0).max())
    if zeros > LARGEST_ZEROS and epsilon < 1:
        yield Finding(
            "zeros",
            f"{zeros:.0%} of the samples are exactly zero in a channel, expected {LARGEST_ZEROS:.0%}",
            "a larger --epsilon, or a measurement whose negative values were not cut",
        )
    empty = holes(train)["share"] if train.isotropic else 0.0
    if empty > LARGEST_HOLES:
        yield Finding(
            "coverage",
            f"{empty:.0%} of the pairs of directions hold no sample (homofact info), expected {LARGEST_HOLES:.0%}",
            "measure there; until then the fit is a guess in these places",
        )
    if verdict.outliers > OUTLIERS_RULE:
        yield Finding(
            "outliers",
            f"a few samples hold {verdict.outliers:.0%} of the squared error, expected {OUTLIERS_RULE:.0%}",
            "--robust if they are outliers, larger textures if they are the highlight",
        )
    if not train.isotropic and _azimuths(train) < SPREAD_OF_AZIMUTHS:
        yield Finding(
            "azimuth",
            "an anisotropic material was lit from one azimuth only",
            "measure other azimuths, or state that it is isotropic",
        )


def _azimuths(samples: Samples) -> float:
    """1 − |mean exp(2 i φ)| of the directions off the normal: 0 where all lie in one plane, near 1 all round."""
    directions = torch.cat((samples.wi, samples.wo))
    tilted = directions[directions[:, 2] < 0.99]
    if len(tilted) == 0:
        return 1.0
    double = 2 * torch.atan2(tilted[:, 1], tilted[:, 0])
    return 1 - math.hypot(float(torch.cos(double).mean()), float(torch.sin(double).mean()))
