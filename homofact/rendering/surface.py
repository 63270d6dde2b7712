"""The visible points of the unit sphere per pixel, and reflectances evaluated in a picture's channels.

World frame, view and tangents as in `rendering.sphere`.
"""

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput

ToRgb = Tensor | Callable[[Tensor], Tensor]
RADIUS = 0.94
_GRID = 8


class Surface(NamedTuple):
    """The P covered pixels: their flat indices, rows t, b, n of the frame in the world, and ωo in that frame.

    `axes` (3, 3) are the picture's right and up and the direction to the viewer, in the world.
    """

    pixels: Tensor
    frame: Tensor
    wo: Tensor
    axes: Tensor


def seen_surface(size: int, view: tuple[float, float, float]) -> tuple[Tensor, Surface]:
    """Return the coverage (size, size) and the visible surface. Raises BadInput for an invalid size or view."""
    if size < 8:
        raise BadInput(where="picture size", found=size, expected="at least 8 pixels")
    axes = view_axes(view)
    forward = axes[2]
    coverage, index, centre = _covered(size)
    height = (1 - (centre**2).sum(1, keepdim=True)).clamp_min(0).sqrt()
    frame, wo = sphere_frames(torch.cat((centre, height), 1) @ axes, forward)
    # The last component is n·ωo; taken from the picture plane it is never negative by rounding.
    wo[:, 2:] = height
    return coverage, Surface(index, frame, wo, axes)


def view_axes(view: tuple[float, float, float]) -> Tensor:
    """Return the picture's right and up and the direction to the viewer (3, 3), world; BadInput for bad numbers."""
    place = torch.tensor(view, dtype=torch.float64)
    if tuple(place.shape) != (3,) or not bool(torch.isfinite(place).all()) or not bool(place.any()):
        raise BadInput(where="view", found=view, expected="three finite numbers, not all 0")
    forward = place / place.norm()
    right = _azimuthal(forward)
    return torch.stack((right, torch.linalg.cross(forward, right), forward))


def _covered(size: int) -> tuple[Tensor, Tensor, Tensor]:
    """Coverage (size, size); flat indices (P,) of what is covered, and the centres (P, 2) of the covered parts."""
    step = 2 / (size * RADIUS)
    ticks = (torch.arange(size, dtype=torch.float64) + 0.5) * step - 1 / RADIUS
    y, x = torch.meshgrid(-ticks, ticks, indexing="ij")
    centre, distance = torch.stack((x, y), -1).reshape(-1, 2), torch.hypot(x, y).reshape(-1)
    coverage = (distance < 1).to(torch.float64)
    # Pixels that the rim may cross are asked at every one of their points.
    rim = ((distance - 1).abs() < step).nonzero()[:, 0]
    inner = ((torch.arange(_GRID, dtype=torch.float64) + 0.5) / _GRID - 0.5) * step
    points = centre[rim, None] + torch.cartesian_prod(inner, inner)
    hit = ((points**2).sum(2) < 1).to(torch.float64)
    count = hit.sum(1)
    coverage[rim] = count / _GRID**2
    centre[rim] = (points * hit[..., None]).sum(1) / count[:, None].clamp_min(1)
    index = (coverage > 0).nonzero()[:, 0]
    return coverage.reshape(size, size), index, centre[index]


def sphere_frames(normal: Tensor, forward: Tensor) -> tuple[Tensor, Tensor]:
    """Rows t, b, n (P, 3, 3) of the frames at unit normals (P, 3), and the direction `forward` (3,) in them (P, 3)."""
    tangent = _azimuthal(normal)
    frame = torch.stack((tangent, torch.linalg.cross(normal, tangent), normal), 1)
    return frame, frame @ forward


def _azimuthal(n: Tensor) -> Tensor:
    """norm(y × n) of unit vectors (..., 3); x at the poles, where there is none."""
    across = torch.stack((n[..., 2], torch.zeros_like(n[..., 0]), -n[..., 0]), -1)
    length = across.norm(dim=-1, keepdim=True)
    x_axis = torch.zeros_like(n)
    x_axis[..., 0] = 1
    return torch.where(length > 1e-12, across / length.clamp_min(1e-12), x_axis)


def shader(reflectance: Reflectance, to_rgb: ToRgb | None) -> Callable[[Tensor, Tensor], Tensor]:
    """Return f(wi, wo) of tensors (N, 3) in 1 or 3 channels; it raises BadInput where a value is not finite.

    Raises BadInput for channels that `to_rgb` does not fit.
    """
    count = len(reflectance.channels)
    if to_rgb is None and count not in (1, 3):
        raise BadInput(where="reflectance", found=f"{count} channels", expected="1, 3 or a to_rgb conversion")
    if isinstance(to_rgb, Tensor) and tuple(to_rgb.shape) != (3, count):
        raise BadInput(where="to_rgb", found=f"a matrix of shape {tuple(to_rgb.shape)}", expected=f"(3, {count})")

    def shade(wi: Tensor, wo: Tensor) -> Tensor:
        values = reflectance.evaluate(wi, wo).to(torch.float64)
        if isinstance(to_rgb, Tensor):
            values = values @ to_rgb.to(values).T
        elif to_rgb is not None:
            values = to_rgb(values)
        if not bool(torch.isfinite(values).all()):
            row = int((~torch.isfinite(values)).any(1).nonzero()[0])
            where = f"wi {_words(wi[row])}, wo {_words(wo[row])}"
            raise BadInput(f"not finite at {where}", where="reflectance", expected="finite values")
        return values

    return shade


def _words(direction: Tensor) -> str:
    return "(" + ", ".join(f"{float(c):.4f}" for c in direction) + ")"
