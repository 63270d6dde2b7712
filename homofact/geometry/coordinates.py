"""The named coordinates that a texture may be indexed by.

Each system takes a pair of directions to k numbers. Two kinds of domain:

* discs: parabolic coordinates of two unit vectors, k = 4, the product of two unit discs;
* box: k angles, each scaled to [−1, 1].

`swap` is the k × k signed permutation S with x(ωo, ωi) = S x(ωi, ωo), by which the conjugate of a
projection P (thesis 3.2.3) is P S. For isotropic half-diff it is the identity: φd is folded by
reciprocity (φd ~ φd + π) and left-right symmetry (φd ~ −φd) to [0, π/2], and a projection of it is
reciprocal by itself. Here φd is Rusinkiewicz's, measured in the frame turned with h (so that it does
not depend on the azimuth), not in the Kautz-McCool frame of half-diff, which is fixed to the tangent.

Half-angles are θh, with the same scale, and φh, the azimuth of h from the tangent, for materials whose highlight knows
the tangent. φh/π runs once round from −1 to +1, which are one place: a periodic axis. A matrix row may take it as it
is, but not mixed with another axis, for a mix would jump there; so this system has fixed projections only. Swapping
ωi and ωo leaves h alone. At θh = 0 φh is undefined (0 is given) and all of its values are one place, the pole.

Axes of one name are the same function in all systems.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.directions import half_difference, normalize, to_spherical
from homofact.geometry.parabolic import to_disc


@dataclass(frozen=True)
class CoordinateSystem:
    """A named map from pairs of directions (N, 3), (N, 3) to coordinates (N, k).

    `axes` names the k coordinates; `swap` is described in the module's head; `isotropic` says that the
    coordinates do not change when both directions are turned about the normal together. `periodic` names the axes
    that go round, once from −1 to +1; where the axis `pole` is −1, they mean nothing.
    """

    name: str
    axes: tuple[str, ...]
    domain: str
    swap: tuple[tuple[float, ...], ...]
    isotropic: bool
    evaluate: Callable[[Tensor, Tensor], Tensor]
    periodic: tuple[str, ...] = ()
    pole: str | None = None

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


def _half_angles(wi: Tensor, wo: Tensor) -> Tensor:
    # Its length does not matter to angles.
    theta_h, phi_h = to_spherical(wi + wo)
    return torch.stack((theta_h * (4 / torch.pi) - 1, phi_h / torch.pi), -1)


COORDINATES = {
    system.name: system
    for system in (
        CoordinateSystem(
            "in-out",
            ("u_i", "v_i", "u_o", "v_o"),
            "discs",
            ((0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 0, 0), (0, 1, 0, 0)),
            False,
            _in_out,
        ),
        CoordinateSystem(
            "half-diff",
            ("u_h", "v_h", "u_d", "v_d"),
            "discs",
            ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, -1)),
            False,
            _half_diff,
        ),
        CoordinateSystem(
            "isotropic-half-diff",
            ("theta_h", "theta_d", "phi_d"),
            "box",
            ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
            True,
            _isotropic_half_diff,
        ),
        CoordinateSystem(
            "isotropic-in-out",
            ("theta_i", "theta_o", "delta_phi"),
            "box",
            ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
            True,
            _isotropic_in_out,
        ),
        CoordinateSystem(
            "half-angles",
            ("theta_h", "phi_h"),
            "box",
            ((1, 0), (0, 1)),
            False,
            _half_angles,
            periodic=("phi_h",),
            pole="theta_h",
        ),
    )
}


def coordinate_system(name: str) -> CoordinateSystem:
    """The system called `name`. Raises BadInput that lists the names."""
    if name not in COORDINATES:
        raise BadInput(f"parameterization: found {name!r}, expected one of {', '.join(COORDINATES)}")
    return COORDINATES[name]
