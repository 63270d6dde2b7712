"""Unit vectors, spherical angles, the half/difference frame, and ways to draw directions.

Frame: z the surface normal, x the tangent, y the binormal. Angles in radians: θ from the normal, φ from
the tangent towards the binormal. Every function takes and gives tensors of any leading shape with the
components last, in the dtype and on the device of its input.
"""

import torch
from torch import Tensor

from homofact.geometry.namespace import normalized
from homofact.geometry.parabolic import from_disc


def normalize(v: Tensor) -> Tensor:
    """Return `v` (..., 3) scaled to length 1; the zero vector, which has no direction, becomes the normal."""
    return normalized(v)


def from_spherical(theta: Tensor, phi: Tensor) -> Tensor:
    """Return unit vectors (..., 3) from θ and φ in radians."""
    sine = torch.sin(theta)
    return torch.stack((sine * torch.cos(phi), sine * torch.sin(phi), torch.cos(theta)), -1)


def from_cosine(cosine: Tensor, phi: Tensor) -> Tensor:
    """Unit vectors (..., 3) from cosθ and φ in radians; the sine is √((1 − cosθ)(1 + cosθ)), sound at both poles."""
    sine = torch.sqrt(((1 - cosine) * (1 + cosine)).clamp_min(0))
    return torch.stack((sine * torch.cos(phi), sine * torch.sin(phi), cosine.expand_as(sine)), -1)


def to_spherical(w: Tensor) -> tuple[Tensor, Tensor]:
    """Return (θ, φ) of unit vectors, θ in [0, π], φ in (−π, π]; φ is 0 on the axis.

    θ comes from atan2, not acos, which loses half of the digits near the normal.
    """
    return torch.atan2(torch.hypot(w[..., 0], w[..., 1]), w[..., 2]), torch.atan2(w[..., 1], w[..., 0])


def above_horizon(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return (whether both have z ≥ 0 (N,), wi, wo); other pairs (N, 3) are replaced by the normal."""
    above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
    if bool(above.all()):
        return above, wi, wo
    normal = wi.new_tensor([0, 0, 1])
    return above, torch.where(above[:, None], wi, normal), torch.where(above[:, None], wo, normal)


def half_difference(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
    """Return half vector h and difference vector d in Kautz and McCool's frame (thesis eq. 1.4).

    r = norm(t − (t·h)h), s = h × r, d = (r·ωi, s·ωi, h·ωi) with t the tangent. Swapping ωi and ωo sends
    (dx, dy) to (−dx, −dy). Where h is parallel to t, r is undefined and the normal takes t's place.
    """
    h = normalize(wi + wo)
    r, s = _half_frame(h)
    return h, torch.stack(((r * wi).sum(-1), (s * wi).sum(-1), (h * wi).sum(-1)), -1)


def from_half_difference(h: Tensor, d: Tensor) -> tuple[Tensor, Tensor]:
    """Return (wi, wo) from the half and difference vectors: the inverse of `half_difference`.

    wi = dx r + dy s + dz h; wo is wi mirrored at h.
    """
    r, s = _half_frame(h)
    wi = d[..., :1] * r + d[..., 1:2] * s + d[..., 2:] * h
    return wi, 2 * (wi * h).sum(-1, keepdim=True) * h - wi


def _half_frame(h: Tensor) -> tuple[Tensor, Tensor]:
    tangent = torch.zeros_like(h)
    tangent[..., 0] = 1
    rejected = tangent - h[..., :1] * h
    # h·t = ±1 only for h on the horizon; −hx·n is the limit of the rejection as h sinks towards t.
    fallback = torch.zeros_like(h)
    fallback[..., 2] = -torch.sign(h[..., 0])
    degenerate = rejected.norm(dim=-1, keepdim=True) < 1e-9
    r = normalize(torch.where(degenerate, fallback, rejected))
    return r, torch.linalg.cross(h, r)


def draw_in_discs(count: int, generator: torch.Generator, radius_squared: float = 1.0) -> tuple[Tensor, Tensor]:
    """Return `count` pairs (wi, wo), each direction uniform in the parabolic disc with u² + v² < `radius_squared`.

    Texels are uniform in the same disc. The figures in numbers.md use `radius_squared` 0.98, which excludes the
    outermost ring, at grazing angles.
    """

    def disc() -> Tensor:
        radius = torch.sqrt(torch.rand(count, dtype=torch.float64, generator=generator) * radius_squared)
        angle = torch.rand(count, dtype=torch.float64, generator=generator) * (2 * torch.pi)
        return from_disc(torch.stack((radius * torch.cos(angle), radius * torch.sin(angle)), -1))

    return disc(), disc()


def draw_cosine_weighted(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return `count` pairs (wi, wo), each with density cosθ/π on the hemisphere (Malley's construction)."""

    def cosine() -> Tensor:
        squared = torch.rand(count, dtype=torch.float64, generator=generator)
        angle = torch.rand(count, dtype=torch.float64, generator=generator) * (2 * torch.pi)
        radius = torch.sqrt(squared)
        return torch.stack((radius * torch.cos(angle), radius * torch.sin(angle), torch.sqrt(1 - squared)), -1)

    return cosine(), cosine()


def draw_uniform(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return `count` pairs (wi, wo), each uniform in solid angle on the upper hemisphere."""

    def uniform() -> Tensor:
        z = torch.rand(count, dtype=torch.float64, generator=generator)
        angle = torch.rand(count, dtype=torch.float64, generator=generator) * (2 * torch.pi)
        radius = torch.sqrt(1 - z**2)
        return torch.stack((radius * torch.cos(angle), radius * torch.sin(angle), z), -1)

    return uniform(), uniform()


def grid_of_pairs(side: int) -> tuple[Tensor, Tensor]:
    """Return a fixed grid: all pairs of directions at the centres of a side × side square grid inside the discs."""
    centre = (torch.arange(side, dtype=torch.float64) + 0.5) * (2 / side) - 1
    u, v = torch.meshgrid(centre, centre, indexing="xy")
    points = torch.stack((u.reshape(-1), v.reshape(-1)), -1)
    directions = from_disc(points[(points**2).sum(-1) < 1])
    n = directions.shape[0]
    return directions.repeat_interleave(n, 0), directions.repeat(n, 1)
