"""Compare a fit with interpolations of its samples.

There are two kinds of interpolation. The first, the plain interpolation, needs no model.

At a pair of directions it is the mean of log(f/A + 0.01) over the nearest samples in (√θh, θd, φd). The corrected fit
is a variant of it: it adds the mean residual at these samples to the logarithm of the fit. Where values are steep, the
plain interpolation is wrong and the corrected fit is right; where the fit is far from samples, it is the other way
round. Both are also computed from each half of the samples and compared with the samples of the other half. The
difference between the halves measures the random error.

Then the light of the fit and of the interpolations is integrated at the angles of `energy.ALBEDO_DEGREES`: the total
light, and the brightest `energy.HIGHLIGHT` share of it.

The second kind is the surface of `brdf.scattered`, which follows a GGX model between and beyond isotropic samples. It
is much closer to the material than a mean of neighbours. So the fit is also compared with it at each quadrature node,
and in a small picture under a lamp. For anisotropic samples, and for fewer than `scattered.LEAST_SAMPLES` samples, the
plain interpolation replaces the surface.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import display_of
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.places import half_places
from homofact.brdf.quality.extrapolation import Extrapolation
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import LEAST_SAMPLES, surface_of
from homofact.evaluation.appearance import picture_off
from homofact.evaluation.energy import ALBEDO_DEGREES, HIGHLIGHT
from homofact.evaluation.verdict.flux import flux_of
from homofact.geometry.directions import from_spherical
from homofact.geometry.nearest import tree_of
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.sphere import SphereImage, render_sphere

if TYPE_CHECKING:
    from scipy.spatial import KDTree

NEIGHBOURS = 6
MOST_SAMPLES = 12_000
_EPSILON = 0.01
_RINGS, _SPOKES = 24, 20
_TINY = 1e-300
_PIXELS = 48
_MOST_APART = 1.0  # times the light of an angle: a fit that diverges at one does not hide the others


@dataclass(frozen=True)
class SampleReading:
    """Figures that compare a fit with interpolations of its samples.

    Attributes
    ----------
    apart : RMS difference between the logarithms of the fit and of the plain interpolation from one half of the
        samples, at the samples of the other half, weighted by light.
    mended : the same for the correction that the corrected fit adds.
    bias : the part of the fit's error on which both halves agree, so it excludes noise.
    albedo : per angle, log of the corrected fit's total light divided by the fit's, for the channel with the largest
        |log|.
    read_albedo : the same for the plain interpolation.
    chance : per angle, the difference between the logs of the total light that the two halves give.
    highlight, read_highlight, highlight_chance : `albedo`, `read_albedo` and `chance` for the brightest light, all
        angles together.
    unmeasured : per angle, share of the fit's light at pairs of directions outside the measured range.
    gap : per angle, the mean distance to the nearest sample, weighted by the fit's light, in (√θh, θd, φd) scaled to
        0…1.
    highlight_gap : `gap` for the brightest light.
    effective : the effective number of samples that carry the light, (Σ x)²/Σ x² with x the light of a sample.
    surface : per angle, log of the surface's total light divided by the fit's, for the channel with the largest |log|.
    surface_highlight : the same of the brightest light, all angles together.
    surface_apart : Σ|fit − surface| divided by the light of the surface, at most 1 per angle, averaged over the angles.
    surface_lamp : Σ|fit − surface|/Σ surface of the picture of a sphere under a lamp.
    """

    apart: float
    mended: float
    bias: float
    albedo: tuple[float, ...]
    read_albedo: tuple[float, ...]
    chance: tuple[float, ...]
    highlight: float
    read_highlight: float
    highlight_chance: float
    unmeasured: tuple[float, ...]
    gap: tuple[float, ...]
    highlight_gap: float
    effective: float
    surface: tuple[float, ...]
    surface_highlight: float
    surface_apart: float
    surface_lamp: float


@dataclass(frozen=True)
class _Known:
    """Samples to be read: where they stand, and (N, C) their logarithms and what a fit misses of them."""

    tree: "KDTree"
    logs: Tensor
    missed: Tensor

    def read(self, place: np.ndarray) -> tuple[Tensor, Tensor]:
        """Return the mean logarithm and the mean miss of the nearest samples, (M, C) each."""
        count = min(NEIGHBOURS, self.tree.n)
        near = torch.from_numpy(np.reshape(self.tree.query(place, k=count)[1], (len(place), count)))
        return self.logs[near].mean(1), self.missed[near].mean(1)


def reading_of(fit: Reflectance, samples: Samples, extrapolation: Extrapolation, seed: int = 0) -> SampleReading:
    """Compare a fit with interpolations of the samples it was fitted to; `extrapolation` belongs to these samples."""
    drawn = samples.subset(MOST_SAMPLES, seed)
    transform = LogTransform.of_values(drawn.values, _EPSILON)
    place = half_places(drawn.wi, drawn.wo, drawn.isotropic).cpu().numpy()
    logs = transform.forward(drawn.values)
    missed = logs - transform.forward(fit.evaluate(drawn.wi, drawn.wo).to(logs))
    first = torch.rand(len(drawn), generator=torch.Generator().manual_seed(seed)) < 0.5
    halves = [_known(place, logs, missed, each) for each in (first, ~first)]
    light = flux_of(drawn) * drawn.values.mean(1)
    apart, mended, bias = _between_halves(halves, (~first, first), place, logs - missed, light)
    whole = _known(place, logs, missed, torch.ones_like(first))
    nodes = _Nodes.of(fit, drawn, transform)
    plain, better = nodes.lights(whole)
    one, two = (nodes.lights(half)[0] for half in halves)
    own = nodes.light(nodes.values)
    surface = _surface_of(samples, drawn, whole, transform)
    through = nodes.values_of(surface)
    light_through = nodes.light(through)
    return SampleReading(
        apart,
        mended,
        bias,
        _farthest(better[0], own[0]),
        _farthest(plain[0], own[0]),
        tuple(map(abs, _farthest(one[0], two[0]))),
        _log_ratio(better[1], own[1]),
        _log_ratio(plain[1], own[1]),
        abs(_log_ratio(one[1], two[1])),
        nodes.beyond(extrapolation),
        *nodes.gaps(whole.tree),
        float(light.sum() ** 2 / light.square().sum().clamp_min(_TINY)),
        _farthest(light_through[0], own[0]),
        _log_ratio(light_through[1], own[1]),
        nodes.apart(through),
        picture_off(*(_lit(each) for each in (surface, fit))),
    )


def _surface_of(samples: Samples, drawn: Samples, whole: "_Known", transform: LogTransform) -> Reflectance:
    """The surface through the samples; where there is none, the plain interpolation of those `drawn`."""
    if samples.isotropic and len(samples) >= LEAST_SAMPLES:
        return surface_of(samples)
    return _Plain(whole, transform, drawn.isotropic, drawn.channels)


def _lit(reflectance: Reflectance) -> SphereImage:
    """A small picture under a lamp; of channels that are no colours, their mean."""
    count, to_rgb = len(reflectance.channels), display_of(reflectance.channels)
    if to_rgb is None and count not in (1, 3):
        to_rgb = torch.full((3, count), 1 / count, dtype=torch.float64)
    return render_sphere(reflectance, DEFAULT_LIGHT, _PIXELS, to_rgb=to_rgb)


def _known(place: np.ndarray, logs: Tensor, missed: Tensor, chosen: Tensor) -> _Known:
    return _Known(tree_of(place[chosen.numpy()]), logs[chosen], missed[chosen])


def _between_halves(
    halves: list[_Known], others: tuple[Tensor, Tensor], place: np.ndarray, fitted: Tensor, light: Tensor
) -> tuple[float, float, float]:
    """Return `apart`, `mended` and `bias` of `SampleReading`; each half is evaluated at the samples of `others`."""
    sums = torch.zeros(3, dtype=torch.float64)
    for half, other, own in zip(halves, others, reversed(halves), strict=True):
        at = place[other.numpy()]
        read, missed = half.read(at)
        weight = light[other][:, None] / light.sum().clamp_min(_TINY) / read.shape[1]
        sums[0] += (weight * (read - fitted[other]).square()).sum()
        sums[1] += (weight * missed.square()).sum()
        sums[2] += (weight * missed * own.read(at)[1]).sum()
    return tuple(float(each.clamp_min(0).sqrt()) for each in sums)  # type: ignore[return-value]


@dataclass(frozen=True)
class _Plain:
    """The plain interpolation as a reflectance."""

    known: _Known
    transform: LogTransform
    isotropic: bool
    channels: tuple[str, ...]
    nbytes: int = 0
    fetches: int = NEIGHBOURS

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the values (N, C) in sr⁻¹."""
        return self.transform.inverse(self.known.read(half_places(wi, wo, self.isotropic).cpu().numpy())[0])


@dataclass(frozen=True)
class _Nodes:
    """Where light is integrated: pairs (angles × nodes, 3), the weight of each, and the fit's values there (…, C)."""

    wi: Tensor
    wo: Tensor
    place: np.ndarray
    weight: Tensor
    values: Tensor
    brightest: Tensor
    transform: LogTransform

    @classmethod
    def of(cls, fit: Reflectance, samples: Samples, transform: LogTransform) -> "_Nodes":
        """Return the nodes of a fit at `energy.ALBEDO_DEGREES`, lit from one azimuth."""
        theta = torch.tensor(ALBEDO_DEGREES, dtype=torch.float64).deg2rad()
        lit = from_spherical(theta, torch.zeros_like(theta))
        wo, solid = hemisphere_nodes(lit, _RINGS, _SPOKES)
        wi, weight = lit[:, None].expand_as(wo).reshape(-1, 3), solid * wo[..., 2]
        values = _values_at(fit, wi, wo.reshape(-1, 3), weight)
        flux = weight * values.mean(-1)
        order = values.mean(-1).argsort(dim=1, descending=True, stable=True)
        before = flux.gather(1, order).cumsum(1) - flux.gather(1, order)
        inside = before < HIGHLIGHT * flux.sum(1, keepdim=True)
        brightest = torch.zeros_like(flux).scatter(1, order, inside.to(flux))
        place = half_places(wi, wo.reshape(-1, 3), samples.isotropic).cpu().numpy()
        return cls(wi, wo.reshape(-1, 3), place, weight, values, brightest, transform)

    def lights(self, known: _Known) -> tuple[tuple[Tensor, float], tuple[Tensor, float]]:
        """Return `light` of the plain interpolation and of the corrected fit."""
        read, missed = known.read(self.place)
        own = self.transform.forward(self.values.reshape(len(read), -1))
        plain, better = (self.transform.inverse(logs).reshape(self.values.shape) for logs in (read, own + missed))
        return self.light(plain), self.light(better)

    def light(self, values: Tensor) -> tuple[Tensor, float]:
        """Return (total light (angles, C), light where the fit is brightest) of values at the nodes."""
        flux = self.weight[..., None] * values
        return flux.sum(1), float((flux * self.brightest[..., None]).sum())

    def values_of(self, reflectance: Reflectance) -> Tensor:
        """Return the values of a reflectance at the nodes (angles, nodes, C)."""
        return _values_at(reflectance, self.wi, self.wo, self.weight)

    def apart(self, values: Tensor) -> float:
        """Return Σ|fit − values| over Σ values of the light, the mean of the angles; one angle counts 1 at most."""
        flux = self.weight[..., None] * values
        missed = (self.weight[..., None] * (self.values - values)).abs().sum((1, 2))
        return float((missed / flux.sum((1, 2)).clamp_min(_TINY)).clamp_max(_MOST_APART).mean())

    def gaps(self, tree: "KDTree") -> tuple[tuple[float, ...], float]:
        """Return `gap` and `highlight_gap` of `SampleReading`."""
        flux = self.weight * self.values.mean(-1)
        far = torch.from_numpy(np.asarray(tree.query(self.place)[0])).reshape(flux.shape)
        bright = flux * self.brightest
        mean = (flux * far).sum(1) / flux.sum(1).clamp_min(_TINY)
        return tuple(mean.tolist()), float((bright * far).sum() / bright.sum().clamp_min(_TINY))

    def beyond(self, extrapolation: Extrapolation) -> tuple[float, ...]:
        """Return `unmeasured` of `SampleReading`."""
        flux = self.weight * self.values.mean(-1)
        outside = ~extrapolation.measured(self.wi, self.wo).reshape(flux.shape)
        return tuple(((flux * outside).sum(1) / flux.sum(1).clamp_min(_TINY)).tolist())


def _values_at(reflectance: Reflectance, wi: Tensor, wo: Tensor, weight: Tensor) -> Tensor:
    """Values at pairs (angles × nodes, 3), shaped as the nodes' `weight` (angles, nodes) with channels (…, C)."""
    return reflectance.evaluate(wi, wo).to(torch.float64).reshape(*weight.shape, -1)


def _farthest(light: Tensor, own: Tensor) -> tuple[float, ...]:
    """Per angle the log of the ratio (angles, C) of the channel that is farthest from 0."""
    logs = (light.clamp_min(_TINY) / own.clamp_min(_TINY)).log()
    return tuple(logs.gather(1, logs.abs().argmax(1, keepdim=True))[:, 0].tolist())


def _log_ratio(light: float, own: float) -> float:
    return math.log(max(light, _TINY) / max(own, _TINY))
