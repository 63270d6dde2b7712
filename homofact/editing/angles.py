"""The angles γ(ωi, ωo) in [0, π/2] that a curve may be drawn over (Ben-Artzi et al. 2006, table 1).

θh, θd, θi and θo are those of `geometry.axes`. The two of Ashikhmin and Shirley's model (eq. 15 and 16) are

    cos γα = (cosθh)^(cos²φh),   cos γβ = (cosθh)^(sin²φh),

so that cos γα cos γβ = cosθh. They are computed by 1 − cosγ = −expm1(cos²φh log cosθh), which keeps all digits at the
peak; cosθh below 1e-6 counts as 1e-6, as in `brdf.analytic`.

θr is the angle between ωo and the mirror image of ωi, over which Phong's lobe is cosⁿθr; beyond π/2 it counts as π/2.
θx and θy are the tilts of the half vector along the tangent and the binormal,

    tan θx = |hx|/hz,   tan θy = |hy|/hz,

so that tan²θx + tan²θy = tan²θh and Ward's Gaussian of slopes is a function of θx times one of θy.

`chord_at` gives 2 sin(γ/2) of the same to compiled code, which also evaluates directions of light below the horizon.
Angles beyond π/2 count to the last band.
"""

import math

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.errors import BadInput
from homofact.geometry.coordinates import axes_of
from homofact.linear.kernels import kernel

RIGHT_ANGLE = math.pi / 2
# In the order of their numbers in compiled code.
ANGLES = (
    "theta_h", "theta_d", "theta_i", "theta_o", "gamma_alpha", "gamma_beta", "theta_r", "theta_x", "theta_y",
)  # fmt: skip
# Angles over which materials have their highlights: bands are finer near 0.
PEAKED = ("theta_h", "gamma_alpha", "gamma_beta", "theta_r", "theta_x", "theta_y")


def check_angle(name: str) -> None:
    """Raise BadInput, which lists the names of angles, for any other name."""
    if name not in ANGLES:
        raise BadInput(where="angle", found=repr(name), expected=f"one of {', '.join(ANGLES)}")


def angle(name: str, wi: Tensor, wo: Tensor) -> Tensor:
    """γ (N,) in radians of unit directions (N, 3) above the horizon. Raises BadInput for another name."""
    check_angle(name)
    if name in ("gamma_alpha", "gamma_beta"):
        return power_angle(wi + wo, 0 if name == "gamma_alpha" else 1)
    if name == "theta_d":
        return torch.atan2((wi - wo).norm(dim=-1), (wi + wo).norm(dim=-1))
    if name == "theta_r":
        mirrored = wi * torch.tensor((-1.0, -1.0, 1.0), dtype=wi.dtype, device=wi.device)
        half = torch.atan2((mirrored - wo).norm(dim=-1), (mirrored + wo).norm(dim=-1))
        return (2 * half).clamp_max(RIGHT_ANGLE)
    if name in ("theta_x", "theta_y"):
        return tilt(wi + wo, 0 if name == "theta_x" else 1)
    return axes_of((name,), wi, wo)[..., 0]


def power_angle(s: Tensor, component: int) -> Tensor:
    """γα (component 0) or γβ (1) of vectors along h."""
    across, along = s[..., 0] ** 2 + s[..., 1] ** 2, s[..., 2] ** 2
    length = (across + along).clamp_min(torch.finfo(s.dtype).tiny)
    share = s[..., component] ** 2 / across.clamp_min(torch.finfo(s.dtype).tiny)
    # log cosθh = ½ log(1 − sin²θh).
    least = math.log(MIN_COSINE)
    logarithm = (0.5 * torch.log1p(-(across / length).clamp_max(1 - 1e-16))).clamp_min(least)
    logarithm = torch.where(s[..., 2] > 0, logarithm, torch.full_like(logarithm, least))
    return 2 * torch.asin((-torch.expm1(share * logarithm) / 2).clamp(0, 1).sqrt())


def tilt(s: Tensor, component: int) -> Tensor:
    """Return θx (component 0) or θy (1) of vectors along h."""
    return torch.atan2(s[..., component].abs(), s[..., 2].clamp_min(0))


@kernel(error_model="numpy", forceinline=True)
def chord_at(
    kind: int, x: float, y: float, z: float, ox: float, oy: float, oz: float
) -> float:  # pragma: no cover (compiled)
    """2 sin(γ/2) = √(2 − 2 cosγ) of the light's direction (x, y, z) and the viewer's (ox, oy, oz), unit.

    `kind` is the index of γ in `ANGLES`. For an angle between two unit vectors, the chord is the distance of their
    ends.
    """
    if kind == 2:
        return np.sqrt(max(2 - 2 * z, 0.0))
    if kind == 3:
        return np.sqrt(max(2 - 2 * oz, 0.0))
    if kind == 6:
        return np.sqrt((x + ox) * (x + ox) + (y + oy) * (y + oy) + (z - oz) * (z - oz))
    sx, sy, sz = x + ox, y + oy, z + oz
    across = sx * sx + sy * sy
    if kind == 1:
        return np.sqrt(max(2 - np.sqrt(across + sz * sz), 0.0))
    if kind == 0:
        return np.sqrt(max(2 - 2 * sz / np.sqrt(max(across + sz * sz, 1e-300)), 0.0))
    if kind >= 7:
        side = sx * sx if kind == 7 else sy * sy
        return np.sqrt(max(2 - 2 * sz / np.sqrt(max(side + sz * sz, 1e-300)), 0.0))
    part = sx * sx if kind == 4 else sy * sy
    share = part / max(across, 1e-300)
    logarithm = np.log(MIN_COSINE)
    if sz > 0:
        sine = across / (across + sz * sz)
        logarithm = max(0.5 * np.log1p(-min(sine, 1 - 1e-16)), logarithm)
    return np.sqrt(-2 * np.expm1(share * logarithm))
