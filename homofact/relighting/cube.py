"""The cube map of light and transport: directions, solid angles, and an environment's mean per texel.

Six faces +x, −x, +y, −y, +z, −z of n × n texels, evenly spaced on the plane at distance 1: texel (i, j) of a face lies
at a = 2(i + ½)/n − 1 along its first axis, b along its second, and points along axis + a·first + b·second. World frame
of `rendering.light`: y up. A texel between a₀, a₁ and b₀, b₁ has the solid angle Ω(a₁,b₁) − Ω(a₀,b₁) − Ω(a₁,b₀) +
Ω(a₀,b₀), Ω(a, b) = atan(ab/√(1 + a² + b²)).
"""

import numpy as np
import torch

from homofact.errors import BadInput
from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import band_angles, texel_directions

FACES = 6
SIZES = (8, 16, 32, 64)
# Rows of a map across a texel of the cube, at least; rows at a time.
_FINER, _ROWS = 8, 64
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
        wanted = f"one of {', '.join(map(str, SIZES))}"
        raise BadInput(where="cube", found=f"{size} texels along a face", expected=wanted)


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

    Every texel of the map is divided until a texel of the cube covers at least `_FINER` rows of parts. Each part is
    assigned to the texel of the cube that contains its direction, so that no small sun is missed. The flux in a texel
    of the cube is divided by the solid angle of its parts. Constant light therefore stays constant, and the irradiance
    of a sun is accurate within a few percent.
    """
    rows, columns, channels = light.radiance.shape
    times = max(1, -(-_FINER * 2 * size // rows))
    radiance = light.radiance.expand(-1, -1, 3) if channels == 1 else light.radiance
    total = FACES * size * size
    flux, given = np.zeros((total, 3)), np.zeros(total)
    height, width = rows * times, columns * times
    for first in range(0, height, _ROWS):
        place = torch.arange(first, min(first + _ROWS, height))
        at = texel_of(texel_directions(height, width, light.turn, place).numpy(), size)
        angle = band_angles(height, width)[place].repeat_interleave(width).numpy()
        values = radiance[place // times].repeat_interleave(times, 1).reshape(-1, 3).numpy()
        given += np.bincount(at, angle, total)
        for c in range(3):
            flux[:, c] += np.bincount(at, angle * values[:, c], total)
    return (flux / given[:, None]).reshape(FACES, size, size, 3)
