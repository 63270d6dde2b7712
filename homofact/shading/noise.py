"""Compute the noise of importance sampling with a density by quadrature, without random samples."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.shading.lobe_mixture import LobeMixture

ANGLES = (0.0, 30.0, 60.0, 80.0)  # degrees
_AZIMUTH = 0.4  # radians: off the axes of an anisotropic material
MEANING = (
    "relative variance of f cos(theta_i)/density with one direction, f the mean of the channels, viewer at theta_o and"
    " azimuth 0.4 rad, and the same of directions drawn by the cosine"
)
Density = Callable[[Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Noise:
    """Relative variance of f cosθi/p with one direction for a viewer at `angle` degrees, f the mean of the channels.

    `cosine` is the relative variance of cosine-weighted sampling.
    """

    angle: float
    variance: float
    cosine: float

    def record(self) -> dict[str, float]:
        """Return the JSON form."""
        return asdict(self)


def noise_of(reflectance: Reflectance, density: Density, wo: Tensor) -> tuple[float, float]:
    """Return (relative variance, ∫ p) for one viewer (3,); the variance is 0 if the surface reflects no light.

    The relative variance is ∫ (f cosθ)²/p divided by (∫ f cosθ)², minus 1, computed on the nodes of
    `geometry.quadrature`. `density` returns p in sr⁻¹ for pairs (N, 3).
    """
    wi, angles = (nodes[0] for nodes in hemisphere_nodes(wo[None].to(torch.float64)))
    seen = wo.to(wi).expand_as(wi)
    value = reflectance.evaluate(wi, seen).to(torch.float64).mean(1) * wi[:, 2]
    densities = density(wi, seen)
    mean = float((value * angles).sum())
    if not mean > 0:
        return 0.0, float((densities * angles).sum())
    second = float((value**2 / densities.clamp_min(1e-300) * angles).sum())
    # The sums of an even density round to just below 1.
    return max(second / mean**2 - 1, 0.0), float((densities * angles).sum())


def albedo_of(reflectance: Reflectance, wo: Tensor) -> float:
    """Return the albedo ∫ f cosθi dωi for one viewer (3,), with f the mean of the channels."""
    wi, angles = (nodes[0] for nodes in hemisphere_nodes(wo[None].to(torch.float64)))
    value = reflectance.evaluate(wi, wo.to(wi).expand_as(wi)).to(torch.float64).mean(1) * wi[:, 2]
    return float((value * angles).sum())


def viewer_at(angle: float) -> Tensor:
    """Return the viewer (3,) at `angle` degrees and `_AZIMUTH`."""
    theta, phi = torch.tensor([math.radians(angle), _AZIMUTH], dtype=torch.float64)
    return from_spherical(theta, phi)


def cosine_density(wi: Tensor, wo: Tensor) -> Tensor:
    """Return the density cosθi/π (N,), or 0 if a direction is below the horizon."""
    return wi[:, 2] / math.pi * ((wi[:, 2] > 0) & (wo[:, 2] > 0))


def noise_at_angles(reflectance: Reflectance, mixture: LobeMixture) -> tuple[Noise, ...]:
    """Return the noise of a mixture for viewers at `ANGLES`."""
    noises = []
    for angle in ANGLES:
        wo = viewer_at(angle)
        variance, cosine = (noise_of(reflectance, density, wo)[0] for density in (mixture.density, cosine_density))
        noises.append(Noise(angle, variance, cosine))
    return tuple(noises)
