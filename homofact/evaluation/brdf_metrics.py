"""Error metrics that compare a reflectance with samples of another, in addition to the six of `evaluation.metrics`.

Each metric returns one number and takes an `EvaluatedPairs`; `metric_table` lists names, units and labels. Means are
over samples and channels, and every sample has weight 1, unless a docstring states otherwise. Two metrics weight the
directions differently:

* `cosine_rms` averages uniformly over both hemispheres. The weight of a sample is divided by its sampling density in
  solid angle, which follows from provenance["sampling"]["scheme"]. For `discs`, the density is proportional to 1/(1 +
  cosθ)², since du dv = dω/(1 + cosθ)²; the same applies to a grid in the discs. For cosine sampling it is cosθ/π.
  Samples of a measurement record no scheme. Only their weights count, so the result depends on how the measurement was
  sampled.
* `low_rms` weights samples by sinθi, as published.

f is in sr⁻¹ without the cosine; θi is the light's angle, θo the viewer's, θh the half vector's, from the normal. A
metric that is not defined (a band without samples, an albedo without a source) is NaN.
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

    `source` is the source of the samples if it can be evaluated everywhere, which `albedo_error` needs; else None.
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
    """Describe the distribution over which `cosine_rms` averages, for messages."""
    scheme = scheme_of(samples)
    if scheme is not None:
        return f"uniform on both hemispheres, each sample over the density of its drawing ({scheme})"
    return "over the places of the measurement by its own weights, no density being stated"


def uniform_weights(samples: Samples) -> Tensor:
    """Return sample weights (N,) with sum 1 for a uniform mean over both hemispheres (see the module docstring)."""
    weights = samples.weights if scheme_of(samples) is None else solid_angles(samples)
    return weights / weights.sum()


def cosine_rms(judged: EvaluatedPairs) -> float:
    """Cosine-weighted RMS √mean((f − f̂)² cos²θi) over directions uniform on both hemispheres, in sr⁻¹.

    Ngan, Durand and Matusik 2005 and Wang et al. 2004. The module docstring explains the weights of the samples.
    """
    squared = ((judged.found - judged.expected) * judged.cos_i[:, None]) ** 2
    return float((squared.mean(1) * uniform_weights(judged.samples)).sum().sqrt())


def cube_root_rms(judged: EvaluatedPairs) -> float:
    """√mean((((f − f̂) cosθi)²)^⅓), in sr⁻⅓ (Fores, Ferwerda and Gu 2012).

    The paper's cube root is applied to every squared difference before the mean. Applied after the mean, it would rank
    fits as the RMS does and would not damp the highlight.
    """
    squared = ((judged.found - judged.expected) * judged.cos_i[:, None]) ** 2
    return float((squared ** (1 / 3)).mean().sqrt())


def low_rms(judged: EvaluatedPairs) -> float:
    """RMS of log(1 + f cosθi) − log(1 + f̂ cosθi), each sample weighted by sinθi (Löw et al. 2012).

    sinθi is proportional to the solid angle of a grid cell with equal steps of angle; it is applied for every sampling
    scheme. NaN if all light comes along the normal.
    """
    sine = torch.sin(to_spherical(judged.samples.wi)[0])
    total = float(sine.sum())
    if total <= 0:
        return math.nan
    return math.sqrt(float(((judged.log_differences**2).mean(1) * sine).sum()) / total)


def log_rms_80(judged: EvaluatedPairs) -> float:
    """logRMS80: RMS of log((f c + 1e-3)/(f̂ c + 1e-3)), c = max(cosθi cosθo, 1e-3), both angles under 80°.

    NaN if there are no such samples.
    """
    inside = (judged.cos_i > _ANGLES) & (judged.cos_o > _ANGLES)
    if not bool(inside.any()):
        return math.nan
    c = (judged.cos_i * judged.cos_o).clamp_min(_FLOOR)[inside, None]
    ratio = torch.log(judged.found[inside] * c + _FLOOR) - torch.log(judged.expected[inside] * c + _FLOOR)
    return float((ratio**2).mean().sqrt())


def reciprocity(judged: EvaluatedPairs) -> float:
    """Return the 95th percentile of |f(ωi, ωo) − f(ωo, ωi)| over their mean, for the fit (`brdf.quality.faults`)."""
    return reciprocity_of(judged.reflectance)["p95"]


def largest_albedo(judged: EvaluatedPairs) -> float:
    """Return the largest directional-hemispherical albedo ∫ f̂ cosθo dωo of the fit, over channels and θi of 0…75°.

    Uses a quadrature over half vectors (`brdf.quality.faults.albedo`). Anisotropic materials are lit along x and along
    y.
    """
    return max(float(values.max()) for values in _albedos(judged.reflectance, judged.samples.isotropic))


def energy_above_one(judged: EvaluatedPairs) -> float:
    """Return how much `largest_albedo` exceeds 1, or 0 if it does not."""
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

    The last band includes 90°. NaN for a band without samples.
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
