"""BRDF matrices of WINDOW and Radiance: one constant value per pair of patches of an angle basis.

A basis divides the hemisphere into rings of θ, and each ring into patches of equal width in azimuth. The first patch of
a ring is centred at azimuth 0 (Klems 1994; names and bounds as in Radiance). The patch number of the light is that of
its direction rotated by 180° about the normal, so the mirror direction has the same patch number as the light.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical, to_spherical

# How far a matrix may be from one that depends on the difference of azimuths alone, to be taken as isotropic.
_ISOTROPIC = 0.03
_MOST_PATCHES = 20_000


@dataclass(frozen=True)
class KlemsBasis:
    """The rings of a basis: `bounds` (rings + 1) in degrees from 0 to 90, and `counts` (rings), patches of each.

    Raises BadInput for bounds that do not rise from 0 to 90 and counts below 1.
    """

    name: str
    bounds: tuple[float, ...]
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        """Refuse rings that are no division of the hemisphere."""
        rising = all(low < high for low, high in pairwise(self.bounds))
        if len(self.bounds) != len(self.counts) + 1 or not rising or abs(self.bounds[0]) > 1e-6:
            found = f"basis {self.name} with bounds {self.bounds[:12]}"
            raise BadInput(found, expected="bounds that rise from 0 to 90")
        if abs(self.bounds[-1] - 90) > 1e-6 or not all(1 <= n <= _MOST_PATCHES for n in self.counts):
            found = f"basis {self.name} with counts {self.counts[:12]} up to {self.bounds[-1]:g}"
            raise BadInput(found, expected="at least 1 in each ring, up to 90")

    @property
    def size(self) -> int:
        """The number of patches."""
        return sum(self.counts)

    @cached_property
    def rings(self) -> Tensor:
        """The ring (size,) of each patch."""
        return torch.repeat_interleave(torch.arange(len(self.counts)), torch.tensor(self.counts))

    @cached_property
    def places(self) -> Tensor:
        """The number within its ring (size,) of each patch."""
        return torch.cat([torch.arange(n) for n in self.counts])

    @cached_property
    def solid_angles(self) -> Tensor:
        """Solid angles (size,) in sr."""
        edges = torch.cos(torch.tensor(self.bounds, dtype=torch.float64).deg2rad())
        return (2 * math.pi * (edges[:-1] - edges[1:]) / torch.tensor(self.counts))[self.rings]

    @cached_property
    def projected(self) -> Tensor:
        """Projected solid angles ∫ cosθ dω (size,) in sr; their sum is π."""
        edges = torch.cos(torch.tensor(self.bounds, dtype=torch.float64).deg2rad()) ** 2
        return (math.pi * (edges[:-1] - edges[1:]) / torch.tensor(self.counts))[self.rings]

    def index(self, w: Tensor) -> Tensor:
        """Return the patch (N,) of directions (N, 3) above the horizon."""
        theta, phi = to_spherical(w)
        inner = torch.tensor(self.bounds[1:-1], dtype=theta.dtype)
        ring = torch.searchsorted(inner, theta.rad2deg().contiguous(), right=True)
        counts = torch.tensor(self.counts)
        first = torch.cumsum(counts, 0) - counts
        place = torch.floor(torch.remainder(phi, 2 * math.pi) / (2 * math.pi) * counts[ring] + 0.5).long()
        return first[ring] + torch.where(place >= counts[ring], 0, place)

    def inside(self, across: Tensor, along: Tensor) -> Tensor:
        """Map `across` and `along` (K,) in [0, 1] to directions (size, K, 3) in each patch, uniform in cosθ dω."""
        edges = torch.cos(torch.tensor(self.bounds, dtype=torch.float64).deg2rad()) ** 2
        low, high = edges[:-1][self.rings][:, None], edges[1:][self.rings][:, None]
        cosine = torch.sqrt((low + (high - low) * across).clamp(0, 1))
        count = torch.tensor(self.counts)[self.rings][:, None]
        return from_spherical(torch.acos(cosine), 2 * math.pi * (self.places[:, None] + along - 0.5) / count)

    def mirrored(self) -> Tensor:
        """Return the patch (size,) that each patch becomes if the x axis is reversed.

        Raises BadInput if a ring has an odd number of patches greater than 1.
        """
        count = torch.tensor(self.counts)[self.rings]
        if any(n % 2 and n > 1 for n in self.counts):
            raise BadInput(f"basis {self.name} with counts {self.counts}", expected="even numbers, or 1")
        return torch.arange(self.size) - self.places + torch.remainder(count // 2 - self.places, count)

    def middles(self) -> Tensor:
        """Return directions (size, 3) at the middle of each patch; the normal for a patch that is a whole cap."""
        bounds = torch.tensor(self.bounds, dtype=torch.float64)
        theta = ((bounds[1:] + bounds[:-1]) / 2)[self.rings]
        count = torch.tensor(self.counts)[self.rings]
        theta = torch.where((count == 1) & (self.rings == 0), 0.0, theta)
        return from_spherical(theta.deg2rad(), 2 * math.pi * self.places / count)


FULL = KlemsBasis("LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12))
HALF = KlemsBasis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90), (1, 8, 12, 16, 20, 12, 8))
QUARTER = KlemsBasis("LBNL/Klems Quarter", (0, 9, 27, 45, 63, 90), (1, 8, 12, 12, 8))
BASES = {basis.name.lower(): basis for basis in (FULL, HALF, QUARTER)}


def planar(w: Tensor, flipped: bool) -> Tensor:
    """Return directions (..., 3) in the axes of a file, with x reversed if `flipped`.

    In these axes x points right and y up, seen from Radiance's front. A surface frame on the other side has its x axis
    reversed: `flipped`.
    """
    return w * w.new_tensor([-1.0, 1.0, 1.0]) if flipped else w


def opposite(w: Tensor) -> Tensor:
    """Return directions (..., 3) rotated by 180° about the normal: the mirror directions."""
    return w * w.new_tensor([-1.0, -1.0, 1.0])


@dataclass(frozen=True)
class KlemsTable:
    """A `Reflectance` of a matrix.

    Attributes
    ----------
    light, view : the bases of both directions.
    values : (light.size, view.size, C) in sr⁻¹ without the cosine, the mean over each pair of patches.
    flipped : whether the surface's x points to the left of the file's axes (`planar`).
    """

    light: KlemsBasis
    view: KlemsBasis
    values: Tensor
    channels: tuple[str, ...]
    flipped: bool = False

    @property
    def nbytes(self) -> int:
        """Bytes of the matrix."""
        return self.values.nbytes

    @property
    def fetches(self) -> int:
        """One: the matrix entry."""
        return 1

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
        light = self.light.index(opposite(planar(wi[above].double(), self.flipped)))
        view = self.view.index(planar(wo[above].double(), self.flipped))
        values = torch.zeros(len(wi), len(self.channels), dtype=wi.dtype)
        values[above] = self.values[light, view].to(values)
        return values

    def nodes(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return (wi, wo, values, weights) at the middles of all pairs of patches; weights are solid angles, mean 1."""
        wi = planar(opposite(self.light.middles()), self.flipped)
        wo = planar(self.view.middles(), self.flipped)
        weights = (self.light.solid_angles[:, None] * self.view.solid_angles).reshape(-1)
        light, view = len(wi), len(wo)
        return (
            wi[:, None].expand(light, view, 3).reshape(-1, 3),
            wo.expand(light, view, 3).reshape(-1, 3),
            self.values.reshape(-1, len(self.channels)).double(),
            weights / weights.mean(),
        )

    @cached_property
    def _kinds(self) -> Tensor:
        """Which entries (light.size · view.size,) have equal θi, θo and |Δφ|: a number from 0 for each such set."""
        light, view = self.light, self.view
        turns = math.lcm(*light.counts, *view.counts)
        steps = [turns // torch.tensor(basis.counts)[basis.rings] * basis.places for basis in (light, view)]
        gap = torch.remainder(steps[1] - steps[0][:, None], turns)
        gap = torch.minimum(gap, turns - gap)
        kind = (light.rings[:, None] * len(view.counts) + view.rings) * turns + gap
        return kind.reshape(-1).unique(return_inverse=True)[1]

    def averaged(self) -> "KlemsTable":
        """Return an isotropic table: entries of equal θi, θo and |Δφ| are replaced by their mean."""
        kind, count = self._kinds, int(self._kinds.max()) + 1
        flat = self.values.double().reshape(-1, len(self.channels))
        total = torch.zeros(count, len(self.channels), dtype=torch.float64).index_add_(0, kind, flat)
        mean = total / torch.bincount(kind, minlength=count)[:, None]
        return replace(self, values=mean[kind].reshape(self.values.shape))

    @cached_property
    def anisotropy(self) -> float:
        """Mean difference from the `averaged` table over the mean value, weighted by projected solid angles."""
        weights = self.light.projected[:, None] * self.view.projected
        own, mean = (each.values.double().sum(2) for each in (self, self.averaged()))
        total = float((weights * own).sum())
        return float((weights * (own - mean).abs()).sum()) / total if total else 0.0

    @property
    def isotropic(self) -> bool:
        """Whether entries of equal θi, θo and |Δφ| differ by less than 3% in the mean."""
        return self.anisotropy < _ISOTROPIC

    def other_side(self) -> "KlemsTable":
        """Return the table for the other side of a file, where x points the other way.

        Raises BadInput for a basis with an odd number of patches in a ring, whose mirror image is another basis.
        """
        light, view = self.light.mirrored(), self.view.mirrored()
        return replace(self, values=self.values[light][:, view], flipped=not self.flipped)
