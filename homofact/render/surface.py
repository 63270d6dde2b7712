"""What of the unit sphere is seen through each pixel, and reflectance asked in the channels of a picture.

World frame, view and tangents as in `render.sphere`.
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
    """Coverage (size, size) and the surface seen through each covered pixel. Raises BadInput for bad numbers."""
    if size < 8:
        raise BadInput(f"picture size: found {size}, expected at least 8 pixels")
    place = torch.tensor(view, dtype=torch.float64)
    if tuple(place.shape) != (3,) or not bool(torch.isfinite(place).all()) or not bool(place.any()):
        raise BadInput(f"view: found {view}, expected three finite numbers, not all 0")
    forward = place / place.norm()
    right = _azimuthal(forward)
    axes = torch.stack((right, torch.linalg.cross(forward, right), forward))
    fine = size * _GRID
    ticks = ((torch.arange(fine, dtype=torch.float64) + 0.5) * (2 / fine) - 1) / RADIUS
    x, y = torch.meshgrid(ticks, -ticks, indexing="xy")
    hit = (x**2 + y**2 < 1).to(torch.float64)

    def per_pixel(values: Tensor) -> Tensor:
        return values.reshape(size, _GRID, size, _GRID).sum((1, 3))

    count = per_pixel(hit)
    index = (count.reshape(-1) > 0).nonzero()[:, 0]
    covered = count.reshape(-1)[index]
    centre = torch.stack([per_pixel(hit * p).reshape(-1)[index] / covered for p in (x, y)], 1)
    height = (1 - (centre**2).sum(1, keepdim=True)).clamp_min(0).sqrt()
    frame, wo = sphere_frames(torch.cat((centre, height), 1) @ axes, forward)
    # The last component is n·ωo; taken from the picture plane it is never negative by rounding.
    wo[:, 2:] = height
    return count / _GRID**2, Surface(index, frame, wo, axes)


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
    """f(wi, wo) of tensors (N, 3) in 1 or 3 channels; it raises BadInput where a value is not finite.

    Raises BadInput for channels that `to_rgb` does not fit.
    """
    count = len(reflectance.channels)
    if to_rgb is None and count not in (1, 3):
        raise BadInput(f"reflectance: found {count} channels, expected 1, 3 or a to_rgb conversion")
    if isinstance(to_rgb, Tensor) and tuple(to_rgb.shape) != (3, count):
        raise BadInput(f"to_rgb: found a matrix of shape {tuple(to_rgb.shape)}, expected (3, {count})")

    def shade(wi: Tensor, wo: Tensor) -> Tensor:
        values = reflectance.evaluate(wi, wo).to(torch.float64)
        if isinstance(to_rgb, Tensor):
            values = values @ to_rgb.to(values).T
        elif to_rgb is not None:
            values = to_rgb(values)
        if not bool(torch.isfinite(values).all()):
            row = int((~torch.isfinite(values)).any(1).nonzero()[0])
            where = f"wi {_words(wi[row])}, wo {_words(wo[row])}"
            raise BadInput(f"reflectance: not finite at {where}, expected finite values")
        return values

    return shade


def _words(direction: Tensor) -> str:
    return "(" + ", ".join(f"{float(c):.4f}" for c in direction) + ")"
