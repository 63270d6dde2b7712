"""Add an artefact to a good fit: a needle, ring, rim, spot or hole of random size and strength.

A planted fit has f (1 + a b), a the strength and b a bump of height 1 over the half vector's angle θh, the angle φd of
the light about it (from the plane of half vector and normal), and the angles of light and viewer. In degrees, with
(x, y) = θh (cos(φd − φ), sin(φd − φ)):

* needle: exp(−(y/w)² − (θh/l)²), always brighter;
* ring: exp(−((θh − l)/w)²);
* rim: 1/(1 + exp((l − max(θi, θo))/w));
* spot and hole: exp(−((x − l)² + y²)/w²).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.reflectance import Derived, Reflectance
from homofact.geometry.directions import normalize, to_spherical

# Of each kind the least and the largest place or length l and width w, in degrees.
SIZES = {
    "needle": ((5.0, 20.0), (0.4, 2.0)),
    "ring": ((5.0, 35.0), (0.8, 3.0)),
    "rim": ((60.0, 78.0), (1.0, 3.0)),
    "spot": ((8.0, 35.0), (2.0, 6.0)),
    "hole": ((8.0, 35.0), (2.0, 6.0)),
}
KINDS = tuple(SIZES)
WEAKEST, STRONGEST = -3.0, 1.0  # of log2 of the factor less 1


@dataclass(frozen=True)
class PlantedArtefact(Derived):
    """A reflectance with an artefact: `kind`, a as `strength`, l as `place`, w as `width`, φ as `turn` in radians."""

    kind: str
    strength: float
    place: float
    width: float
    turn: float = 0.0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The base's values (N, C) in sr⁻¹, without the cosine, with the bump."""
        return self.base.evaluate(wi, wo) * (1 + self.strength * self.bump(wi.double(), wo.double())[:, None])

    def bump(self, wi: Tensor, wo: Tensor) -> Tensor:
        """b (N,)."""
        half = normalize(wi + wo)
        radius = to_spherical(half)[0].rad2deg()
        if self.kind == "ring":
            return torch.exp(-(((radius - self.place) / self.width) ** 2))
        if self.kind == "rim":
            grazing = torch.maximum(*(to_spherical(w)[0].rad2deg() for w in (wi, wo)))
            return torch.sigmoid((grazing - self.place) / self.width)
        normal = torch.zeros_like(half)
        normal[:, 2] = 1
        along = normalize(normal - half[:, 2:] * half + 1e-12)
        across = torch.linalg.cross(half, along)
        turn = torch.atan2((wi * across).sum(-1), (wi * along).sum(-1)) - self.turn
        x, y = radius * torch.cos(turn), radius * torch.sin(turn)
        if self.kind == "needle":
            return torch.exp(-((y / self.width) ** 2) - (radius / self.place) ** 2)
        return torch.exp(-((x - self.place) ** 2 + y**2) / self.width**2)


def drawn_artefact(base: Reflectance, kind: str, generator: torch.Generator) -> PlantedArtefact:
    """An artefact of a kind on a reflectance, drawn: rings and rims are bright or dark as likely."""
    uniform = torch.rand(5, generator=generator, dtype=torch.float64).tolist()
    (nearest, farthest), (thinnest, widest) = SIZES[kind]
    strength = 2 ** (WEAKEST + (STRONGEST - WEAKEST) * uniform[0])
    if kind == "hole" or (kind in ("ring", "rim") and uniform[1] < 0.5):
        strength = -strength / (1 + strength)
    place, width = nearest + (farthest - nearest) * uniform[2], thinnest + (widest - thinnest) * uniform[3]
    return PlantedArtefact(base, kind, strength, place, width, 2 * math.pi * uniform[4])
