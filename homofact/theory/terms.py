"""How many in-out terms a BRDF needs: predicted from its spectrum, and counted in its decomposition.

Mahajan, Tseng and Ramamoorthi (2008): for a lobe about the mirror direction, the singular values on the sphere are F_l
= Λ_l ρ̂_l, 2l+1 times each (eq. 9), so K = (l* + 1)² (eq. 10); on hemispheres, about l + 1 of these 2l+1 remain, which
is half as many terms (eq. 13). For models of the half angle K ≈ (l*)²/4 (section 4). "Energy" is Σσ². For a Phong lobe
with exponent s, F_l ≈ exp(−l²/2s). In the limit of large s, the share p of the energy needs K = s ln(1/(1 − p)) terms
on the sphere, 4.6 s for 99%; the paper counts 5 s.

K of a half-angle model depends on the largest angle of the directions. Towards the horizon, the lobe narrows across the
plane of incidence as cosθo (Ramamoorthi 2002, eq. 3.52), and the number of terms per solid angle grows as 1/cosθ, whose
integral to the horizon diverges. The angles therefore have a `limit`, by default 85°; the paper leaves out grazing
angles too.
"""

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import Symmetry, find_symmetry
from homofact.errors import BadInput
from homofact.theory.half_curve import ORDER, half_angle_curve
from homofact.theory.harmonics import check_share
from homofact.theory.in_out import Decomposition, DirectionGrid, count_for_share, decompose

LIMIT = math.radians(85)
# Rings of the grids that are tried in turn, and azimuths a ring; an anisotropic matrix is of all pairs of both.
_ISOTROPIC_GRIDS = tuple((n, 3 * n) for n in (24, 36, 54, 80, 120))
_ANISOTROPIC_GRIDS = ((12, 36), (16, 48), (20, 60))
_SETTLED = 0.03
# A reflectance that reads so many numbers for one value would take minutes on the finest grid.
_SLOW = 256


@dataclass(frozen=True)
class InOutCount:
    """How many in-out terms hold `share` of the energy (Σσ², mean of the channels, solid angle up to `limit` radians).

    `predicted` is (l* + 1)²/4 rounded, at least 1; `measured` is counted in the decomposition on `grid` (rings, turns);
    `settled` is True if the next coarser grid gave the same count within 3% (or one term); otherwise `measured` is a
    rough count, which may be too large or too small. `l_star_settled` is True if l* is below the curve's highest order;
    otherwise l* is a lower bound. `singular_values` decrease.
    """

    share: float
    limit: float
    l_star: float
    predicted: int
    measured: int
    settled: bool
    l_star_settled: bool
    grid: tuple[int, int]
    singular_values: Tensor

    def record(self) -> dict[str, Any]:
        """Return the JSON form, angles in degrees, without the singular values."""
        return {
            "share": self.share,
            "limit_degrees": math.degrees(self.limit),
            "l_star": self.l_star,
            "predicted": self.predicted,
            "measured": self.measured,
            "settled": self.settled,
            "l_star_settled": self.l_star_settled,
            "grid": list(self.grid),
        }


def predicted_terms(reflectance: Reflectance, share: float = 0.99, limit: float = LIMIT) -> InOutCount:
    """Return the number of in-out terms predicted from the half-angle curve's l*, beside the number counted.

    Raises BadInput for a share outside (0, 1), a limit outside (0, 90°] and a reflectance without energy.
    """
    check_share(share)
    check_limit(limit)
    l_star = half_angle_curve(reflectance, limit).l_star(share)
    symmetry = find_symmetry(reflectance, limit)
    decomposition, settled = settled_decomposition(reflectance, share, limit, symmetry)
    grid = (decomposition.grid.rings, decomposition.grid.turns)
    values = decomposition.values()
    return InOutCount(
        share=share,
        limit=limit,
        l_star=l_star,
        predicted=half_angle_terms(l_star),
        measured=count_for_share(values, share),
        settled=settled,
        l_star_settled=l_star < ORDER,
        grid=grid,
        singular_values=values,
    )


def settled_decomposition(
    reflectance: Reflectance, share: float, limit: float = LIMIT, symmetry: Symmetry | None = None
) -> tuple[Decomposition, bool]:
    """Return (the channels' mean decomposed on a grid that is fine enough for `share`, whether the count settled).

    Grids are refined until the count agrees with the previous count within 3% or one term; if none does, the finest
    grid is used.
    """
    known = find_symmetry(reflectance, limit) if symmetry is None else symmetry
    before, decomposition = None, None
    grids = _ISOTROPIC_GRIDS if known.isotropic else _ANISOTROPIC_GRIDS
    for rings, turns in grids[:-1] if reflectance.fetches > _SLOW else grids:
        decomposition = decompose(reflectance, DirectionGrid(rings, turns, limit), known, mean=True)
        count = decomposition.count(share)
        if before is not None and abs(count - before) <= max(1, _SETTLED * count):
            return decomposition, True
        before = count
    assert decomposition is not None
    return decomposition, False


def half_angle_terms(l_star: float) -> int:
    """K = (l* + 1)²/4 of a half-angle model, rounded, at least 1."""
    return max(1, round((l_star + 1) ** 2 / 4))


def mirror_terms(brdf_filter: Tensor, share: float = 0.99, hemisphere: bool = False) -> int:
    """K of a lobe about the mirror direction with F_l = Λ_l ρ̂_l (order+1,): each 2l+1 times, l+1 on a hemisphere.

    Raises BadInput for a share outside (0, 1).
    """
    degree = torch.arange(len(brdf_filter))
    times = degree + 1 if hemisphere else 2 * degree + 1
    values = brdf_filter.abs().repeat_interleave(times).sort(descending=True).values
    return count_for_share(values, share)


def phong_terms(exponent: float, share: float = 0.99, hemisphere: bool = False) -> float:
    """s ln(1/(1 − share)), the limit of Phong's K for a large exponent s; half of it on a hemisphere (4.6 s, 2.3 s)."""
    check_share(share)
    return exponent * -math.log1p(-share) * (0.5 if hemisphere else 1.0)


def check_limit(limit: float) -> None:
    """Raise BadInput for a limit, in radians, that is not above 0 and at most 90°."""
    if not 0 < limit <= math.pi / 2 + 1e-12:
        raise BadInput(where="limit", found=f"{math.degrees(limit):g} degrees", expected="above 0 and at most 90")
