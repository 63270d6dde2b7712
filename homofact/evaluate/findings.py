"""What a verdict says: the figures of every check, and which of them are off.

Each check has a threshold, named here, and a remedy of one line; `docs/stability.md` shows which check answers to which
trouble. Those of a fit's light (albedo, highlight) know only sources that can be asked everywhere.
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import torch

from homofact.brdf.coverage import holes
from homofact.brdf.samples import Samples
from homofact.errors import Status
from homofact.evaluate.metrics import SixErrors
from homofact.methods.fitting import Method

LARGEST_CONDITION = 1e12
LEAST_DETERMINED = 0.5
LARGEST_GAP = 2.0
WORTH_A_GAP = 1e-3  # held-out log MSE under which a gap is of no concern
LARGEST_RECIPROCITY = 0.1
LARGEST_ALBEDO = 1.02
ALBEDO_OFF = 0.1  # of the source's, as a share
HIGHLIGHT_OFF = 0.1
WORTH_NAMING = 0.01  # a source's own floor, relative RMS
LEAST_ACROSS = 0.5  # texels that the half width of a highlight takes
LARGEST_CUT = 0.05
LEAST_EXPLAINED = 0.9
LEAST_PEAK = 0.5
OUTLIERS_RULE = 0.5
LARGEST_SCATTER = 0.2
WORTH_A_FLOOR = 1e-3
LARGEST_MISFIT = 0.2
MISFIT_TO_SCATTER = 3.0
LARGEST_ZEROS = 0.01
LARGEST_HOLES = 0.3
SPREAD_OF_AZIMUTHS = 0.2


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
    albedo : largest ∫ f cosθ dω of the fit over channels, `brdf.faults.ALBEDO_DEGREES` and 85°.
    albedo_ratio, highlight : fit over source, of the worst channel and angle and of the highlight (`evaluate.energy`);
        None, as `floor`, where the source is known at its samples alone.
    texels_across : half width of the source's highlight in texels of the finest texture; None where there is none.
    floor : relative RMS by which the source's own reciprocal part misses it.
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
    albedo_ratio: float | None
    highlight: float | None
    texels_across: float | None
    floor: float | None
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


def findings(
    verdict: Verdict,
    settings: Method,
    train: Samples,
    epsilon: float,
    noise: float | None,
    held_out: SixErrors,
) -> Iterator[Finding]:
    """What is off in the figures of a fit of `train`, the gravest first.

    `epsilon` is that of its log transform, `noise` the scatter of dark samples over the mean, None where not known.
    """
    floor = _floor(verdict)
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
            f"{verdict.determined:.0%} of the texels are determined by samples, the rest by smoothing,"
            f" expected {LEAST_DETERMINED:.0%}",
            "smaller textures (--size), fewer of them, or more samples",
        )
    if not verdict.explained >= LEAST_EXPLAINED:
        yield Finding(
            "explained",
            f"{max(verdict.explained, 0):.0%} of the held-out variation is explained, expected {LEAST_EXPLAINED:.0%}"
            f"{floor}",
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
    if verdict.albedo_ratio is not None and not abs(verdict.albedo_ratio - 1) <= ALBEDO_OFF:
        yield Finding(
            "albedo",
            f"at some angle a channel reflects {verdict.albedo_ratio:.3g} of the source's light,"
            f" expected 1 within {ALBEDO_OFF:.0%}",
            "more textures or texels, or projections that follow the peak, which holds most of a gloss's light",
        )
    if verdict.highlight is not None and not abs(verdict.highlight - 1) <= HIGHLIGHT_OFF:
        yield Finding(
            "highlight",
            f"the brightest directions hold {verdict.highlight:.3g} of the source's light,"
            f" expected 1 within {HIGHLIGHT_OFF:.0%}",
            "larger textures (--size), a warp or samples within the highlight, less smoothing",
        )
    if verdict.texels_across is not None and verdict.texels_across < LEAST_ACROSS:
        factor = LEAST_ACROSS / max(verdict.texels_across, 1e-6)
        wanted = (
            f"textures {factor:.2g} times as wide hold it: --size {math.ceil(settings.size * factor)}, or more --bytes"
        )
        if verdict.texels_across < LEAST_ACROSS / 16:
            wanted = "no texture of a usual size holds it: draw it as a mirror beside the fit"
        yield Finding(
            "narrow",
            f"half of the highlight's height lies within {verdict.texels_across:.2g} texels of the finest texture,"
            f" expected {LEAST_ACROSS:g}",
            wanted,
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
            f"the directional albedo is {verdict.albedo:.3g} at some angle, expected at most {LARGEST_ALBEDO:g}",
            "check the measurement's units and its grazing angles (homofact info)",
        )
    # The floor is of half the difference of both orders.
    by_samples, by_source = verdict.data_reciprocity or 0, 2 * (verdict.floor or 0)
    own = max(by_samples, by_source)
    if settings.reciprocal and own > LARGEST_RECIPROCITY:
        found = f"the source's two orders of directions differ by {by_source:.0%} RMS"
        if by_samples > LARGEST_RECIPROCITY:
            found = f"samples and their swapped neighbours differ by {by_samples:.0%} in the median"
        yield Finding(
            "reciprocity",
            f"{found}, expected {LARGEST_RECIPROCITY:.0%} of a reciprocal fit{floor}",
            "--no-reciprocal to follow the data, or a better measurement",
        )
    elif verdict.reciprocity > LARGEST_RECIPROCITY and own <= LARGEST_RECIPROCITY:
        yield Finding(
            "reciprocity",
            f"the fit is not reciprocal by {verdict.reciprocity:.0%} (95th percentile),"
            f" expected {LARGEST_RECIPROCITY:.0%}{floor}",
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


def _floor(verdict: Verdict) -> str:
    """What the source's own lack of reciprocity leaves to a reciprocal fit, where it is worth a word."""
    if verdict.floor is None or not verdict.floor >= WORTH_NAMING:
        return ""
    return f" (no reciprocal fit comes nearer to this source than {verdict.floor:.0%} RMS)"


def _azimuths(samples: Samples) -> float:
    """1 − |mean exp(2 i φ)| of the directions off the normal: 0 where all lie in one plane, near 1 all round."""
    directions = torch.cat((samples.wi, samples.wo))
    tilted = directions[directions[:, 2] < 0.99]
    if len(tilted) == 0:
        return 1.0
    double = 2 * torch.atan2(tilted[:, 1], tilted[:, 0])
    return 1 - math.hypot(float(torch.cos(double).mean()), float(torch.sin(double).mean()))
