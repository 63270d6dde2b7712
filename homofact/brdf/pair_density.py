"""How densely a scheme draws pairs of directions, per steradian of ωi and per steradian of ωo.

An integral over drawn pairs divides by this density q: ∫∫ g dωi dωo ≈ mean of g/q. The schemes are:

* discs, grid: each direction uniform in the parabolic disc (du dv = dω/(1 + cosθ)²), q = pd(ωi) pd(ωo) with
  pd(ω) = 1/(π (1 + cosθ)²). If the rim of the discs is cut off, as in the thesis at the squared radius `RIM`, q is
  larger by a constant factor.
* cosine: cosθi cosθo/π².
* lobe: half of the pairs are drawn in the discs out to `RIM`. The others are drawn where lobes are, with uniform
  azimuths of the half vector h and of the difference vector d. For t uniform in [0, 1], the angle w sinh(t
  asinh(90°/w)) is uniform up to about w and uniform in its logarithm beyond, so every decade of a highlight has the
  same number of samples. A share `HIGHLIGHTS` of all pairs has such an angle as θh, with w = 0.05° and a uniform θd. A
  share `RETURNS` has it as θd, with w = 0.5° and a uniform θh, for retro-reflection. Pairs below the horizon are drawn
  again. From dωi dωo = 4 cosθd dωh dωd

      q = p(θh)/(2π sinθh) · p(θd)/(2π sinθd)/(4 cosθd) / (share of the pairs that are above the horizon).

ε, A and the Cole error of a fit are defined over the discs, also if the pairs are drawn by the scheme `lobe`;
`over_discs` returns the weights for this.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import draw_in_discs, from_half_difference, from_spherical

HIGHLIGHTS, RETURNS = 0.375, 0.125
RIM = 0.98  # u² + v² of the thesis's discs: the last ring, where both directions graze, is cut
HIGHLIGHT_WIDTH, RETURN_WIDTH = math.radians(0.05), math.radians(0.5)
CELLS = (24, 12, 6)  # of (√θh, θd, φd)
_RIGHT = math.pi / 2
# Shares of the drawn pairs that lie above the horizon, by quadrature (tests/brdf/test_pair_density.py).
_ABOVE = {HIGHLIGHT_WIDTH: 0.9122, RETURN_WIDTH: 0.8785}


def scheme_of(samples: Samples) -> str | None:
    """Return the sampling scheme in the provenance of the samples; None for a measurement."""
    return samples.provenance.get("sampling", {}).get("scheme")


def density(scheme: str, wi: Tensor, wo: Tensor) -> Tensor:
    """Return the density q (N,) in sr⁻² of pairs (N, 3) under a scheme of the module docstring."""
    cos_i, cos_o = wi[:, 2], wo[:, 2]
    if scheme == "cosine":
        return cos_i * cos_o / math.pi**2
    if scheme != "lobe":
        return 1 / (math.pi * (1 + cos_i) * (1 + cos_o)) ** 2
    theta_h, theta_d, _ = rusinkiewicz_angles(wi, wo)
    return (
        (1 - HIGHLIGHTS - RETURNS) * _within_rim(cos_i) * _within_rim(cos_o)
        + HIGHLIGHTS * _about(theta_h, theta_d, theta_d, HIGHLIGHT_WIDTH)
        + RETURNS * _about(theta_d, theta_h, theta_d, RETURN_WIDTH)
    )


def draw_lobe(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return `count` pairs (wi, wo), (N, 3) each, of the scheme lobe."""
    returns, highlights = round(RETURNS * count), round(HIGHLIGHTS * count)
    parts = [
        draw_in_discs(count - highlights - returns, generator, RIM),
        _draw_about(highlights, HIGHLIGHT_WIDTH, generator, of_half=True),
        _draw_about(returns, RETURN_WIDTH, generator, of_half=False),
    ]
    wi, wo = (torch.cat(directions) for directions in zip(*parts, strict=True))
    order = torch.randperm(count, generator=generator)
    return wi[order], wo[order]


def solid_angles(samples: Samples) -> Tensor:
    """Return the measure of each sample (N,), in sr² up to a common factor: its weight over its sampling density.

    A measurement has no known sampling density. It is estimated by counting: the samples in a cell of (√θh, θd, φd)
    share the measure of the cell.
    """
    scheme = scheme_of(samples)
    if scheme is not None:
        densities = density(scheme, samples.wi, samples.wo)
        # By cosine the density is 0 at the horizon, and a pair there of no account for what carries a cosine.
        return torch.where(densities > 0, samples.weights / densities, 0.0)
    # Dense tables weigh their nodes by solid angle themselves.
    return samples.weights * (1.0 if "weights" in samples.provenance else _shares_of_cells(samples))


def over_discs(samples: Samples) -> Tensor:
    """Return weights (N,) for means over the discs; only samples of the scheme `lobe` are reweighted."""
    shares = disc_shares(samples)
    return samples.weights if shares is None else samples.weights * shares


def disc_shares(samples: Samples) -> Tensor | None:
    """Return the discs' density over that of the scheme lobe (N,), at most 2; None for samples of any other scheme.

    For the scheme `cosine` the ratio has no bound, and a measurement has no known density, so they are not reweighted.
    """
    if scheme_of(samples) != "lobe":
        return None
    discs = _within_rim(samples.wi[:, 2]) * _within_rim(samples.wo[:, 2])
    return discs / density("lobe", samples.wi, samples.wo)


def _within_rim(cosine: Tensor) -> Tensor:
    """The density of one direction, uniform in the disc out to `RIM`."""
    inside = (1 - cosine) <= RIM * (1 + cosine)
    return inside / (RIM * math.pi * (1 + cosine) ** 2)


def _about(narrow: Tensor, wide: Tensor, theta_d: Tensor, width: float) -> Tensor:
    """q of angles (N,): `narrow` even in its logarithm from `width`, `wide` uniform, azimuths uniform."""
    even = 1 / (torch.sqrt(narrow**2 + width**2) * math.asinh(_RIGHT / width))
    # Both sines and the cosine go to zero only where no sample falls.
    per_half = even / (2 * math.pi * torch.sin(narrow).clamp_min(1e-9))
    per_difference = 1 / (_RIGHT * 2 * math.pi * torch.sin(wide).clamp_min(1e-9))
    return per_half * per_difference / (4 * torch.cos(theta_d).clamp_min(1e-9)) / _ABOVE[width]


def _draw_about(count: int, width: float, generator: torch.Generator, *, of_half: bool) -> tuple[Tensor, Tensor]:
    wi = wo = torch.zeros(0, 3, dtype=torch.float64, device="cpu")
    while len(wi) < count:
        uniform = torch.rand(count, 4, dtype=torch.float64, generator=generator)
        narrow = width * torch.sinh(uniform[:, 0] * math.asinh(_RIGHT / width))
        wide = uniform[:, 1] * _RIGHT
        theta_h, theta_d = (narrow, wide) if of_half else (wide, narrow)
        half = from_spherical(theta_h, 2 * math.pi * uniform[:, 2])
        difference = from_spherical(theta_d, 2 * math.pi * uniform[:, 3])
        one, other = from_half_difference(half, difference)
        above = (one[:, 2] > 0) & (other[:, 2] > 0)
        wi, wo = torch.cat((wi, one[above])), torch.cat((wo, other[above]))
    return wi[:count], wo[:count]


def _shares_of_cells(samples: Samples) -> Tensor:
    """The solid angle of each sample's cell over the number of samples in it (N,)."""
    theta_h, theta_d, phi_d = rusinkiewicz_angles(samples.wi, samples.wo)
    place = ((theta_h / _RIGHT).sqrt(), theta_d / _RIGHT, (phi_d / math.pi).remainder(1.0))
    index = [(coordinate * steps).long().clamp(0, steps - 1) for coordinate, steps in zip(place, CELLS, strict=True)]
    cell = (index[0] * CELLS[1] + index[1]) * CELLS[2] + index[2]
    _, inverse, counts = torch.unique(cell, return_inverse=True, return_counts=True)
    low_h, high_h = (_RIGHT * ((index[0].to(theta_h) + edge) / CELLS[0]) ** 2 for edge in (0, 1))
    low_d, high_d = (_RIGHT * (index[1].to(theta_h) + edge) / CELLS[1] for edge in (0, 1))
    # ∫ 4 cosθd dωh dωd over the cell, up to the azimuths' factor.
    solid = (torch.cos(low_h) - torch.cos(high_h)) * (torch.sin(high_d) ** 2 - torch.sin(low_d) ** 2)
    return solid / counts[inverse].to(theta_h)
