"""Make the findings of a verdict: statements about the fit and its samples, with the expected values."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import torch

from homofact.brdf.quality.coverage import holes
from homofact.brdf.quality.suspicion.check import Suspicion
from homofact.brdf.samples import Samples
from homofact.errors import Advice, Status
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.bar.features import RANGE_MARGIN
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.verdict.finding import About, Finding
from homofact.factor.fitted import Fitted
from homofact.methods.method import Method

OFF = 0.05  # light over the source's: from here on it is noted
LEAST_EXPLAINED = 0.9
LARGEST_ALBEDO = 1.02
LARGEST_ASYMMETRY = 0.05
LEAST_ACROSS = 0.5  # texels that the half width of a highlight takes
LARGEST_HOLES = 0.3
LARGEST_GAP = (
    2.0  # held-out over training error: above it fits of all samples are better (scripts/accuracy/few_rows.py)
)
_WORTH_A_FLOOR = 1e-3
_WORTH_NAMING = 0.01  # a source's own floor, relative RMS
_WORTH_PLACING = 0.02  # of the held-out light
_SPREAD_OF_AZIMUTHS = 0.2
_SEEN_BY_LIGHT = ("zeros", "ring", "clipped")  # findings of their own
_BYTES_OF_A_VALUE = 4
_MISPLACED_BY_A_BAD_FIT = 0.2  # of the held-out light: from here on the fit itself leaves rings too dark or too bright


@dataclass(frozen=True)
class Noted:
    """The inputs of the checks that make findings."""

    fitted: Fitted
    figures: Figures
    settings: Method
    train: Samples
    status: Status
    suspicions: tuple[Suspicion, ...] = ()
    look: Look | None = None

    @property
    def epsilon(self) -> float:
        """The ε of the fit's log transform."""
        return self.fitted.transform.epsilon

    def was_followed(self, advice: Advice) -> bool:
        """Return whether the fit, or the import of its samples, already used the setting of an advice."""
        if advice.setting == "calibrate":
            return advice.value in (self.train.provenance.get("gains") or {})
        return vars(self.settings).get(advice.setting) == advice.value

    @property
    def whose(self) -> str:
        """The owner of the logarithms whose explained variance a finding states: "held-out" or "source's"."""
        return "held-out" if self.figures.light.source_albedo is None else "source's"

    @property
    def bound(self) -> str:
        """Return "at most " or "at least " for a source of samples; "" without a ratio or if evaluated everywhere.

        Of samples, `light.off` is moved towards 1 by two standard errors, so it is a bound.
        """
        light = self.figures.light
        if light.off is None or light.source_albedo is not None:
            return ""
        return "at most " if light.off < 1 else "at least "

    @property
    def floor(self) -> str:
        """Text with the smallest error of any reciprocal fit to this source; "" if it is negligible."""
        floor = self.figures.light.floor
        if floor is None or not floor >= _WORTH_NAMING:
            return ""
        return f" (no reciprocal fit comes nearer to this source than {floor:.0%} RMS of f cosθi cosθo)"


@dataclass(frozen=True)
class _Note:
    """A finding that is made where `figure` is above `most`; words are formatted with {value}, {most} and {noted}.

    `figure` gives None where there is nothing to say, and `advice` the setting to try.
    """

    name: str
    about: About
    figure: Callable[[Noted], float | None]
    most: float
    found: str
    remedy: str
    advice: Callable[[Noted, float], Advice | None] = lambda noted, value: None
    feature: str = ""

    def finding(self, noted: Noted) -> Finding | None:
        """Return the finding; None where there is none."""
        value = self.figure(noted)
        if value is None or value <= self.most:
            return None
        found = self.found.format(value=value, most=self.most, noted=noted)
        advice = self.advice(noted, value)
        if advice is not None and noted.was_followed(advice):
            advice = None
        return Finding(self.name, self.about, found, self.remedy, advice, self.feature)


def _larger(noted: Noted, value: float) -> Advice | None:
    """Nothing where the method has no such setting."""
    return _wider(noted, 2) if vars(noted.settings).get("bytes") is None else _twice_the_bytes(noted)


def _twice_the_bytes(noted: Noted) -> Advice | None:
    """None where a measurement has fewer samples than these bytes have texels: smoothing would fill the others."""
    wanted = 2 * vars(noted.settings)["bytes"]
    texels = wanted / (_BYTES_OF_A_VALUE * len(noted.train.channels))
    return None if noted.figures.reading is not None and texels > len(noted.train) else Advice("bytes", wanted)


def _wider(noted: Noted, times: float) -> Advice | None:
    """So many times as many texels on a side: more bytes where these were given, beside which a size is not read."""
    own = vars(noted.settings)
    if own.get("bytes") is not None:
        return Advice("bytes", math.ceil(own["bytes"] * times**2))
    return Advice("size", math.ceil(own["size"] * times)) if "size" in own else None


def _more_textures(noted: Noted, value: float) -> Advice | None:
    """Nothing where the method has no such setting: McCool's fixed projections, a model without textures."""
    own = vars(noted.settings)
    if own.get("bytes") is not None:
        return _twice_the_bytes(noted)
    return Advice("textures", own["textures"] + 1) if "textures" in own else None


def _set(name: str, value: bool | float | str) -> Callable[[Noted, float], Advice]:
    return lambda noted, found: Advice(name, value)


def _off(ratio: float | None) -> float | None:
    return None if ratio is None else abs(ratio - 1) if not math.isnan(ratio) else math.inf


def _shows_rings(noted: Noted) -> bool:
    """Whether a ring stands out under a fit that is otherwise near enough to its samples to show one.

    A tilt that is left in makes rings too bright and too dark, so it is named instead (`of_the_tilt`).
    """
    near = noted.figures.errors.misplaced < _MISPLACED_BY_A_BAD_FIT
    return bool(noted.figures.data.ring_where) and near and not _tilt_left_in(noted)


def _tilt_left_in(noted: Noted) -> Mapping[str, Any]:
    """The record (`TiltFinding.record`) of a tilt of the sample that was not undone; empty if there is none."""
    tilt = noted.train.provenance.get("tilt") or {}
    return tilt if tilt.get("left_in") else {}


def _narrow(noted: Noted) -> float | None:
    across = noted.figures.light.texels_across
    return None if across is None else LEAST_ACROSS / max(across, 1e-6)


def _own_asymmetry(noted: Noted) -> float | None:
    light = noted.figures.light
    own = light.data_reciprocity or 0.0
    return own if light.reciprocity < own / 2 else None


def _fit_asymmetry(noted: Noted) -> float | None:
    light = noted.figures.light
    # A search that decides by itself has asked samples that nobody else can tell more of.
    by_the_data = light.floor is None and getattr(noted.settings, "reciprocal", False) is None
    return None if by_the_data else light.reciprocity - (light.data_reciprocity or 0.0)


def _below_epsilon(noted: Noted) -> float | None:
    noise = noted.figures.data.noise or 0.0
    return noise if noise > 3 * noted.epsilon else None


def _dark(noted: Noted) -> float | None:
    data = noted.figures.data
    return max(data.dark, data.black / 5) if data.gamut <= _ZEROS and noted.epsilon < 1 else None


def _too_bright(noted: Noted) -> float | None:
    """The largest albedo of the fit; None where the source's own is too large."""
    light = noted.figures.light
    return light.albedo if (light.source_albedo or 1) <= LARGEST_ALBEDO else None


def _beyond(noted: Noted) -> bool:
    """Whether the largest albedo is at an angle that was not measured."""
    return noted.figures.light.albedo_at > noted.figures.coverage.highest + RANGE_MARGIN


def _gap(noted: Noted) -> float | None:
    """Held-out over training error; None if it costs next to no light, or the source can be evaluated everywhere."""
    errors = noted.figures.errors
    worth = noted.figures.reading is not None and errors.is_held_out and errors.misplaced > _WORTH_PLACING
    return errors.gap if worth else None


def _nothing_held_out(noted: Noted) -> float | None:
    return None if noted.figures.reading is None else float(not noted.figures.errors.is_held_out)


def _between(noted: Noted) -> float | None:
    return noted.figures.coverage.unresolved - (noted.figures.data.scatter or 0.0)


def _one_azimuth(noted: Noted) -> float | None:
    """How little an anisotropic material's azimuths are spread."""
    return None if noted.train.isotropic else 1 - _azimuths(noted.train)


_F, _D, _U = About
_ZEROS = 0.01
_NOTES = (
    _Note("status", _F, lambda n: float(n.status in (Status.INTERRUPTED, Status.FALLBACK)), 0,
          "the fit ended with status {noted.status.value}",
          "fit again: it was interrupted, or its system was singular"),
    _Note("condition", _F, lambda n: n.figures.system.condition, 1e12,
          "the system's condition number is {value:.1e}, expected at most {most:.0e}",
          "more smoothing, fewer textures or more samples", _set("smoothing", 1e-3)),
    _Note("light", _F, lambda n: _off(n.figures.light.off), OFF,
          "the fit reflects {noted.bound}{noted.figures.light.off:.3g} times the source's light in"
          " {noted.figures.light.off_where}, expected 1 within {most:.0%}", "more textures or texels", _larger, "off"),
    _Note("highlight", _F, lambda n: _off(n.figures.light.highlight), OFF,
          "the fit reflects {noted.figures.light.highlight:.3g} times the source's light in the brightest directions,"
          " expected 1 within {most:.0%}",
          "larger textures, samples within the highlight, less smoothing", _larger, "top"),
    _Note("narrow", _F, _narrow, 1.0,
          "half of the highlight's height lies within a texel or less: textures {value:.2g} times as wide hold it",
          "more bytes, or a mirror drawn beside the fit", lambda n, v: _wider(n, v) if v < 16 else None),
    _Note("explained", _F, lambda n: 1 - n.figures.errors.explained, 1 - LEAST_EXPLAINED,
          "{value:.0%} of the variation of the {noted.whose} logarithms is not explained, expected at most {most:.0%};"
          " {noted.figures.errors.misplaced:.0%} of the held-out light is misplaced{noted.floor}",
          "more textures or texels, another method; or data that contradict themselves", _more_textures, "unexplained"),
    _Note("held-out", _F, _gap, LARGEST_GAP,
          "the error of the held-out samples is {value:.2g} times that of the others, expected at most {most:g}: the"
          " fit lacks light that only these samples show, or follows single samples",
          "fit all samples, with no held-out error then", _set("held_out", 0), "gap"),
    _Note("positivity", _F, lambda n: n.figures.errors.cut, 0.01,
          "{value:.0%} of the held-out light is cut at zero, expected at most {most:.0%}",
          "a larger epsilon, or more terms"),
    _Note("energy", _F, lambda n: _too_bright(n) if _beyond(n) else None, LARGEST_ALBEDO,
          "the fit's directional albedo is {value:.3g} at θi = {noted.figures.light.albedo_at:g}°, expected at most"
          " {most:g}; the largest measured angle of light or view is {noted.figures.coverage.highest:.0f}°",
          "measure larger angles, or do not rely on the fit there", feature="energy"),
    _Note("energy", _F, lambda n: None if _beyond(n) else _too_bright(n), LARGEST_ALBEDO,
          "the fit's directional albedo is {value:.3g} at θi = {noted.figures.light.albedo_at:g}°, expected at most"
          " {most:g}", "check the measurement's units and its grazing angles (homofact info)", feature="energy"),
    _Note("step", _F, lambda n: abs(math.log(n.figures.light.step)), math.log(1.5),
          "the ratio of the fit's directional albedos is {noted.figures.light.step:.3g}"
          " ({noted.figures.light.step_where}), expected 1 within a factor of 1.5",
          "add samples or smoothing if samples are few there; if some are wrong, use robust weights",
          _set("robust", True), "step"),
    _Note("reciprocity", _F, _fit_asymmetry, LARGEST_ASYMMETRY,
          "{value:.0%} more of the fit's light than of the data's changes where light and viewer are swapped, expected"
          " {most:.0%}", "a reciprocal fit, or a method that keeps it", _set("reciprocal", True), "reciprocity"),
    _Note("reciprocity", _D, _own_asymmetry, LARGEST_ASYMMETRY,
          "{value:.0%} of the light changes where light and viewer are swapped, expected at most"
          " {most:.0%}{noted.floor}",
          "follow the data, or measure again", _set("reciprocal", False), "data_reciprocity"),
    _Note("energy", _D, lambda n: n.figures.light.source_albedo, LARGEST_ALBEDO,
          "the source's directional albedo is {value:.3g} at some angle, expected at most {most:g}",
          "check its units and its grazing angles (homofact info)"),
    _Note("scatter", _D, lambda n: n.figures.data.scatter, 0.2,
          "neighbouring samples disagree by {value:.0%}, expected at most {most:.0%}",
          "noise, contradictory samples, a highlight between them, or an anisotropic material read as isotropic",
          feature="scatter"),
    _Note("epsilon", _D, _below_epsilon, _WORTH_A_FLOOR,
          "dark samples scatter by {value:.2g} of the mean, over three times epsilon",
          "an epsilon at the noise, so that what is near zero does not steer the fit",
          lambda n, v: Advice("epsilon", float(f"{v:.1g}")), "noise"),
    _Note("gamut", _D, lambda n: n.figures.data.gamut, _ZEROS,
          "{value:.0%} of the samples are cut at zero in a channel, since their colour lies outside sRGB",
          "a fit of the spectrum would keep these colours, but export refuses it; to export, keep RGB",
          feature="zeros"),
    _Note("zeros", _D, _dark, _ZEROS,
          "{value:.1%} of a channel's light is missing at samples that are exactly zero, expected at most {most:.0%}",
          "a larger epsilon, or a measurement whose negative values were not cut", _set("epsilon", 0.1), "zeros"),
    _Note("clipped", _D, lambda n: n.figures.data.clipped, 0.003,
          "{value:.1%} of the light of a channel is at samples that share its largest value, expected at most"
          " {most:.1%}",
          "the detector was at its end: measure with a shorter exposure, or take the values as bounds",
          _set("clipped", "found"), "clipped"),
    _Note("outliers", _D, lambda n: n.figures.data.outliers, 0.02,
          "a few samples stand out by {value:.0%} of the light, expected at most {most:.0%}",
          "robust weights if they are outliers, larger textures if they are the highlight", _set("robust", True),
          "outliers"),
    _Note("repeated", _D, lambda n: n.figures.data.repeated, 0.05,
          "samples of the same directions differ by {value:.0%} of the light, expected at most {most:.0%}",
          "merge repeated measurements, or find out which is right", feature="repeated"),
    _Note("ring", _D, lambda n: _off(n.figures.data.ring) if _shows_rings(n) else None, 0.1,
          "the samples at {noted.figures.data.ring_where} hold {noted.figures.data.ring:.3g} of the light that those"
          " beside them lead to expect, expected 1 within {most:.0%}",
          "a ring that was measured with another gain, or in a shadow: leave it out, or correct it",
          _set("calibrate", "rings"), "ring"),
    _Note("coverage", _U, lambda n: n.figures.coverage.unmeasured, 0.03,
          "{value:.0%} of the fit's light leaves in directions without fitted samples nearby, expected at most"
          " {most:.0%}",
          "measure more directions, since the fit extrapolates there (homofact measure proposes some)",
          feature="unmeasured"),
    _Note("coverage", _U, lambda n: holes(n.train)["share"] if n.train.isotropic else None, LARGEST_HOLES,
          "{value:.0%} of the pairs of directions hold no sample, expected at most {most:.0%}",
          "measure more directions, since the fit extrapolates there (homofact measure proposes some)",
          feature="unmeasured"),
    _Note("held-out", _U, _nothing_held_out, 0,
          "no sample was held out: errors and limits are of samples that the fit has seen",
          "hold some out for an honest error"),
    _Note("determined", _U, lambda n: None if n.figures.system.determined is None else 1 - n.figures.system.determined,
          0.5, "{value:.0%} of the texels are determined by smoothing, not by samples, expected at most {most:.0%}",
          "smaller textures, fewer of them, or more samples"),
    _Note("sampling", _U, _between, 0.5,
          "the brightest samples lose {value:.0%} of their value to the next ones, expected at most {most:.0%}: the"
          " highlight stands between samples", "measure it more finely", feature="unresolved"),
    _Note("sampling", _U, lambda n: n.figures.coverage.rising, 0.5,
          "the samples nearest to the mirror direction still rise as θh^-{value:.2g}, expected at most θh^-{most:g}",
          "measure nearer to the mirror direction, since the top of the highlight has no samples",
          feature="rising"),
    _Note("azimuth", _U, _one_azimuth, 1 - _SPREAD_OF_AZIMUTHS,
          "an anisotropic material was lit from one azimuth only",
          "measure other azimuths, or state that it is isotropic"),
)  # fmt: skip


def of_the_figures(noted: Noted) -> Iterator[Finding]:
    """Yield a finding for each figure outside its expected range; only the first of each name and subject."""
    said: set[tuple[str, About]] = set()
    for note in _NOTES:
        finding = None if (note.name, note.about) in said else note.finding(noted)
        if finding is not None:
            said.add((finding.name, finding.about))
            yield finding


def of_the_suspicions(noted: Noted) -> Iterator[Finding]:
    """Yield findings for suspected units, conventions and instrument faults that have no finding of their own."""
    for each in noted.suspicions:
        if each.name not in _SEEN_BY_LIGHT:
            words = f"{each.words}, odds of {min(each.odds, 1e6):,.0f} to 1"
            remedy = f"if so, {each.remedy}; if you have checked that it is not, {Advice('dismiss', each.name)}"
            yield Finding(each.name, About.DATA, words, remedy, feature="odds")


def of_the_pictures(noted: Noted) -> Iterator[Finding]:
    """Yield findings for artefacts in pictures of the fit."""
    for artefact in () if noted.look is None else noted.look.artefacts:
        yield Finding(
            "artefact",
            About.FIT,
            f"{artefact.words}, which the source does not have",
            "larger textures or more of them, other projections",
            _larger(noted, 0.0),
        )


def of_the_tilt(noted: Noted) -> Iterator[Finding]:
    """Yield a finding for a specimen tilt that was detected in a measurement and not corrected."""
    if tilt := _tilt_left_in(noted):
        yield Finding("tilt", About.DATA, tilt["found"], tilt["effect"])


# Everything that notes something of a fit: what finds more things is added here.
NOTERS: tuple[Callable[[Noted], Iterable[Finding]], ...] = (
    of_the_pictures, of_the_figures, of_the_tilt, of_the_suspicions,
)  # fmt: skip


def _azimuths(samples: Samples) -> float:
    """1 − |mean exp(2 i φ)| of the directions off the normal: 0 where all lie in one plane, near 1 all round."""
    directions = torch.cat((samples.wi, samples.wo))
    tilted = directions[directions[:, 2] < 0.99]
    if len(tilted) == 0:
        return 1.0
    double = 2 * torch.atan2(tilted[:, 1], tilted[:, 0])
    return 1 - math.hypot(float(torch.cos(double).mean()), float(torch.sin(double).mean()))
