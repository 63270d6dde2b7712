"""The grid of half vectors on which a lobe's table lies: nodes along the slope |s|, and nodes round the peak.

A half vector with the slopes s = (hx, hy)/hz, turned so that the viewer's azimuth is 0, has two coordinates from 0 to
1. The nodes are evenly spaced in both:

    along  = ln(1 + PEAK |s|/w)/ln(1 + PEAK FARTHEST/w),                                w a few widths of the lobe,
    around = (1 − p)/2,  or of a whole circle (1 − p)/4 where hy ≥ 0, (3 + p)/4 below;  p = sx/(|sx| + |sy|).

Along: evenly in |s| at the peak and evenly in ln |s| beyond it, since highlights end in tails over decades of slopes;
the grid ends at slopes of FARTHEST. Around: p falls from 1 to −1 over half a circle, as an angle would rise, and needs
no arc tangent; its steps are twice as wide in the middle of a quadrant as at its ends. A lobe that is the same on both
sides of the plane of incidence needs half a circle.

Lobes are nearly round and change slowly along a circle. Few nodes around are therefore enough, and most nodes can lie
along the slope. On a square grid of sx and sy, whose cells are not aligned with the circles, interpolation errors would
show as needles around the point of a sphere that faces the viewer.
"""

import math

import torch
from torch import Tensor

PEAK, FARTHEST = 8.0, 20.0


def places_of(slope: Tensor, width: float, whole: bool) -> tuple[Tensor, Tensor]:
    """Return the coordinates (along (N,), around (N,)) from 0 to 1 of slopes (N, 2), on the grid for `width`."""
    along = torch.log1p(slope.norm(dim=1) * PEAK / width) / math.log1p(FARTHEST * PEAK / width)
    x, y = slope.unbind(1)
    # A half vector at the peak has any place around.
    p = x / (x.abs() + y.abs()).clamp_min(1e-30)
    around = torch.where(y < 0, 3 + p, 1 - p) / 4 if whole else (1 - p) / 2
    return along.clamp_max(1), around


def node_slopes(along: int, around: int, width: float, whole: bool) -> Tensor:
    """Slopes (along, around, 2) of the nodes; a whole circle has the same node around first and last."""
    place = torch.linspace(0, 1, along, dtype=torch.float64)
    length = torch.expm1(place * math.log1p(FARTHEST * PEAK / width)) * width / PEAK
    turned = torch.linspace(0, 4 if whole else 2, around, dtype=torch.float64)
    x = 1 - torch.where(turned > 2, 4 - turned, turned)
    y = torch.where(turned > 2, x.abs() - 1, 1 - x.abs())
    direction = torch.stack((x, y), -1)
    return length[:, None, None] * direction / direction.norm(dim=-1, keepdim=True)


def fitted(values: Tensor, whole: bool) -> Tensor:
    """Subtract a twelfth of the second differences along both axes from grids (..., along, around, C).

    Linear interpolation at x between two samples deviates from a function by x(1 − x)/2 of the second difference, on
    average a twelfth. The change is at most half of the value.
    """
    bent = torch.zeros_like(values)
    bent[..., 1:-1, :, :] += values[..., 2:, :, :] - 2 * values[..., 1:-1, :, :] + values[..., :-2, :, :]
    bent[..., 1:-1, :] += values[..., 2:, :] - 2 * values[..., 1:-1, :] + values[..., :-2, :]
    # Half a circle goes on as in a mirror, a whole one from its beginning.
    first, last = (values[..., 1, :], values[..., -2, :])
    bent[..., 0, :] += (last if whole else first) + first - 2 * values[..., 0, :]
    bent[..., -1, :] += (first if whole else last) + last - 2 * values[..., -1, :]
    # At the foot of a steep peak a whole twelfth would be below 0: a dark ring round the highlight.
    most = values.abs() / 2
    return values - (bent / 12).clamp(-most, most)
