"""The named coordinates that a texture may be indexed by.

Each system takes a pair of directions to k numbers. Two kinds of domain:

* discs: parabolic coordinates of two unit vectors, k = 4, the product of two unit discs;
* box: k angles, each scaled to [−1, 1].

`swap` is the k × k signed permutation S with x(ωo, ωi) = S x(ωi, ωo), by which the conjugate of a
projection P (thesis 3.2.3) is P S. For isotropic half-diff it is the identity: φd is folded by
reciprocity (φd ~ φd + π) and left-right symmetry (φd ~ −φd) to [0, π/2], and a projection of it is
reciprocal by itself. Here φd is Rusinkiewicz's, measured in the frame turned with h (so that it does
not depend on the azimuth), not in the Kautz-McCool frame of half-diff, which is fixed to the tangent.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.directions import half_difference, normalize, to_spherical
from homofact.geometry.names import HALF_DIFF, IN_OUT, ISOTROPIC_HALF_DIFF, ISOTROPIC_IN_OUT
from homofact.geometry.parabolic import to_disc


@dataclass(frozen=True)
class CoordinateSystem:
    """A named map from pairs of directions (N, 3), (N, 3) to coordinates (N, k).

    `axes` names the k coordinates; `swap` is described in the module's head; `isotropic` says that the
    coordinates do not change when both directions are turned about the normal together.
    """

    name: str
    axes: tuple[str, ...]
    domain: str
    swap: tuple[tuple[float, ...], ...]
    isotropic: bool
    evaluate: Callable[[Tensor, Tensor], Tensor]

    @property
    def dimension(self) -> int:
        """k, the number of coordinates."""
        return len(self.axes)


def _in_out(wi: Tensor, wo: Tensor) -> Tensor:
    return torch.cat((to_disc(wi), to_disc(wo)), -1)


def _half_diff(wi: Tensor, wo: Tensor) -> Tensor:
    h, d = half_difference(wi, wo)
    return torch.cat((to_disc(h), to_disc(d)), -1)


def rusinkiewicz_angles(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(θh, θd, φd) in radians (Rusinkiewicz 1998), φd folded to [0, π/2].

    φd is the azimuth of ωi about h, from the plane of n and h: the component of ωi across that plane
    is (n × h)·ωi / |n × h|, the one within it, at right angles to h, (n − (n·h)h)·ωi / |n × h|. The fold
    leaves only their sizes. At h = n the plane is undefined; φd is 0 there.
    """
    h = normalize(wi + wo)
    theta_h, _ = to_spherical(h)
    cos_d = (wi * h).sum(-1)
    sin_d = (wi - wo).norm(dim=-1) / 2
    theta_d = torch.atan2(sin_d, cos_d)
    # |n × h| scales both components alike, so neither is normalised.
    across = h[..., 0] * wi[..., 1] - h[..., 1] * wi[..., 0]
    along = wi[..., 2] - cos_d * h[..., 2]
    return theta_h, theta_d, torch.atan2(across.abs(), along.abs())


def _isotropic_half_diff(wi: Tensor, wo: Tensor) -> Tensor:
    return torch.stack(rusinkiewicz_angles(wi, wo), -1) * (4 / torch.pi) - 1


def _isotropic_in_out(wi: Tensor, wo: Tensor) -> Tensor:
    theta_i, phi_i = to_spherical(wi)
    theta_o, phi_o = to_spherical(wo)
    turn = torch.remainder(phi_i - phi_o + torch.pi, 2 * torch.pi) - torch.pi
    # |Δφ| in [0, π]: left-right symmetry folds the sign away.
    return torch.stack((theta_i * 2, theta_o * 2, turn.abs()), -1) * (2 / torch.pi) - 1


COORDINATES = {
    system.name: system
    for system in (
        CoordinateSystem(
            IN_OUT,
            ("u_i", "v_i", "u_o", "v_o"),
            "discs",
            ((0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 0, 0), (0, 1, 0, 0)),
            False,
            _in_out,
        ),
        CoordinateSystem(
            HALF_DIFF,
            ("u_h", "v_h", "u_d", "v_d"),
            "discs",
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, -1)),
            False,
            _half_diff,
        ),
        CoordinateSystem(
            ISOTROPIC_HALF_DIFF,
            ("theta_h", "theta_d", "phi_d"),
            "box",
            ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
            True,
            _isotropic_half_diff,
        ),
        CoordinateSystem(
            ISOTROPIC_IN_OUT,
            ("theta_i", "theta_o", "delta_phi"),
            "box",
            ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
            True,
            _isotropic_in_out,
        ),
    )
}


def coordinate_system(name: str) -> CoordinateSystem:
    """The system called `name`. Raises BadInput that lists the names."""
    if name not in COORDINATES:
        raise BadInput(f"coordinates: found {name!r}, expected one of {', '.join(COORDINATES)}")
    return COORDINATES[name]
