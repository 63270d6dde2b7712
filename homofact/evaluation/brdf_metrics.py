"""Error metrics of a reflectance against samples of another, beside the six of `evaluation.metrics`.

Each is one number and takes the same `EvaluatedPairs`; `metric_table` has their names, units and words. Means are over
samples and channels, each sample of weight 1, unless a docstring states otherwise. Two want another measure than that
of the samples' places:

* uniform on both hemispheres (`cosine_rms`): a sample counts weight / density, the density in solid angle
  that its sampling states in provenance["sampling"]["scheme"]: in discs, uniform in the parabolic disc, it
  falls like 1/(1 + cosθ)² (du dv = dω/(1 + cosθ)²); by cosine it is cosθ/π; a grid is one of the discs. Samples
  of a measurement state none: they count by their weights alone, and the number is one of that measurement.
* sinθi (`low_rms`), as published.

f is in sr⁻¹ without the cosine; θi is the light's angle, θo the viewer's, θh the half vector's, from the normal.
What is not defined (a band without samples, an albedo of a missing source) is NaN.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.pair_density import disc_shares, scheme_of, solid_angles
from homofact.brdf.quality.faults import ALBEDO_DEGREES, albedo
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.symmetry import light_azimuths, reciprocity_of
from homofact.evaluation.metrics import SixErrors, six_errors
from homofact.geometry.directions import normalize, to_spherical

THETA_BANDS = ((0, 30), (30, 60), (60, 75), (75, 90))
# Of the half vector: the highlight, its skirt, and what is mostly diffuse.
LOBE_BANDS = ((0, 10), (10, 30), (30, 90))
_ANGLES = math.cos(math.radians(80.0))
_FLOOR = 1e-3


@dataclass(frozen=True)
class EvaluatedPairs:
    """A reflectance, the samples that it is compared with, and the log transform of its fit.

    `source` is the source of the samples if it can be evaluated everywhere (albedo); else None.
    """

    reflectance: Reflectance
    samples: Samples
    transform: LogTransform
    source: Reflectance | None = None

    @cached_property
    def found(self) -> Tensor:
        """The reflectance's values (N, C) at the samples' places, in sr⁻¹."""
        return self.reflectance.evaluate(self.samples.wi, self.samples.wo).to(self.samples.values)

    @property
    def expected(self) -> Tensor:
        """The samples' values (N, C) in sr⁻¹."""
        return self.samples.values

    @property
    def cos_i(self) -> Tensor:
        """cosθi (N,)."""
        return self.samples.wi[:, 2]

    @property
    def cos_o(self) -> Tensor:
        """cosθo (N,)."""
        return self.samples.wo[:, 2]

    @cached_property
    def six(self) -> SixErrors:
        """The six metrics of the thesis."""
        return six_errors(self.found, self.expected, self.transform, disc_shares(self.samples))

    @cached_property
    def log_differences(self) -> Tensor:
        """log(1 + f̂ cosθi) − log(1 + f cosθi), (N, C)."""
        cosine = self.cos_i[:, None]
        return torch.log1p(self.found * cosine) - torch.log1p(self.expected * cosine)


def male(judged: EvaluatedPairs) -> float:
    """Return mean absolute logarithmic error: mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| (Sztrajman et al. 2021)."""
    return float(judged.log_differences.abs().mean())


def stated_density(samples: Samples) -> str:
    """In words, what a mean over samples is over, for `cosine_rms`."""
    scheme = scheme_of(samples)
    if scheme is not None:
        return f"uniform on both hemispheres, each sample over the density of its drawing ({scheme})"
    return "over the places of the measurement by its own weights, no density being stated"


def uniform_weights(samples: Samples) -> Tensor:
    """Return what each sample counts (N,), sum 1, for a mean over both hemispheres as the module's head says."""
    weights = samples.weights if scheme_of(samples) is None else solid_angles(samples)
    return weights / weights.sum()


def cosine_rms(judged: EvaluatedPairs) -> float:
    """Cosine-weighted RMS √mean((f − f̂)² cos²θi) over directions uniform on both hemispheres, in sr⁻¹.

    Ngan, Durand and Matusik 2005 and Wang et al. 2004; the measure is the module head's.
    """
    squared = ((judged.found - judged.expected) * judged.cos_i[:, None]) ** 2
    return float((squared.mean(1) * uniform_weights(judged.samples)).sum().sqrt())


def cube_root_rms(judged: EvaluatedPairs) -> float:
    """√mean((((f − f̂) cosθi)²)^⅓), in sr⁻⅓ (Fores, Ferwerda and Gu 2012).

    The root is read as that of every squared difference, under the mean: outside it the order of fits would be
    that of the RMS itself, and the highlight would not be damped.
    """
    squared = ((judged.found - judged.expected) * judged.cos_i[:, None]) ** 2
    return float((squared ** (1 / 3)).mean().sqrt())


def low_rms(judged: EvaluatedPairs) -> float:
    """RMS of log(1 + f cosθi) − log(1 + f̂ cosθi), each sample weighted by sinθi (Löw et al. 2012).

    The sine is the solid angle of a grid of equal angles; it is applied whatever the sampling. NaN where all
    light comes along the normal.
    """
    sine = torch.sin(to_spherical(judged.samples.wi)[0])
    total = float(sine.sum())
    if total <= 0:
        return math.nan
    return math.sqrt(float(((judged.log_differences**2).mean(1) * sine).sum()) / total)


def log_rms_80(judged: EvaluatedPairs) -> float:
    """logRMS80: RMS of log((f c + 1e-3)/(f̂ c + 1e-3)), c = max(cosθi cosθo, 1e-3), both angles under 80°.

    NaN where no sample is.
    """
    inside = (judged.cos_i > _ANGLES) & (judged.cos_o > _ANGLES)
    if not bool(inside.any()):
        return math.nan
    c = (judged.cos_i * judged.cos_o).clamp_min(_FLOOR)[inside, None]
    ratio = torch.log(judged.found[inside] * c + _FLOOR) - torch.log(judged.expected[inside] * c + _FLOOR)
    return float((ratio**2).mean().sqrt())


def reciprocity(judged: EvaluatedPairs) -> float:
    """95th percentile of |f(ωi, ωo) − f(ωo, ωi)| over their mean, of the fit alone (`brdf.quality.faults`)."""
    return reciprocity_of(judged.reflectance)["p95"]


def largest_albedo(judged: EvaluatedPairs) -> float:
    """Return the largest directional-hemispherical albedo ∫ f̂ cosθo dωo of the fit, over channels and θi of 0…75°.

    By a quadrature over half vectors (`brdf.quality.faults.albedo`); anisotropic ones are lit along x and along y.
    """
    return max(float(values.max()) for values in _albedos(judged.reflectance, judged.samples.isotropic))


def energy_above_one(judged: EvaluatedPairs) -> float:
    """By how much `largest_albedo` exceeds 1; 0 where it does not."""
    return max(largest_albedo(judged) - 1.0, 0.0)


def albedo_error(judged: EvaluatedPairs) -> float:
    """The largest |albedo of the fit − albedo of the source| over the same angles and channels; NaN without source."""
    if judged.source is None:
        return math.nan
    isotropic = judged.samples.isotropic
    pairs = zip(_albedos(judged.reflectance, isotropic), _albedos(judged.source, isotropic), strict=True)
    return max(float((mine - theirs).abs().max()) for mine, theirs in pairs)


def band_error(low: float, high: float, of: str = "theta_i") -> Callable[[EvaluatedPairs], float]:
    """Return `male` of the samples with low ≤ θ < high in degrees, θ that of the light or ("theta_h") the half vector.

    The last band holds 90° itself. NaN where it holds no sample.
    """

    def error(judged: EvaluatedPairs) -> float:
        direction = judged.samples.wi if of == "theta_i" else normalize(judged.samples.wi + judged.samples.wo)
        degrees = to_spherical(direction)[0] * (180 / math.pi)
        inside = (degrees >= low) & ((degrees < high) | (high >= 90))
        return float(judged.log_differences[inside].abs().mean()) if bool(inside.any()) else math.nan

    return error


def _albedos(reflectance: Reflectance, isotropic: bool) -> list[Tensor]:
    azimuths = light_azimuths(isotropic)
    return [albedo(reflectance, angle, azimuth) for angle in ALBEDO_DEGREES for azimuth in azimuths]
