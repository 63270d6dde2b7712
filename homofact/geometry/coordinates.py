"""The named coordinates that a texture may be indexed by.

Each system maps a pair of directions to k numbers. There are two kinds of domain:

* discs: coordinates of two unit vectors on a direction map, k = 4; on the parabolic map the product of two unit discs;
* box: k angles, each scaled to [−1, 1].

`axes` defines all axes as expressions; a system lists its axes and their scales.

`swap` is the k × k signed permutation S with x(ωo, ωi) = S x(ωi, ωo), by which the conjugate of a
projection P (thesis 3.2.3) is P S. For isotropic half-diff it is the identity: φd is folded by
reciprocity (φd ~ φd + π) and left-right symmetry (φd ~ −φd) to [0, π/2], and a projection of it is
reciprocal by itself. Here φd is Rusinkiewicz's, measured in the frame turned with h (so that it does
not depend on the azimuth), not in the Kautz-McCool frame of half-diff, which is fixed to the tangent.

φd is undefined if h is the normal or if ωi = ωo. Δφ is undefined if ωi or ωo is the normal. A texture over these
coordinates shows a star-shaped artefact there. Two systems replace them by coordinates that are continuous on the
sphere. Together with θh and θd, the tilt |cosθi − cosθo| determines φd: isotropic half-tilt, which is reciprocal by
itself like isotropic half-diff. Together with θi and θo, θd determines |Δφ|: isotropic angles, those between ωi, ωo and
the normal.

Half-angles are θh, with the same scale, and φh, the azimuth of h from the tangent, for materials whose highlight
depends on the tangent. φh/π covers the circle from −1 to +1, which are the same point: it is a periodic axis. A
projection may use it alone but not mixed with another axis, since a mix would be discontinuous at ±1. So this system
has only fixed projections. Swapping ωi and ωo does not change h. At θh = 0, the pole, φh is undefined (the code returns
0).

Axes of one name are the same function in all systems.

torch is imported only when tensors are needed, so `homofact.runtime` can use the definitions without it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from homofact.errors import BadInput
from homofact.geometry.axes import coordinates_of, stretched
from homofact.geometry.expression import Expression, Let, variable
from homofact.geometry.interpret import NUMPY, interpret, value_of
from homofact.geometry.names import (
    HALF_ANGLES,
    HALF_DIFF,
    IN_OUT,
    ISOTROPIC_ANGLES,
    ISOTROPIC_HALF_DIFF,
    ISOTROPIC_HALF_TILT,
    ISOTROPIC_IN_OUT,
)
from homofact.geometry.namespace import namespace

if TYPE_CHECKING:
    from torch import Tensor

Scales = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class CoordinateSystem:
    """A named map from pairs of directions (N, 3), (N, 3) to coordinates (N, k).

    `axes` names the k coordinates; each is factor · raw + offset, with (factor, offset) from `scales`. `swap` is
    described in the module docstring. `isotropic` is true if the coordinates do not change when both directions are
    rotated about the normal. `periodic` names the axes that cover a circle from −1 to +1. They are undefined where the
    axis `pole` is −1.
    """

    name: str
    axes: tuple[str, ...]
    scales: tuple[tuple[float, float], ...]
    domain: str
    swap: tuple[tuple[float, ...], ...]
    isotropic: bool
    periodic: tuple[str, ...] = ()
    pole: str | None = None

    @property
    def dimension(self) -> int:
        """k, the number of coordinates."""
        return len(self.axes)

    @property
    def half_axes(self) -> int:
        """How many of the first axes are the half vector's radius, which a warp stretches; 0 where there is none."""
        return {"u_h": 2, "theta_h": 1}.get(self.axes[0], 0)

    def evaluate(self, wi: "Tensor", wo: "Tensor", warp: float | None = None) -> "Tensor":
        """Return coordinates (..., k) of unit vectors (..., 3), with the half vector stretched by a `warp` width.

        Raises BadInput for a warp where there is no half vector.
        """
        return axes_of(self.axes, wi, wo, self.scales, warp)

    def stretch(self, x: "Tensor", width: float) -> "Tensor":
        """Return coordinates (..., k) without a warp with their half-vector part stretched.

        Raises BadInput as `evaluate`.
        """
        count, functions = half_axes(self.axes), _functions(x)
        columns = [x[..., k] for k in range(x.shape[-1])]
        raw = zip(self.axes[:count], columns, self.scales, strict=False)
        values = {axis: [(column - offset) / factor] for axis, column, (factor, offset) in raw}
        named = tuple(variable(axis, 1) for axis in self.axes)
        statements, axes, scales = warped(self.axes, named, self.scales, width, "warped")
        interpret(statements, values, functions)
        made = [_scaled(axis, scale, values, functions) for axis, scale in zip(axes[:count], scales, strict=False)]
        return namespace(x).stack((*made, *columns[count:]), -1)


_EXCHANGE = ((0, 0, 1, 0), (0, 0, 0, 1), (1, 0, 0, 0), (0, 1, 0, 0))
_HALF_TURN = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 0), (0, 0, 0, -1))
_ANGLE, _TURN = (4 / math.pi, -1.0), (2 / math.pi, -1.0)
_PLAIN = ((1.0, 0.0),) * 4


COORDINATES = {
    system.name: system
    for system in (
        CoordinateSystem(IN_OUT, ("u_i", "v_i", "u_o", "v_o"), _PLAIN, "discs", _EXCHANGE, False),
        CoordinateSystem(HALF_DIFF, ("u_h", "v_h", "u_d", "v_d"), _PLAIN, "discs", _HALF_TURN, False),
        CoordinateSystem(
            ISOTROPIC_HALF_DIFF,
            ("theta_h", "theta_d", "phi_d"),
            (_ANGLE,) * 3,
            "box",
            ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
            True,
        ),
        CoordinateSystem(
            ISOTROPIC_IN_OUT,
            ("theta_i", "theta_o", "delta_phi"),
            (_ANGLE, _ANGLE, _TURN),
            "box",
            ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
            True,
        ),
        CoordinateSystem(
            ISOTROPIC_ANGLES,
            ("theta_i", "theta_o", "theta_d"),
            (_ANGLE,) * 3,
            "box",
            ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
            True,
        ),
        CoordinateSystem(
            ISOTROPIC_HALF_TILT,
            ("theta_h", "theta_d", "tilt"),
            (_ANGLE, _ANGLE, (2.0, -1.0)),
            "box",
            ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
            True,
        ),
        CoordinateSystem(
            HALF_ANGLES,
            ("theta_h", "phi_h"),
            (_ANGLE, (1 / math.pi, 0.0)),
            "box",
            ((1, 0), (0, 1)),
            False,
            periodic=("phi_h",),
            pole="theta_h",
        ),
    )
}


def coordinate_system(name: str) -> CoordinateSystem:
    """Return the system called `name`. Raises BadInput that lists the names."""
    if name not in COORDINATES:
        raise BadInput(where="coordinates", found=repr(name), expected=f"one of {', '.join(COORDINATES)}")
    return COORDINATES[name]


def half_axes(axes: Sequence[str]) -> int:
    """Return how many of the first axes are the half vector's radius, which a warp stretches; 0 where there is none."""
    return {"u_h": 2, "theta_h": 1}.get(axes[0], 0)


def check_half_axes(axes: Sequence[str]) -> int:
    """Return `half_axes`, if there are any.

    Raises BadInput if there are none, since a warp then has nothing to stretch.
    """
    count = half_axes(axes)
    if count == 0:
        raise BadInput(where="warp", found=f"the coordinates {', '.join(axes)}", expected="some with a half vector")
    return count


def warped(
    names: Sequence[str], axes: Sequence[Expression], scales: Scales, width: float, name: str
) -> tuple[list[Let], list[Expression], Scales]:
    """Return (further statements, axes, scales) of coordinates whose half vector is stretched, as `axes.stretched`.

    `names` are those of the raw `axes`; `name` begins those of the statements. Raises BadInput where there is no half
    vector.
    """
    count = check_half_axes(names)
    statements, half, whole = stretched(name, list(axes[:count]), width)
    # Parabolic h keeps its direction; the angle's share of π/2 becomes a coordinate in [−1, 1].
    new = ((whole, 0.0),) * 2 if count == 2 else ((2 * whole, -1.0),)
    return statements, [*half, *axes[count:]], (*new, *scales[count:])


def axes_of(
    names: Sequence[str], wi: "Tensor", wo: "Tensor", scales: Scales | None = None, warp: float | None = None
) -> "Tensor":
    """Axes by name (..., k) of unit vectors (..., 3), raw or scaled, tensors or arrays. Raises BadInput as `warped`."""
    functions = _functions(wi)
    statements, axes, factors = _program(tuple(names), scales, warp)
    values = {name: [w[..., k] for k in range(3)] for name, w in (("wi", wi), ("wo", wo))}
    interpret(statements, values, functions)
    made = [_scaled(axis, scale, values, functions) for axis, scale in zip(axes, factors, strict=True)]
    return namespace(wi).stack(made, -1)


@lru_cache(maxsize=256)
def _program(
    names: tuple[str, ...], scales: Scales | None, warp: float | None
) -> tuple[list[Let], list[Expression], Scales]:
    made = coordinates_of(frozenset(names))
    statements, axes = list(made.statements), [made.axes[name] for name in names]
    scales = scales or ((1.0, 0.0),) * len(names)
    if warp is None:
        return statements, axes, scales
    further, axes, scales = warped(names, axes, scales, warp, "warped")
    return statements + further, axes, scales


def _functions(array: Any) -> Mapping[str, Callable[..., Any]]:
    if namespace(array) is np:
        return NUMPY
    from homofact.geometry.torch_functions import TORCH

    return TORCH


def _scaled(axis: Expression, scale: tuple[float, float], values: dict[str, Any], functions: Mapping[str, Any]) -> Any:
    found, (factor, offset) = value_of(axis, values, functions)[0], scale
    return found if (factor, offset) == (1, 0) else found * factor + offset


def rusinkiewicz_angles(wi: "Tensor", wo: "Tensor") -> "tuple[Tensor, Tensor, Tensor]":
    """Return θh, θd, φd in radians (Rusinkiewicz 1998), φd folded to [0, π/2].

    φd is the azimuth of ωi about h, from the plane of n and h; the fold leaves only the sizes of its components across
    and along that plane. At h = n the plane is undefined; φd is 0 there.
    """
    theta_h, theta_d, phi_d = axes_of(("theta_h", "theta_d", "phi_d"), wi, wo).unbind(-1)
    return theta_h, theta_d, phi_d
