"""The cube map that light and transport are given on: directions, solid angles, an environment's mean in each texel.

Six faces +x, −x, +y, −y, +z, −z of n × n texels, even on the plane at distance 1: texel (i, j) of a face lies at
a = 2(i + ½)/n − 1 along its first axis, b along its second, and points along axis + a·first + b·second. World frame of
`render.light`: y up. A texel between a₀, a₁ and b₀, b₁ has the solid angle Ω(a₁,b₁) − Ω(a₀,b₁) − Ω(a₁,b₀) + Ω(a₀,b₀),
Ω(a, b) = atan(ab/√(1 + a² + b²)).
"""

import math

import numpy as np
import torch

from homofact.errors import BadInput
from homofact.render.light import EnvironmentMap

FACES = 6
SIZES = (8, 16, 32, 64)
# Axis, first and second direction of each face.
_AXES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
        [[0, -1, 0], [0, 0, 1], [1, 0, 0]],
        [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        [[0, 0, -1], [1, 0, 0], [0, 1, 0]],
    ],
    float,
)


def check_size(size: int) -> None:
    """Raise BadInput for a cube map of another size than `SIZES`: an index of a texel must fit 16 bits."""
    if size not in SIZES:
        raise BadInput(f"cube: found {size} texels along a face, expected one of {', '.join(map(str, SIZES))}")


def directions(size: int) -> np.ndarray:
    """Unit vectors (6, n, n, 3) to the texels' centres."""
    along = 2 * (np.arange(size) + 0.5) / size - 1
    a, b = np.meshgrid(along, along, indexing="ij")
    points = _AXES[:, None, None, 0] + a[..., None] * _AXES[:, None, None, 1] + b[..., None] * _AXES[:, None, None, 2]
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def solid_angles(size: int) -> np.ndarray:
    """Steradians (n, n) of a face's texels; six faces make 4π."""
    edge = 2 * np.arange(size + 1) / size - 1
    corner = np.arctan(edge[:, None] * edge / np.sqrt(1 + edge[:, None] ** 2 + edge**2))
    return np.diff(np.diff(corner, axis=0), axis=1)


def texel_of(w: np.ndarray, size: int) -> np.ndarray:
    """The flat index (N,) of the texel that each of the directions (N, 3) points into."""
    axis = np.abs(w).argmax(1)
    rows = np.arange(len(w))
    face = 2 * axis + (w[rows, axis] < 0)
    scaled = w / np.abs(w[rows, axis])[:, None]
    a, b = ((scaled * _AXES[face, k]).sum(1) for k in (1, 2))
    i, j = (np.clip(((each + 1) / 2 * size).astype(np.int64), 0, size - 1) for each in (a, b))
    return (face * size + i) * size + j


def environment_cube(light: EnvironmentMap, size: int) -> np.ndarray:
    """Mean radiance (6, n, n, 3) float64 of an environment map over each texel, its turn included.

    Where the map's texels are the smaller ones each is given whole to the texel that it points into, which keeps its
    light to the last bit; a texel of the cube none points into, and all of a coarse map, is asked at 4 × 4 points.
    """
    fine = _asked(light, size)
    rows, columns, channels = light.radiance.shape
    if rows < 4 * size:
        return fine
    polar = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
    azimuth = ((torch.arange(columns, dtype=torch.float64) + 0.5) / columns - 0.5) * (2 * math.pi) - light.turn
    y, around = torch.cos(polar)[:, None].expand(-1, columns), torch.sin(polar)[:, None]
    w = torch.stack((around * torch.sin(azimuth), y, -around * torch.cos(azimuth)), -1).reshape(-1, 3)
    edges = torch.cos(torch.arange(rows + 1, dtype=torch.float64) * (math.pi / rows))
    angle = ((edges[:-1] - edges[1:]) * (2 * math.pi / columns)).repeat_interleave(columns).numpy()
    at = texel_of(w.numpy(), size)
    total = FACES * size * size
    radiance = light.radiance.expand(-1, -1, 3).reshape(-1, 3).numpy() if channels == 1 else None
    radiance = light.radiance.reshape(-1, 3).numpy() if radiance is None else radiance
    flux = np.stack([np.bincount(at, angle * radiance[:, c], total) for c in range(3)], 1)
    own = np.tile(solid_angles(size).reshape(-1), FACES)
    given = np.bincount(at, angle, total)
    # Divided by what was given: a texel whose share of the map is a little too large or small is no brighter for it.
    found = np.where(
        given[:, None] > 0.5 * own[:, None], flux / np.maximum(given, 1e-300)[:, None], fine.reshape(-1, 3)
    )
    return found.reshape(FACES, size, size, 3)


def _asked(light: EnvironmentMap, size: int) -> np.ndarray:
    """Means of 4 × 4 points in each texel, weighted by their solid angles."""
    fine = 4 * size
    radiance = light.look_up(torch.from_numpy(directions(fine)))[0].numpy()
    radiance = np.broadcast_to(radiance, (*radiance.shape[:-1], 3)) if radiance.shape[-1] == 1 else radiance
    angle = solid_angles(fine)[..., None]

    def blocks(values: np.ndarray) -> np.ndarray:
        return values.reshape(-1, size, 4, size, 4, values.shape[-1]).sum((2, 4))

    return blocks(radiance * angle) / blocks(np.broadcast_to(angle, (1, *angle.shape)))
