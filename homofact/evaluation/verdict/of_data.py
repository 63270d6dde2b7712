"""What is odd in the data, and what nobody measured: no setting of a fit mends it, some make the best of it."""

import math
from collections.abc import Iterator, Sequence

import torch

from homofact.brdf.quality.coverage import holes
from homofact.brdf.quality.suspicion.check import Suspicion
from homofact.brdf.samples import Samples
from homofact.errors import Advice
from homofact.evaluation.verdict.finding import About, Finding, Grade
from homofact.evaluation.verdict.of_fit import LARGEST_ALBEDO, LARGEST_ASYMMETRY, floor_of
from homofact.evaluation.verdict.verdict import DataFigures, LightFigures, Verdict

LARGEST_SCATTER = 0.2
WORTH_A_FLOOR = 1e-3
WELL_MET = 0.0025  # held-out log MSE, an RMS of 5%: nothing in such data stood in the fit's way
LARGEST_DARK = 0.01
LARGEST_BLACK = 0.05  # of the light of a white surface
LARGEST_OUTLIERS = 0.02
LARGEST_DIFFERENCE = 0.05
RING_OFF = 0.1
LARGEST_CLIPPED = 0.003
# To 1, from where on a suspicion is said aloud. Clean files sorted by angle drift up to hundreds to 1; what coarse
# levels do to the light shows in what is explained.
SURE_ODDS = 80.0
OTHER_ODDS = {"drift-in-time": 1000.0, "drift-with-angle": 1000.0, "quantised": math.inf}
_SEEN_BY_LIGHT = ("zeros", "ring", "clipped")  # findings of their own, with the light that they concern
LARGEST_HOLES, MOSTLY_HOLES = 0.3, 0.6
LARGEST_UNMEASURED, MUCH_UNMEASURED = 0.03, 0.05
LARGEST_UNRESOLVED = 0.5
STEEPEST = 0.5
LEAST_DETERMINED, HARDLY_DETERMINED = 0.5, 0.25
SPREAD_OF_AZIMUTHS = 0.2


def oddities_of_the_data(verdict: Verdict, epsilon: float, held_out_log_mse: float) -> Iterator[Finding]:
    """The findings about the samples of a fit with an ε, from its figures."""
    # What was met nonetheless stood in no fit's way.
    met = not held_out_log_mse > WELL_MET
    yield from _source(verdict.light)
    yield from _noise(verdict.data, epsilon, met)
    yield from _cut_off(verdict.data, epsilon)
    yield from _contradictions(verdict.data, met)


def _source(light: LightFigures) -> Iterator[Finding]:
    """A source that is not reciprocal, or reflects more light than comes in."""
    own = light.data_reciprocity or 0
    if own > LARGEST_ASYMMETRY and light.reciprocity < own / 2:
        yield _finding(
            "reciprocity",
            own,
            f"{own:.0%} of the light changes where light and viewer are swapped, expected {LARGEST_ASYMMETRY:.0%} of a"
            f" reciprocal fit{floor_of(light)}",
            "follow the data, or measure again",
            Advice("reciprocal", False),
        )
    if light.source_albedo is not None and light.source_albedo > LARGEST_ALBEDO:
        yield _finding(
            "energy",
            light.source_albedo - 1,
            f"the source's directional albedo is {light.source_albedo:.3g} at some angle, expected at most"
            f" {LARGEST_ALBEDO:g}",
            "check its units and its grazing angles (homofact info)",
        )


def _noise(data: DataFigures, epsilon: float, met: bool) -> Iterator[Finding]:
    """Samples that scatter."""
    if (data.scatter or 0) > LARGEST_SCATTER and not met:
        scatter = data.scatter or 0
        yield _finding(
            "scatter",
            # A mean of logarithms lies under the mean by so much.
            1 - math.exp(-(scatter**2) / 2),
            f"neighbouring samples disagree by {scatter:.0%}, expected {LARGEST_SCATTER:.0%}",
            "noise, contradictory samples, a highlight between them, or an anisotropic material read as isotropic",
        )
    noise = data.noise or 0
    if noise > 3 * epsilon and noise > WORTH_A_FLOOR and not met:
        yield _finding(
            "epsilon",
            None,
            f"dark samples scatter by {noise:.2g} of the mean and epsilon is {epsilon:.2g}",
            "an epsilon at the noise, so that what is near zero does not steer the fit",
            Advice("epsilon", float(f"{noise:.1g}")),
        )


def _cut_off(data: DataFigures, epsilon: float) -> Iterator[Finding]:
    """Values that were cut at zero, or at the end of the detector's range."""
    if data.gamut > LARGEST_DARK:
        yield _finding(
            "gamut",
            None,
            f"{data.gamut:.0%} of the samples are cut at zero in a channel, since their colour lies outside sRGB",
            "fit the spectrum, or luminance alone",
            Advice("channels", "spectral"),
        )
    elif (data.dark > LARGEST_DARK or data.black > LARGEST_BLACK) and epsilon < 1:
        yield Finding(
            "zeros",
            About.DATA,
            data.dark,
            f"{data.zeros:.1%} of the samples are exactly zero in a channel, where {data.dark:.1%} of its light"
            f" should be by their neighbours, expected {LARGEST_DARK:.0%}",
            "a larger epsilon, or a measurement whose negative values were not cut",
            Advice("epsilon", 0.1),
            # Nothing is black in so many directions: how much was cut off there nobody knows.
            least=Grade.VISIBLE if data.black > LARGEST_BLACK else Grade.SLIGHT,
        )
    if data.clipped > LARGEST_CLIPPED:
        yield Finding(
            "clipped",
            About.DATA,
            data.clipped,
            f"{data.clipped:.1%} of the light of a channel is at samples that share its largest value, expected"
            f" {LARGEST_CLIPPED:.1%}",
            "the detector was at its end: what is brighter is not known; measure with a shorter exposure, or take the"
            " values as bounds",
            Advice("clipped", "found"),
            # How much more there was nobody knows.
            least=Grade.VISIBLE,
        )


def _contradictions(data: DataFigures, met: bool) -> Iterator[Finding]:
    """Samples that stand against the others."""
    if data.outliers > LARGEST_OUTLIERS and not met:
        yield _finding(
            "outliers",
            data.outliers,
            f"a few samples stand out by {data.outliers:.0%} of the light, expected {LARGEST_OUTLIERS:.0%}",
            "robust weights if they are outliers, larger textures if they are the highlight",
            Advice("robust", True),
        )
    if data.repeated > LARGEST_DIFFERENCE:
        yield _finding(
            "repeated",
            data.repeated,
            f"samples of the same directions differ by {data.repeated:.0%} of the light, expected"
            f" {LARGEST_DIFFERENCE:.0%}",
            "merge repeated measurements, or find out which is right",
        )
    if data.ring_where and abs(data.ring - 1) > RING_OFF and not met:
        yield _finding(
            "ring",
            abs(data.ring - 1),
            f"the samples at {data.ring_where} hold {data.ring:.3g} of the light that those beside them"
            f" lead to expect, expected 1 within {RING_OFF:.0%}",
            "a ring that was measured with another gain, or in a shadow: leave it out, or correct it",
            Advice("calibrate", "rings"),
        )


def suspected(suspicions: Sequence[Suspicion], rounded: float = 0.0) -> Iterator[Finding]:
    """The findings about units, conventions and the instrument, from what is suspected of a measurement's samples.

    `rounded` is the share of the light that levels miss, which says what those of `quantised` matter.
    """
    for suspicion in suspicions:
        if suspicion.name in _SEEN_BY_LIGHT:
            continue
        sure = OTHER_ODDS.get(suspicion.name, SURE_ODDS)
        yield Finding(
            suspicion.name,
            About.DATA,
            rounded if suspicion.name == "quantised" else None,
            f"{suspicion.words}, odds of {min(suspicion.odds, 1e6):,.0f} to 1",
            f"{suspicion.remedy} if that is so",
            least=Grade.VISIBLE if suspicion.odds >= sure else Grade.SLIGHT,
        )


def unknowns(verdict: Verdict, train: Samples) -> Iterator[Finding]:
    """The findings about what was not measured, so that smoothing decides it."""
    empty = holes(train)["share"] if train.isotropic else 0.0
    if verdict.coverage.unmeasured > LARGEST_UNMEASURED or empty > LARGEST_HOLES:
        also = f"; {empty:.0%} of the pairs of directions hold no sample" if empty > LARGEST_HOLES else ""
        much = verdict.coverage.unmeasured > MUCH_UNMEASURED or empty > MOSTLY_HOLES
        yield _unknown(
            "coverage",
            verdict.coverage.unmeasured,
            f"{verdict.coverage.unmeasured:.0%} of the fit's light is at directions that were not measured, expected"
            f" {LARGEST_UNMEASURED:.0%}{also}",
            "measure there; until then the fit is a guess in these places",
            # The share is the fit's own guess, of what may be twice as much.
            Grade.VISIBLE if much else Grade.SLIGHT,
        )
    if verdict.system.determined is not None and verdict.system.determined < LEAST_DETERMINED:
        yield _unknown(
            "determined",
            None,
            f"{verdict.system.determined:.0%} of the texels are determined by samples, the rest by smoothing, expected"
            f" {LEAST_DETERMINED:.0%}",
            "smaller textures, fewer of them, or more samples",
            Grade.VISIBLE if verdict.system.determined < HARDLY_DETERMINED else Grade.SLIGHT,
        )
    yield from _between(verdict)
    if not train.isotropic and _azimuths(train) < SPREAD_OF_AZIMUTHS:
        yield _unknown(
            "azimuth",
            1.0,
            "an anisotropic material was lit from one azimuth only",
            "measure other azimuths, or state that it is isotropic",
        )


def _between(verdict: Verdict) -> Iterator[Finding]:
    """A highlight whose top no sample shows."""
    noise, coverage = verdict.data.scatter or 0, verdict.coverage
    # Of noisy samples the brightest exceed their neighbours too.
    if coverage.unresolved > LARGEST_UNRESOLVED + noise:
        found = (
            f"the brightest samples lose {coverage.unresolved:.0%} of their value to the next ones, expected"
            f" {LARGEST_UNRESOLVED:.0%}: the highlight stands between samples"
        )
    elif coverage.rising > STEEPEST:
        found = (
            f"the samples nearest to the mirror direction still rise as θh^-{coverage.rising:.2g}, expected at most"
            f" θh^-{STEEPEST:g}: the top of the highlight stands where there are none"
        )
    else:
        return
    remedy = "measure it more finely; how bright it is here is a matter of where samples fell"
    yield _unknown("sampling", None, found, remedy, Grade.VISIBLE)


def _finding(name: str, light: float | None, found: str, remedy: str, advice: Advice | None = None) -> Finding:
    return Finding(name, About.DATA, light, found, remedy, advice)


def _unknown(name: str, light: float | None, found: str, remedy: str, least: Grade = Grade.SLIGHT) -> Finding:
    return Finding(name, About.UNKNOWN, light, found, remedy, least=least)


def _azimuths(samples: Samples) -> float:
    """1 − |mean exp(2 i φ)| of the directions off the normal: 0 where all lie in one plane, near 1 all round."""
    directions = torch.cat((samples.wi, samples.wo))
    tilted = directions[directions[:, 2] < 0.99]
    if len(tilted) == 0:
        return 1.0
    double = 2 * torch.atan2(tilted[:, 1], tilted[:, 0])
    return 1 - math.hypot(float(torch.cos(double).mean()), float(torch.sin(double).mean()))
