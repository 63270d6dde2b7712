"""The visibility of the surroundings from a vertex: Embree traces one ray per sample of a cube map's texels."""

import numpy as np

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.relighting import cube


class Tracer:
    """Which texels of the cube map each vertex of a mesh sees, among everything that the occluder holds."""

    def __init__(self, mesh: Mesh, occluder: Occluder, size: int, rays: int = 1) -> None:
        self.positions, self.normals, self.occluder, self.samples = mesh.lit_at, mesh.normals, occluder, rays**2
        self.directions = cube.directions(size).reshape(-1, 3).astype(np.float32)
        self.angles = np.tile(cube.solid_angles(size).reshape(-1), cube.FACES).astype(np.float32)
        fine = cube.directions(size * rays).astype(np.float32)
        blocks = fine.reshape(cube.FACES, size, rays, size, rays, 3).swapaxes(2, 3)
        self.rays = np.ascontiguousarray(blocks).reshape(-1, 3)

    def visible(self, vertex: int) -> np.ndarray:
        """The share (6·n²,) of each texel that is above the vertex's horizon and not blocked, by the texel's rays."""
        normal = self.normals[vertex].astype(np.float32)
        above = np.flatnonzero(self.rays @ normal > 0)
        origin = self.positions[vertex] + self.occluder.offset * normal
        seen = np.zeros(len(self.rays), np.float32)
        seen[above] = ~self.occluder.blocked(origin[None], self.rays[above])
        return seen.reshape(-1, self.samples).mean(1)
