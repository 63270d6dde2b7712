"""The input parameterizations of the ALTA library that determine the directions of light and viewer.

Names and definitions are those of ALTA's documentation (class `params`): L towards the light, V towards the
viewer, N = z, H = (V + L)/|V + L|; angles in radians. In the half/difference family D is V in the frame of H
(turned back by φH about z, then by θH about y), and L is V mirrored at H. If a parameterization omits an angle, the
reader uses the value that ALTA uses, and `open` records it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.geometry.directions import from_spherical, normalize, to_spherical


@dataclass(frozen=True)
class Parameterization:
    """`columns` numbers per row; `directions` turns rows (N, columns) into (L, V), each (N, 3).

    Some rows have no solution: their directions are then not finite, or lie below the horizon. `isotropic` is true if
    the numbers leave out the azimuth of the whole pair, `angles` if all numbers are angles.
    """

    columns: int
    isotropic: bool
    directions: Callable[[Tensor], tuple[Tensor, Tensor]]
    open: str | None = None
    angles: bool = True


def _half(theta_h: Tensor, phi_h: Tensor, theta_d: Tensor, phi_d: Tensor) -> tuple[Tensor, Tensor]:
    d = from_spherical(theta_d, phi_d)
    cos, sin = torch.cos(theta_h), torch.sin(theta_h)
    x, z = cos * d[:, 0] + sin * d[:, 2], cos * d[:, 2] - sin * d[:, 0]
    cos, sin = torch.cos(phi_h), torch.sin(phi_h)
    view = torch.stack((cos * x - sin * d[:, 1], sin * x + cos * d[:, 1], z), -1)
    h = from_spherical(theta_h, phi_h)
    return 2 * (view * h).sum(-1, keepdim=True) * h - view, view


def _half_vectors(x: Tensor) -> tuple[Tensor, Tensor]:
    theta_h, phi_h = to_spherical(normalize(x[:, :3]))
    return _half(theta_h, phi_h, *to_spherical(normalize(x[:, 3:])))


def _projected(theta_l: Tensor, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    return from_spherical(theta_l, 0 * theta_l), from_spherical(torch.hypot(x, y), torch.atan2(y, x))


def _retro(x: Tensor) -> tuple[Tensor, Tensor]:
    # V lies at the angle θVL from L, in the direction φ from the meridian of L: φ = 0 is towards the normal.
    theta_l, distance, phi = x[:, 0], torch.hypot(x[:, 1], x[:, 2]), torch.atan2(x[:, 2], x[:, 1])
    light = from_spherical(theta_l, 0 * theta_l)
    zero = torch.zeros_like(theta_l)
    towards_normal = torch.stack((-torch.cos(theta_l), zero, torch.sin(theta_l)), -1)
    across = torch.stack((zero, zero + 1, zero), -1)
    side = torch.cos(phi)[:, None] * towards_normal + torch.sin(phi)[:, None] * across
    return light, torch.cos(distance)[:, None] * light + torch.sin(distance)[:, None] * side


def _zero(x: Tensor) -> Tensor:
    return torch.zeros_like(x[:, 0])


PARAMETERIZATIONS = {
    "RUSIN_TH_PH_TD_PD": Parameterization(4, False, lambda x: _half(*x.unbind(1))),
    "RUSIN_TH_PH_TD": Parameterization(3, False, lambda x: _half(x[:, 0], x[:, 1], x[:, 2], _zero(x)), "φd taken as 0"),
    "RUSIN_TH_TD_PD": Parameterization(3, True, lambda x: _half(x[:, 0], _zero(x), x[:, 1], x[:, 2])),
    "RUSIN_TH_TD": Parameterization(
        2, True, lambda x: _half(x[:, 0], _zero(x), x[:, 1], _zero(x) + math.pi / 2), "φd taken as π/2"
    ),
    "RUSIN_VH_VD": Parameterization(6, False, _half_vectors, angles=False),
    "COS_TH_TD": Parameterization(
        2, True, lambda x: _half(torch.acos(x[:, 0]), _zero(x), torch.acos(x[:, 1]), _zero(x)), "φd taken as 0"
    ),
    "COS_TH": Parameterization(
        1, True, lambda x: _half(torch.acos(x[:, 0]), _zero(x), _zero(x), _zero(x)), "θd and φd taken as 0"
    ),
    "ISOTROPIC_TV_TL_DPHI": Parameterization(
        3, True, lambda x: (from_spherical(x[:, 1], x[:, 2]), from_spherical(x[:, 0], _zero(x)))
    ),
    "ISOTROPIC_TL_TV_PROJ_DPHI": Parameterization(3, True, lambda x: _projected(*x.unbind(1))),
    "ISOTROPIC_TV_PROJ_DPHI": Parameterization(2, True, lambda x: _projected(_zero(x), *x.unbind(1)), "θl taken as 0"),
    "RETRO_TL_TVL_PROJ_DPHI": Parameterization(3, True, _retro),
    "SPHERICAL_TL_PL_TV_PV": Parameterization(
        4, False, lambda x: (from_spherical(x[:, 0], x[:, 1]), from_spherical(x[:, 2], x[:, 3]))
    ),
    "CARTESIAN": Parameterization(6, False, lambda x: (x[:, 3:], x[:, :3]), angles=False),
}
