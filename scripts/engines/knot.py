"""Make a torus knot for comparisons of light. This module computes the normal at every pixel of a picture, and
images from these normals.

The knot is seen from far away along −z and fills the picture as `rendering.sphere` does a sphere. There are no shadows,
no occlusion and no light from the knot itself: radiance depends on the normal alone. Tangents are those of a sphere at
the same normal (`rendering.surface`), so a brushed material is brushed around the vertical axis.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.meshes.shapes import torus_knot
from homofact.rendering.filtered import FilteredMaterial, Surroundings
from homofact.rendering.light import EnvironmentMap
from homofact.rendering.prefilter import Prefiltered
from homofact.rendering.sphere import SphereImage
from homofact.rendering.surface import RADIUS, sphere_frames

VIEW = (0.0, 0.0, 1.0)


class Knot(NamedTuple):
    """What is seen in a picture of `size` pixels per side: the `pixels` (P,) and their unit `normals` (P, 3)."""

    size: int
    pixels: Tensor
    normals: Tensor

    @classmethod
    def of(cls, size: int) -> "Knot":
        """The knot in a picture; where triangles cover each other, the nearest one is seen."""
        mesh = torus_knot()
        corners, towards = mesh.positions[mesh.triangles], mesh.normals[mesh.triangles]
        # Pixels of the corners, rows from the top.
        x, y = (corners[..., 0] * RADIUS + 1) * size / 2, (1 - corners[..., 1] * RADIUS) * size / 2
        depth, seen = np.full((size, size), -np.inf), np.zeros((size, size, 3))
        for triangle in range(len(corners)):
            own_x, own_y = x[triangle], y[triangle]
            rows, columns = (
                np.arange(max(int(place.min() - 0.5), 0), min(int(place.max() + 0.5) + 1, size))
                for place in (own_y, own_x)
            )
            row, column = np.meshgrid(rows, columns, indexing="ij")
            shares = _shares(own_x, own_y, column + 0.5, row + 0.5)
            if shares is None:
                continue
            height = shares @ corners[triangle, :, 2]
            normal = shares @ towards[triangle]
            nearer = (shares >= 0).all(-1) & (height > depth[row, column]) & (normal[..., 2] > 0)
            depth[row[nearer], column[nearer]] = height[nearer]
            seen[row[nearer], column[nearer]] = normal[nearer]
        pixels = np.isfinite(depth).reshape(-1).nonzero()[0]
        normals = seen.reshape(-1, 3)[pixels]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return cls(size, torch.from_numpy(pixels), torch.from_numpy(normals))

    def exact(self, reflectance: Reflectance, light: EnvironmentMap) -> SphereImage:
        """The picture by exact integration."""
        material = FilteredMaterial.of(reflectance, view=VIEW)
        return self._image(material.under(Surroundings.at_normals(light, self.normals, VIEW)).radiance[0])

    def by_split_sum(self, data: Prefiltered) -> SphereImage:
        """The picture by a table and a filtered sky."""
        frame, _ = sphere_frames(self.normals, torch.tensor(VIEW, dtype=torch.float64))
        wo = torch.tensor(VIEW, dtype=torch.float64).expand_as(self.normals).contiguous()
        return self._image(data.radiance(self.normals, wo, frame[:, 0].contiguous()))

    def _image(self, radiance: Tensor) -> SphereImage:
        """An image with these values (P, C) at the knot's pixels."""
        whole = torch.zeros(self.size**2, 3, dtype=torch.float64)
        coverage = torch.zeros(self.size**2, dtype=torch.float64)
        whole[self.pixels], coverage[self.pixels] = radiance.to(torch.float64).expand(-1, 3), 1.0
        return SphereImage(whole.reshape(self.size, self.size, 3), coverage.reshape(self.size, self.size))


def _shares(x: np.ndarray, y: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray | None:
    """Barycentric coordinates (..., 3) of places in a triangle (3,); None if it has no area."""
    twice = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    if abs(twice) < 1e-12 or column.size == 0:
        return None
    second = ((column - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (row - y[0])) / twice
    third = ((x[1] - x[0]) * (row - y[0]) - (column - x[0]) * (y[1] - y[0])) / twice
    return np.stack((1 - second - third, second, third), -1)
