"""Measure the width of a source's highlight, and the resolution of a fit's texels there.

Both refer to the angle θh of the half vector at the mirror direction, for 45° incidence, with the half vector tilted
perpendicular to the plane of incidence. The half width is the θh at which f minus its value at `BASE_DEGREES` has
fallen to half of its peak. A texture resolves features as wide as a texel. Let (u, v) be the texture coordinates in
[−1, 1]². An axis with n texels then has (n − 1)/2 |∂u/∂θh| texels per radian.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.factor.evaluation import evaluation_of
from homofact.factor.fitted import Fitted
from homofact.geometry.coordinates import axes_of
from homofact.geometry.directions import from_spherical

INCIDENCE_DEGREES, BASE_DEGREES = 45.0, 20.0
LEAST_PEAK = 4.0  # of f at the base: less is no highlight
_NARROWEST, _STEPS, _STEP = 1e-6, 400, 1e-5


def half_width(source: Reflectance) -> float | None:
    """Return the half width of the highlight in radians of θh (mean of the channels), or None without a highlight."""
    theta_h = torch.cat(
        (
            torch.zeros(1, dtype=torch.float64),
            torch.logspace(math.log10(_NARROWEST), math.log10(math.radians(BASE_DEGREES)), _STEPS, dtype=torch.float64),
        )
    )
    values = source.evaluate(*_tilted(theta_h)).to(torch.float64).mean(1)
    base = float(values[-1])
    peak = float(values[0]) - base
    if not peak > (LEAST_PEAK - 1) * max(base, 0.0) or not math.isfinite(peak) or peak <= 0:
        return None
    fallen = (values - base < 0.5 * peak).nonzero()[:, 0]
    return float(theta_h[int(fallen[0])])


def texels_per_radian(fitted: Fitted) -> float:
    """Return the texels per radian of θh at the mirror direction, for the finest texture of the fit."""
    wi, wo = _tilted(torch.tensor([0.0, _STEP], dtype=torch.float64))
    most = 0.0
    for lookup in evaluation_of(fitted).lookups:
        x = axes_of(lookup.axes, wi, wo, lookup.scales, lookup.warp)
        uv = x @ torch.from_numpy(lookup.matrix).to(x).T
        rows, columns = fitted.textures[lookup.texture].size
        moved = (uv[1] - uv[0]).abs() / _STEP
        most = max(most, float(moved[0]) * (columns - 1) / 2, float(moved[1]) * (rows - 1) / 2)
    return most


def _tilted(theta_h: Tensor) -> tuple[Tensor, Tensor]:
    """(ωi, ωo) (N, 3) with half vectors at `theta_h`, tilted across the plane of incidence."""
    angle = torch.full_like(theta_h, math.radians(INCIDENCE_DEGREES))
    wi = from_spherical(angle, torch.zeros_like(angle))
    h = from_spherical(theta_h, torch.full_like(theta_h, math.pi / 2))
    return wi, 2 * (wi * h).sum(1, keepdim=True) * h - wi
