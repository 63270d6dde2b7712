"""Tabulate a material's logarithms on a regular grid over (√θh, θd, φd), with linear interpolation.

The square root gives the highlight more nodes: with 20 nodes, the first ring beside θh = 0 is at θh = .25°. φd is
folded to [0, π/2], so every function on the grid is isotropic, reciprocal and left-right symmetric.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from homofact.geometry.coordinates import rusinkiewicz_angles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix
    from torch import Tensor

SHAPE = (20, 10, 4)


@dataclass(frozen=True)
class HalfGrid:
    """A grid of `shape` nodes over (√θh, θd, φd)."""

    shape: tuple[int, int, int] = SHAPE

    @property
    def size(self) -> int:
        """The number of nodes."""
        return math.prod(self.shape)

    def nodes(self) -> np.ndarray:
        """Return coordinates (size, 3) of the nodes in [0, 1]."""
        axes = [np.linspace(0, 1, count) for count in self.shape]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def places(self, wi: "Tensor", wo: "Tensor") -> np.ndarray:
        """Return coordinates (N, 3) in [0, 1] of pairs of directions (N, 3)."""
        angles = np.stack([angle.numpy() for angle in rusinkiewicz_angles(wi, wo)], 1) / (math.pi / 2)
        angles = angles.clip(0, 1)
        angles[:, 0] = np.sqrt(angles[:, 0])
        return angles

    def matrix(self, wi: "Tensor", wo: "Tensor") -> "csr_matrix":
        """Return the sparse matrix (N, size) that interpolates node values to pairs of directions (N, 3)."""
        from scipy.sparse import csr_matrix

        places = self.places(wi, wo)
        index, weight = np.zeros((len(places), 1), dtype=np.int64), np.ones((len(places), 1))
        for axis, count in enumerate(self.shape):
            along = places[:, axis] * (count - 1)
            low = np.minimum(along.astype(np.int64), count - 2)
            share = (along - low)[:, None]
            index = np.concatenate((index * count + low[:, None], index * count + low[:, None] + 1), 1)
            weight = np.concatenate((weight * (1 - share), weight * share), 1)
        rows = np.repeat(np.arange(len(places)), index.shape[1])
        return csr_matrix((weight.reshape(-1), (rows, index.reshape(-1))), shape=(len(places), self.size))

    def correlation(self, lengths: tuple[float, float, float]) -> np.ndarray:
        """Return Matérn correlations (size, size) of smoothness 3/2, with one length for each coordinate.

        φd has less effect near h = normal and near ωi = ωo, so its coordinate is scaled by √min(√θh, θd), with both
        angles in units of 90°.
        """
        x = self.nodes()
        # A kernel of distances between places stays one, whatever the places.
        x[:, 2] = (x[:, 2] - 0.5) * np.sqrt(np.minimum(x[:, 0], x[:, 1]))
        x /= np.array(lengths)
        squared = sum((x[:, None, axis] - x[None, :, axis]) ** 2 for axis in range(3))
        distance = math.sqrt(3) * np.sqrt(squared)
        return (1 + distance) * np.exp(-distance)
