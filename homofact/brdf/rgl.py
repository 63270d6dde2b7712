"""A BRDF tabulated in the adaptive parameterization of Dupuy and Jakob (2018), evaluated anywhere.

The table follows a microfacet model fitted to the material: with D the distribution of normals, σ the
projected area of the facets seen from ωi, and m the half vector, the visible normals reflect towards ωo with
density D(m)/(4σ(ωi)) (eq. 6 and 7 of the paper, the cosine between ωi and m cancelling). The table stores

    M = f(ωi, ωo) cosθo · 4σ(ωi)/D(m)

at nodes with equal steps in s, the marginal-conditional warp of the density of visible normals. So there are many nodes
where the material reflects much and few elsewhere. Hence

    f = M(ωi, s(m)) · D(m) / (4σ(ωi) cosθo).

Angles enter the unit square as u = (√(2θ/π), φ/2π + ½). An isotropic table counts the azimuth of m from that of ωi. An
anisotropic table also has slices at azimuths φi. These cover the whole turn, half of it (the rest follows by rotating
the surface by 180°) or a quarter (the rest follows by rotation and mirroring). Tables and densities are linear in θi
and φi between slices, and constant beyond the last one. ωi is the direction of the slices, which is the light in the
measurement. f need not be reciprocal.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.analytic.common import grazing, half_vector
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.samples import Samples
from homofact.brdf.sampling import sample_model
from homofact.brdf.source_names import DEFAULT_COUNT
from homofact.brdf.warp import MarginalConditional, bilinear
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical

# Values computed at once: bounds the memory of spectra, where a row has some hundred of them.
_CHUNK = 2**17
# What part of the turn the slices cover, 1/k of it.
_COVERS = (1, 2, 4)
_SLACK = 1e-3


@dataclass(frozen=True)
class AdaptiveTable:
    """A `Reflectance` in the adaptive parameterization.

    Attributes
    ----------
    theta_i : (T,) rising angles of incidence in radians, in [0, π/2].
    phi_i : (F,) rising azimuths of incidence in radians; isotropic where F ≤ 2.
    ndf, sigma : (R, C) D in sr⁻¹ and σ over the unit square, any size from 2 × 2.
    vndf : (F, T, R, C) ≥ 0, the density of visible normals in the unit square, of any scale.
    table : (F, T, R, C, channels) M, signed: colours outside the gamut are negative.
    jacobian : whether D/(4σ) is still to be multiplied, as in every published file; else M is f cosθo.
    facts : where it comes from (JSON-able), for the provenance of samples.

    Raises BadInput if shapes disagree, angles do not increase, a slice of `vndf` is zero everywhere, or the azimuths
    cover neither a whole, a half nor a quarter turn.
    """

    theta_i: Tensor
    phi_i: Tensor
    ndf: Tensor
    sigma: Tensor
    vndf: Tensor
    table: Tensor
    jacobian: bool
    channels: tuple[str, ...]
    facts: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what cannot be evaluated."""
        slices = (len(self.phi_i), len(self.theta_i))
        shapes = {
            "ndf": (self.ndf, (), ()),
            "sigma": (self.sigma, (), ()),
            "vndf": (self.vndf, slices, ()),
            "table": (self.table, slices, (len(self.channels),)),
        }
        for name, (tensor, before, after) in shapes.items():
            shape = tuple(tensor.shape)
            inner = shape[len(before) : len(shape) - len(after)]
            if shape != (*before, *inner, *after) or len(inner) != 2 or min(inner) < 2:
                wanted = ", ".join(map(str, (*before, "R", "C", *after)))
                raise BadInput(f"{name} has shape {shape}", expected=f"({wanted}) with R, C >= 2")
        for name, angles, low, high in (
            ("theta_i", self.theta_i, 0, math.pi / 2),
            ("phi_i", self.phi_i, -2 * math.pi, 2 * math.pi),
        ):
            _check_angles(name, angles, low, high)
        for name in ("ndf", "sigma", "vndf"):
            if bool((getattr(self, name) < 0).any()):
                raise BadInput(f"{name} has negative values", expected="a density >= 0")
        if not bool((self.vndf.double().sum((2, 3)) > 0).all()):
            raise BadInput("vndf has a slice that is 0 throughout", expected="a density")
        if not self.isotropic:
            covered = 2 * math.pi / float(self.phi_i[-1] - self.phi_i[0])
            if self._cover not in _COVERS or abs(covered - self._cover) > _SLACK * self._cover:
                raise BadInput(
                    f"phi_i covers {360 / covered:.4g} degrees",
                    expected="360, 180 or 90",
                    hint="or one or two angles where the material is isotropic",
                )

    @property
    def isotropic(self) -> bool:
        """Whether the table is isotropic: it has at most two azimuths φi, as in the published files."""
        return len(self.phi_i) <= 2

    @property
    def nbytes(self) -> int:
        """Bytes of the tables that an evaluation reads, as stored."""
        return sum(x.nbytes for x in (self.theta_i, self.phi_i, self.ndf, self.sigma, self.vndf, self.table))

    @property
    def fetches(self) -> int:
        """Table lookups of one value: D, σ, and density and M of each slice (a bilinear lookup counts once)."""
        return 2 * self._blended + (2 if self.jacobian else 0)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon.

        Negative values (colours outside the gamut) are 0; cosθo below 1e-6 counts as 1e-6.
        """
        return self.signed(wi, wo).clamp_min(0)

    def signed(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the values of `evaluate`, but keep negative values of the table."""
        values = torch.zeros(len(wi), len(self.channels), dtype=wi.dtype, device=wi.device)
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0)).nonzero()[:, 0]
        for rows in above.split(max(1, _CHUNK // len(self.channels))):
            values_there = self._with_cosine(*(w[rows].to(self.table.device, torch.float64) for w in (wi, wo)))
            values[rows] = values_there.to(values) / grazing(wo[rows, 2:])
        return values

    def sample(self, count: int = DEFAULT_COUNT, scheme: str = "discs", seed: int = 0) -> Samples:
        """Return samples from `sample_model`; provenance["faults"] counts negative values, which become 0.

        Raises what `sample_model` raises.
        """
        samples = sample_model(self, count, scheme, seed, noise_free=False)
        faults = dict(self.facts.get("faults", {})) | self.faults_at(samples.wi, samples.wo)
        samples.provenance.update(self.facts | {"faults": faults})
        return samples

    def faults_at(self, wi: Tensor, wo: Tensor) -> dict[str, int]:
        """Count the values at pairs (N, 3) that are negative, which `evaluate` returns as 0, and those that are 0."""
        values = self.signed(wi, wo)
        below = values < 0
        return {
            "negative_values": int(below.sum()),
            "samples_with_negative_values": int(below.any(1).sum()),
            "exact_zeros": int((values == 0).sum()),
        }

    @cached_property
    def _warp(self) -> MarginalConditional:
        return MarginalConditional.of(self.vndf.flatten(0, 1))

    @property
    def _cover(self) -> int:
        return round(2 * math.pi / float(self.phi_i[-1] - self.phi_i[0]))

    @property
    def _blended(self) -> int:
        return min(len(self.phi_i), 2) * min(len(self.theta_i), 2)

    def _with_cosine(self, wi: Tensor, wo: Tensor) -> Tensor:
        """f cosθo (N, C), signed, float64."""
        if not self.isotropic:
            wi, wo = self._folded(wi, wo)
        theta_i, phi_i = to_spherical(wi)
        theta_m, phi_m = to_spherical(half_vector(wi, wo)[0])
        u_m = _square(theta_m, phi_m - phi_i if self.isotropic else phi_m)
        slices, weights = self._slices(theta_i, self._wrapped(phi_i))
        s = self._warp.invert(u_m, slices, weights)
        values = bilinear(self.table.flatten(0, 1), s, slices, weights)
        if not self.jacobian:
            return values
        area = bilinear(self.sigma, _square(theta_i, phi_i))
        facets = bilinear(self.ndf, u_m)
        # Where no facet is seen nothing is reflected.
        return values * torch.where(area > 0, facets / (4 * torch.where(area > 0, area, 1)), 0)[:, None]

    def _slices(self, theta: Tensor, phi: Tensor) -> tuple[Tensor, Tensor]:
        """(numbers of the slices, their weights), both (N, 1, 2 or 4), that an incidence is blended from."""
        slices = torch.zeros(len(theta), 1, dtype=torch.long, device=theta.device)
        weights = torch.ones(len(theta), 1, dtype=torch.float64, device=theta.device)
        for nodes, angle in ((self.phi_i, phi), (self.theta_i, theta)):
            slices = slices * len(nodes)
            if len(nodes) > 1:
                grid = nodes.double()
                index = (torch.searchsorted(grid, angle, right=True) - 1).clamp(0, len(grid) - 2)
                place = ((angle - grid[index]) / (grid[index + 1] - grid[index])).clamp(0, 1)[:, None]
                slices = torch.cat((slices + index[:, None], slices + index[:, None] + 1), 1)
                weights = torch.cat((weights * (1 - place), weights * place), 1)
        return slices, weights

    def _wrapped(self, phi: Tensor) -> Tensor:
        """Azimuths turned into the one turn that begins at the first φi; isotropic ones as they are."""
        first = float(self.phi_i[0])
        return phi if self.isotropic else first + torch.remainder(phi - first, 2 * math.pi)

    def _folded(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
        """Both directions turned half round, and mirrored, where that brings ωi's azimuth among the slices."""
        first = float(self.phi_i[0])
        turn = torch.remainder(to_spherical(wi)[1] - first, 2 * math.pi)
        signs = torch.ones_like(wi)
        if self._cover >= 2:
            signs[:, :2] = torch.where(turn > math.pi, -1.0, 1.0)[:, None]
            turn = torch.remainder(turn, math.pi)
        wi, wo = signs * wi, signs * wo
        if self._cover == 4:
            # The line between the quarters, φ = first + π/2; v ↦ its image there.
            cos, sin = math.cos(2 * first + math.pi), math.sin(2 * first + math.pi)
            image = wi.new_tensor([[cos, sin, 0], [sin, -cos, 0], [0, 0, 1]])
            beyond = (turn > math.pi / 2)[:, None]
            wi, wo = torch.where(beyond, wi @ image, wi), torch.where(beyond, wo @ image, wo)
        return wi, wo


def _square(theta: Tensor, phi: Tensor) -> Tensor:
    """Angles in radians as points (N, 2) of the unit square, the azimuth wrapped."""
    return torch.stack(((theta * (2 / math.pi)).sqrt(), torch.remainder(phi / (2 * math.pi) + 0.5, 1)), 1)


def _check_angles(name: str, angles: Tensor, low: float, high: float) -> None:
    if angles.dim() != 1 or len(angles) == 0 or not bool((angles.diff() > 0).all()):
        raise BadInput(f"{name} has {tuple(angles.shape)} angles that do not rise", expected="rising radians")
    least, most = float(angles[0]), float(angles[-1])
    if least < low - _SLACK or most > high + _SLACK:
        raise BadInput(f"{name} is {least:.4g} to {most:.4g}", expected=f"radians within {low:.4g} to {high:.4g}")
