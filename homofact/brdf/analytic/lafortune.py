"""Generalised cosine lobes (Lafortune, Foo, Torrance and Greenberg 1997, eq. 8), isotropic form.

f = ρd/π + Σ [Cxy(ωi.x ωo.x + ωi.y ωo.y) + Cz ωi.z ωo.z]₊ⁿ

Cxy < 0 with Cz > 0 gives a lobe about the mirror direction (or off it); both > 0 gives retroreflection. The
coefficients contain the scale of a lobe, so there is no normalisation factor. Every channel has its own coefficients.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.brdf.analytic.common import AnalyticModel, Colour
from homofact.errors import BadInput


@dataclass(frozen=True)
class Lobe:
    """One lobe: `cxy`, `cz` and the exponent `n`, each with one number per channel."""

    cxy: Colour
    cz: Colour
    n: Colour


@dataclass(frozen=True)
class Lafortune(AnalyticModel):
    """The model of the module docstring in sr⁻¹, with `diffuse` ρd and any number of lobes."""

    diffuse: Colour
    lobes: tuple[Lobe, ...]

    def __post_init__(self) -> None:
        """Refuse numbers that do not fit the channels, that are not finite, and exponents ≤ 0."""
        self.check_colour("diffuse")
        for j, lobe in enumerate(self.lobes):
            for name in ("cxy", "cz", "n"):
                value = getattr(lobe, name)
                if len(value) != len(self.channels):
                    raise BadInput(
                        f"{name} of lobe {j} has {len(value)} numbers",
                        where="Lafortune",
                        expected=f"one for each of {', '.join(self.channels)}",
                    )
                if not all(math.isfinite(x) for x in value) or (name == "n" and min(value) <= 0):
                    raise BadInput(
                        f"{name} of lobe {j} is {value}", where="Lafortune", expected="finite numbers, n above 0"
                    )

    def formula(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Diffuse term and lobes."""
        across = (wi[..., :2] * wo[..., :2]).sum(-1)[..., None]
        along = (wi[..., 2] * wo[..., 2])[..., None]
        total = self.diffuse_term(self.diffuse, wi)
        for lobe in self.lobes:
            base = self.colour(lobe.cxy, wi) * across + self.colour(lobe.cz, wi) * along
            total = total + torch.pow(base.clamp_min(0), self.colour(lobe.n, wi))
        return total
