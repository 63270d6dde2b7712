"""An environment on the octahedral square with a pyramid of averages: light over any solid angle in one lookup.

A direction d is divided by |dx| + |dy| + |dz|; the upper half's (x, y) fill the inner square turned by 45°, the lower
half's are folded out into the corners (Praun and Hoppe 2003). A texel of side 2/N there covers s³ (2/N)² of solid
angle, s = |dx| + |dy| + |dz| in [1, √3]. Every texel of a level averages four texels of the finer level, weighted by
solid angle. Each level has a rim of one texel, a copy of the texels that are adjacent after folding.
"""

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d

from homofact.linear.kernels import kernel
from homofact.rendering.light import EnvironmentMap

_SMALLEST, _LARGEST, _LAST = 128, 1024, 4
_ROWS = 512  # of a map: finer ones are averaged first


class Pyramid(NamedTuple):
    """`texels` (T, 3) float32 of all levels, each row by row with its rim, level k from `starts`[k] on.

    `sides` are N without the rim. `solid` (N, N) are the solid angles of the finest level's texels.
    """

    texels: np.ndarray
    starts: np.ndarray
    sides: np.ndarray
    solid: np.ndarray

    @classmethod
    def of(cls, light: EnvironmentMap, axes: Tensor) -> "Pyramid":
        """Return the pyramid of a map, in the frame whose unit vectors are the rows of `axes` (3, 3) in the world."""
        level = light.radiance.expand(-1, -1, 3)
        if len(level) > _ROWS:
            level = adaptive_avg_pool2d(level.permute(2, 0, 1), (_ROWS, 2 * _ROWS)).permute(1, 2, 0)
        side = 1 << math.ceil(math.log2(len(level) * 4))
        side = min(max(side, _SMALLEST), _LARGEST)
        weight = _solid(side)
        level = _resampled(level.contiguous().numpy(), light.turn, axes.numpy(), side)
        solid, levels = weight, [level]
        while len(levels[-1]) > _LAST:
            half = len(levels[-1]) // 2
            total = weight.reshape(half, 2, half, 2)
            mean = (levels[-1].reshape(half, 2, half, 2, 3) * total[..., None]).sum((1, 3))
            weight = total.sum((1, 3))
            levels.append(mean / weight[..., None])
        parts = [_rimmed(level).reshape(-1, 3) for level in levels]
        starts = np.cumsum([0, *(len(part) for part in parts[:-1])])
        texels = np.concatenate(parts).astype(np.float32)
        return cls(texels, starts, np.array([len(level) for level in levels]), solid)

    def lamps(self, coarse: int, fine: int) -> tuple[np.ndarray, np.ndarray]:
        """Return lamps that approximate the whole light: (directions (K, 3), radiance times solid angle (K, 3)).

        There is one lamp for each of coarse² cells, at the centroid of the cell's light. Cells with more than twice the
        mean light are divided, down to fine² cells. Both are powers of two.
        """
        side = int(self.sides[0])
        inner = self.texels[: (side + 2) ** 2].reshape(side + 2, side + 2, 3)[1:-1, 1:-1]
        light = inner * self.solid[..., None]
        both = np.concatenate((light, directions_of(side).numpy() * light.mean(2, keepdims=True)), 2)
        both = both.reshape(fine, side // fine, fine, side // fine, 6).sum((1, 3))
        limit = 2 * both[..., :3].sum() / coarse**2
        levels = [both]
        while len(levels[-1]) > coarse:
            half = len(levels[-1]) // 2
            levels.append(levels[-1].reshape(half, 2, half, 2, 6).sum((1, 3)))
        cells, wanted = [], np.ones((coarse, coarse), dtype=bool)
        for level in reversed(levels):
            divided = wanted & (level[..., :3].sum(2) > limit) & (len(level) < fine)
            cells.append(level[wanted & ~divided])
            wanted = divided.repeat(2, 0).repeat(2, 1)
        lamps = np.concatenate(cells)
        length = np.linalg.norm(lamps[:, 3:], axis=1)
        lit = length > 0
        return lamps[lit, 3:] / length[lit, None], np.ascontiguousarray(lamps[lit, :3])


def directions_of(side: int) -> Tensor:
    """Return unit directions (N, N, 3) of the texels' centres, row by row along the second coordinate."""
    ticks = (torch.arange(side, dtype=torch.float64) + 0.5) * (2 / side) - 1
    y, x = torch.meshgrid(ticks, ticks, indexing="ij")
    z = 1 - x.abs() - y.abs()
    under = z < 0
    folded_x, folded_y = (1 - y.abs()) * torch.sign(x), (1 - x.abs()) * torch.sign(y)
    d = torch.stack((torch.where(under, folded_x, x), torch.where(under, folded_y, y), z), -1)
    return d / d.norm(dim=-1, keepdim=True)


def _solid(side: int) -> np.ndarray:
    """Solid angles (N, N) of the texels, which sum to 4π."""
    cubed = directions_of(side).abs().sum(-1).numpy() ** 3
    return cubed * (4 * math.pi / cubed.sum())


def _rimmed(level: np.ndarray) -> np.ndarray:
    """(N + 2, N + 2, 3): with the texels that the folding puts beside each edge, its own turned about its middle."""
    side = len(level)
    whole = np.empty((side + 2, side + 2, 3))
    whole[1:-1, 1:-1] = level
    whole[0, 1:-1], whole[-1, 1:-1] = level[0, ::-1], level[-1, ::-1]
    whole[1:-1, 0], whole[1:-1, -1] = level[::-1, 0], level[::-1, -1]
    whole[0, 0], whole[0, -1], whole[-1, 0], whole[-1, -1] = level[-1, -1], level[-1, 0], level[0, -1], level[0, 0]
    return whole


@kernel(nogil=True, fastmath=True)
def _resampled(radiance, turn, axes, side):  # pragma: no cover (compiled)
    """Means (N, N, 3) of a map's texels, laid out as in `rendering.light`, at 2 × 2 places of each of the N² texels."""
    rows, columns, _ = radiance.shape
    means = np.zeros((side, side, 3))
    for j in range(2 * side):
        for i in range(2 * side):
            u, v = (i + 0.5) / side - 1, (j + 0.5) / side - 1
            w = 1 - abs(u) - abs(v)
            if w < 0:
                u, v = math.copysign(1 - abs(v), u), math.copysign(1 - abs(u), v)
            x = u * axes[0, 0] + v * axes[1, 0] + w * axes[2, 0]
            y = u * axes[0, 1] + v * axes[1, 1] + w * axes[2, 1]
            z = u * axes[0, 2] + v * axes[1, 2] + w * axes[2, 2]
            around = (math.atan2(x, -z) + turn) / (2 * math.pi) + 0.5
            column = min(int((around - math.floor(around)) * columns), columns - 1)
            row = min(int(math.atan2(math.sqrt(x * x + z * z), y) * (rows / math.pi)), rows - 1)
            for channel in range(3):
                # Four readings a texel keep the light of single bright pixels.
                means[j // 2, i // 2, channel] += radiance[row, column, channel] / 4
    return means


@kernel(nogil=True, fastmath=True, inline="always")
def fetch(texels, starts, sides, x, y, z, wide):  # pragma: no cover (compiled)
    """(red, green, blue) from direction (x, y, z) of any length; `wide` is log2(Ω)/2 of the solid angle Ω averaged."""
    s = abs(x) + abs(y) + abs(z)
    u, v = x / s, y / s
    if z < 0:
        u, v = (1 - abs(v)) * (1 if u >= 0 else -1), (1 - abs(u)) * (1 if v >= 0 else -1)
    # log2(N √Ω/2 s^−3/2), ln s by its first Padé approximant.
    s = s / math.sqrt(x * x + y * y + z * z)
    level = math.log2(sides[0]) - 1 + wide - 3 * 1.442695 * (s - 1) / (s + 1)
    last = len(sides) - 1
    level = min(max(level, 0.0), float(last))
    k = min(int(level), last - 1)
    part = level - k
    red = green = blue = 0.0
    for step in range(2):
        share = part if step else 1 - part
        if share == 0:
            continue
        side = sides[k + step]
        column, row = (u + 1) * 0.5 * side + 0.5, (v + 1) * 0.5 * side + 0.5
        i, j = int(column), int(row)
        right, up = column - i, row - j
        first = starts[k + step] + j * (side + 2) + i
        above = first + side + 2
        w0, w1 = share * (1 - up) * (1 - right), share * (1 - up) * right
        w2, w3 = share * up * (1 - right), share * up * right
        red += w0 * texels[first, 0] + w1 * texels[first + 1, 0] + w2 * texels[above, 0] + w3 * texels[above + 1, 0]
        green += w0 * texels[first, 1] + w1 * texels[first + 1, 1] + w2 * texels[above, 1] + w3 * texels[above + 1, 1]
        blue += w0 * texels[first, 2] + w1 * texels[first + 1, 2] + w2 * texels[above, 2] + w3 * texels[above + 1, 2]
    return red, green, blue
