"""Compare the reflected light of a fit with that of its source: albedo, energy and highlight.

The log error at samples hardly changes if a highlight loses half of its light, since the peak covers few pairs of
directions but carries most of the flux. The figures here are integrals of f itself over both hemispheres, with the
nodes of `geometry.quadrature`, the same for fit and source. The light comes from the angles `ALBEDO_DEGREES` for the
albedo

    a(θi) = ∫ f cosθo dωo,

and from `LEVELS` Gauss nodes in sin²θi for integrals over both directions, ⟨g⟩ = ∫∫ g cosθi cosθo dωi dωo/π:

* energy ⟨f̂⟩/⟨f⟩;
* rms √(⟨(f̂ − f)²⟩/⟨f²⟩), and the floor: the rms of the source's reciprocal part (f(ωi, ωo) + f(ωo, ωi))/2 against the
  source. No reciprocal fit has a smaller rms;
* rms_cosine and floor_cosine: rms and floor of f cosθi cosθo, which published tables use. f alone grows towards grazing
  angles, where it is hardly visible in a picture;
* highlight: for each θi, the nodes are sorted by the source's f (mean of the channels). The brightest nodes that
  together carry the share `HIGHLIGHT` of the flux Σ f cosθo ω at this θi are selected; the last node counts in part.
  highlight is the fit's flux divided by the source's on these nodes, for all θi together. bright_half uses the share
  `BRIGHT_HALF` in the same way. The selection is made for each θi separately, since the brightest values of most
  materials are at grazing angles, where nobody looks for a highlight.

An isotropic material is lit from one azimuth; otherwise the figures are means over `brdf.symmetry.light_azimuths`. The
quadrature is accurate to 0.3% for isotropic peaks as narrow as a slope of 0.001, and to 1% for a peak that is thirty
times wider in one direction than in the other.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import light_azimuths
from homofact.errors import BadInput
from homofact.evaluation.peak import half_width
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes

ALBEDO_DEGREES = (5.0, 20.0, 40.0, 60.0, 75.0)
LEVELS = 10
HIGHLIGHT, BRIGHT_HALF = 0.01, 0.5
# (rings, spokes): an anisotropic peak turns with φh, and is lit from several azimuths.
_ISOTROPIC, _ANISOTROPIC = (112, 56), (64, 160)
_FIRST = len(ALBEDO_DEGREES)
_CHUNK = 1 << 16


@dataclass(frozen=True)
class EnergyErrors:
    """The figures that the module docstring defines.

    Attributes
    ----------
    degrees : θi of the albedos.
    source_albedo, fit_albedo : per angle, one number per channel.
    energy : fit divided by source, one number per channel; `energy_overall` is the ratio of the sums over channels.
    rms, floor, rms_cosine, floor_cosine : relative, over all channels.
    highlight, bright_half : fit over source.
    half_width : half width of the source's highlight in radians of θh (`evaluation.peak`), None if there is no
        highlight.
    asymmetry : ⟨|f(ωi, ωo) − f(ωo, ωi)|⟩ over ⟨f(ωi, ωo) + f(ωo, ωi)⟩ of the source, means over the channels.

    If the source is 0, a ratio is 1 if the fit is also 0, and infinite otherwise.
    """

    degrees: tuple[float, ...]
    source_albedo: tuple[tuple[float, ...], ...]
    fit_albedo: tuple[tuple[float, ...], ...]
    energy: tuple[float, ...]
    energy_overall: float
    rms: float
    floor: float
    rms_cosine: float
    floor_cosine: float
    highlight: float
    bright_half: float
    half_width: float | None
    asymmetry: float = 0.0

    @property
    def albedo_ratio(self) -> tuple[tuple[float, ...], ...]:
        """Fit over source, per angle and channel."""
        rows = zip(self.fit_albedo, self.source_albedo, strict=True)
        return tuple(tuple(_ratio(a, b) for a, b in zip(fit, source, strict=True)) for fit, source in rows)

    @property
    def albedo_mean(self) -> tuple[float, ...]:
        """Fit over source of the mean over channels, per angle."""
        return tuple(_ratio(sum(fit), sum(own)) for fit, own in zip(self.fit_albedo, self.source_albedo, strict=True))

    @property
    def albedo_worst(self) -> float:
        """The ratio that is farthest from 1, as a factor, over angles and channels."""
        return self.worst_albedo[0]

    @property
    def worst_albedo(self) -> tuple[float, float, int]:
        """(the ratio of fit to source that is farthest from 1, its θi in degrees, the index of its channel)."""
        ratios = [
            (ratio, degrees, channel)
            for degrees, row in zip(self.degrees, self.albedo_ratio, strict=True)
            for channel, ratio in enumerate(row)
        ]
        return max(ratios, key=lambda ratio: abs(_log(ratio[0])))

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary, with None for infinite values."""
        derived = {
            "albedo_ratio": self.albedo_ratio,
            "albedo_mean": self.albedo_mean,
            "albedo_worst": self.albedo_worst,
        }
        return {name: _finite(value) for name, value in (asdict(self) | derived).items()}


@dataclass(frozen=True)
class SourceLight:
    """The evaluations of a source, computed once for any number of fits.

    `azimuths` are the azimuths of the light, and `nodes` are the numbers of (rings, spokes) of the viewing directions.
    The other arrays have the axes (azimuth, θi, node), with the θi of `ALBEDO_DEGREES` first: `cosine` is cosθo times
    the solid angle, `both_cosines` is cosθi cosθo, and `values` (..., C) is f. `floor`, `floor_cosine`, `half_width`
    and `asymmetry` as in `EnergyErrors`.
    """

    azimuths: tuple[float, ...]
    nodes: tuple[int, int]
    cosine: Tensor
    both_cosines: Tensor
    values: Tensor
    floor: float
    floor_cosine: float
    half_width: float | None
    asymmetry: float

    @classmethod
    def of(cls, source: Reflectance, isotropic: bool) -> "SourceLight":
        """Return the light of `source`; if it is `isotropic`, one azimuth of the light is enough."""
        azimuths, nodes = light_azimuths(isotropic), _ISOTROPIC if isotropic else _ANISOTROPIC
        wi, wo, cosine = _pairs(azimuths, nodes)
        values = _values(source, wi, wo)
        weight, own = _levels(cosine), values[:, _FIRST:]
        back = (directions[:, _FIRST:] for directions in (wo, wi))
        swapped = _values(source, *back)
        miss = (swapped - own) / 2
        apart, both = (float((weight * part).sum()) for part in (2 * miss.mean(-1).abs(), (swapped + own).mean(-1)))
        cosines = wi[..., 2] * wo[..., 2]
        floor, floor_cosine = (_relative(part, miss, own) for part in (weight, weight * cosines[:, _FIRST:]))
        asymmetry = _ratio(apart, both, same=0.0)
        return cls(azimuths, nodes, cosine, cosines, values, floor, floor_cosine, half_width(source), asymmetry)

    def errors(self, fit: Reflectance) -> EnergyErrors:
        """Return the figures of a fit. Raises BadInput if its number of channels differs from the source's."""
        if len(fit.channels) != self.values.shape[-1]:
            raise BadInput(
                where="fit", found=f"{len(fit.channels)} channels", expected=f"the source's {self.values.shape[-1]}"
            )
        both = self.values, _values(fit, *_pairs(self.azimuths, self.nodes)[:2])
        source_albedo, fit_albedo = ((self.cosine[..., None] * f).sum(2).mean(0)[:_FIRST] for f in both)
        weight = _levels(self.cosine)
        own, mine = (f[:, _FIRST:] for f in both)
        energy = [(weight[..., None] * f).sum((0, 1, 2)).tolist() for f in (mine, own)]
        return EnergyErrors(
            degrees=ALBEDO_DEGREES,
            source_albedo=_rows(source_albedo),
            fit_albedo=_rows(fit_albedo),
            energy=tuple(_ratio(a, b) for a, b in zip(*energy, strict=True)),
            energy_overall=_ratio(sum(energy[0]), sum(energy[1])),
            rms=_relative(weight, mine - own, own),
            floor=self.floor,
            rms_cosine=_relative(weight * self.both_cosines[:, _FIRST:], mine - own, own),
            floor_cosine=self.floor_cosine,
            highlight=_brightest(weight, mine, own, HIGHLIGHT),
            bright_half=_brightest(weight, mine, own, BRIGHT_HALF),
            half_width=self.half_width,
            asymmetry=self.asymmetry,
        )


def energy_errors(fit: Reflectance, source: Reflectance, isotropic: bool) -> EnergyErrors:
    """Return the figures of `fit` against `source`; both must accept any pair of directions.

    If `isotropic`, one azimuth of the light is enough. Raises BadInput if their channels differ in number.
    """
    return SourceLight.of(source, isotropic).errors(fit)


def _pairs(azimuths: tuple[float, ...], nodes: tuple[int, int]) -> tuple[Tensor, Tensor, Tensor]:
    """(ωi, ωo) (A, K, M, 3), cosθo times solid angle (A, K, M); θi of `ALBEDO_DEGREES` before those of the levels."""
    degrees = torch.tensor(ALBEDO_DEGREES, dtype=torch.float64)
    theta = torch.cat((degrees.deg2rad(), disc_nodes(LEVELS)[0]))
    lit = torch.stack([from_spherical(theta, torch.full_like(theta, azimuth)) for azimuth in azimuths])
    views, solid = hemisphere_nodes(lit.reshape(-1, 3), *nodes)
    wo = views.reshape(*lit.shape[:2], -1, 3)
    return lit[:, :, None].expand_as(wo), wo, solid.reshape(wo.shape[:3]) * wo[..., 2]


def _levels(cosine: Tensor) -> Tensor:
    """The weight of each node of the levels in ⟨g⟩, (A, LEVELS, M)."""
    return cosine[:, _FIRST:] * (disc_nodes(LEVELS)[1] / len(cosine))[:, None]


def _values(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    """f (..., C) of directions (..., 3), in pieces that bound the memory."""
    pairs = zip(wi.reshape(-1, 3).split(_CHUNK), wo.reshape(-1, 3).split(_CHUNK), strict=True)
    values = torch.cat([reflectance.evaluate(one, two).to(torch.float64) for one, two in pairs])
    return values.reshape(*wi.shape[:-1], -1)


def _relative(weight: Tensor, miss: Tensor, own: Tensor) -> float:
    """RMS of what is missed over that of the source's own values."""
    missed, whole = (float((weight[..., None] * values.square()).sum()) for values in (miss, own))
    return math.sqrt(_ratio(missed, whole, same=0.0))


def _brightest(weight: Tensor, fit: Tensor, source: Tensor, share: float) -> float:
    """Flux of `fit` over that of `source` on the brightest nodes that hold `share` of each incidence's flux."""
    mine, own = fit.mean(-1), source.mean(-1)
    order = own.sort(dim=-1, descending=True, stable=True).indices
    flux = (weight * own).gather(-1, order)
    running = flux.cumsum(-1)
    wanted = share * running[..., -1:]
    # All of a node, none of it, or of the last one the part that is still wanted.
    part = ((wanted - running + flux) / flux.clamp_min(1e-300)).clamp(0, 1)
    return _ratio(float(((weight * mine).gather(-1, order) * part).sum()), float((flux * part).sum()))


def _rows(values: Tensor) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def _ratio(fit: float, source: float, same: float = 1.0) -> float:
    """Fit over source; `same` where both are 0, infinite where the source alone is."""
    if source > 0:
        return fit / source
    return same if fit == 0 else math.inf


def _log(ratio: float) -> float:
    return math.log(ratio) if 0 < ratio < math.inf else math.inf


def _finite(value: Any) -> Any:
    """Tuples as lists, numbers that are not finite as None."""
    if isinstance(value, tuple):
        return [_finite(entry) for entry in value]
    return value if value is not None and math.isfinite(value) else None
