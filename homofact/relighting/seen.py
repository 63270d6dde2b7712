"""Vertices that an eye sees, and the exact sum of their light: what every approximation is held against."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames
from homofact.relighting import cube
from homofact.relighting.tracer import Tracer


@dataclass
class SeenVertices:
    """Vertices that an eye sees, with what their light is summed from."""

    mesh: Mesh
    reflectance: Reflectance
    occluder: Occluder
    eye: np.ndarray
    which: np.ndarray
    rows: np.ndarray = field(init=False)
    wo: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        """Frames of the vertices, and the eye's direction in them."""
        self.rows = frames(self.mesh.normals[self.which])
        towards = self.eye - self.mesh.positions[self.which]
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        self.wo = np.einsum("vij,vj->vi", self.rows, towards)

    def dense(self, light: np.ndarray, size: int, reflectance: Reflectance | None = None) -> np.ndarray:
        """The sum over all texels (S, 3) for a cube map of radiance (6, n, n, 3) and the reflectance, or another."""
        asked = self.reflectance if reflectance is None else reflectance
        tracer = Tracer(self.mesh, self.occluder, size)
        w = cube.directions(size).reshape(-1, 3)
        flux = light.reshape(-1, 3) * np.tile(cube.solid_angles(size).reshape(-1), cube.FACES)[:, None]
        found = np.zeros((len(self.which), 3))
        for s, v in enumerate(self.which):
            lit = np.flatnonzero(tracer.visible(int(v)))
            wi = w[lit] @ self.rows[s].T
            kept = wi[:, 2] > 0
            wi = torch.from_numpy(wi[kept])
            wo = torch.from_numpy(self.wo[s]).expand(len(wi), 3)
            values = asked.evaluate(wi, wo).double().numpy() * wi[:, 2:].numpy()
            found[s] = (values * flux[lit[kept]]).sum(0)
        return found


def seen_vertices(
    mesh: Mesh, reflectance: Reflectance, occluder: Occluder, eye: Sequence[float], most: int, seed: int = 0
) -> SeenVertices:
    """At most so many vertices, drawn by the seed, that face the eye and that nothing hides from it.

    Raises BadInput where the eye sees none.
    """
    point = np.asarray(eye, np.float64)
    towards = point - mesh.positions
    distance = np.linalg.norm(towards, axis=1)
    towards /= distance[:, None]
    # At grazing angles a vertex is hardly a pixel, and measured reflectance is a guess.
    facing = np.flatnonzero((towards * mesh.normals).sum(1) > 0.1)
    start = mesh.positions[facing] + occluder.offset * mesh.normals[facing]
    open_ = facing[~occluder.blocked(start, towards[facing])]
    if not len(open_):
        raise BadInput(f"no vertex is seen from {tuple(point.tolist())}", where=mesh.name, expected="another eye")
    drawn = np.random.default_rng(seed).permutation(open_)[:most]
    return SeenVertices(mesh, reflectance, occluder, point, np.sort(drawn))
