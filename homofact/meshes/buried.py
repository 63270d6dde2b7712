"""Find vertices that lie inside other parts of a scene, and exposed points whose light they use instead.

A button sunk into its case, or the handle of a teapot that continues inside the body, has vertices that receive no
light although part of their triangles is exposed. Light interpolated linearly from the corners is then too dark in the
whole exposed part. The correct light for such a vertex is that near the place where its triangles emerge. The light of
the vertex is therefore computed at the nearest exposed point on the lines from the vertex to the other corners and to
the centres of its triangles, with the normal of the vertex. A vertex in a fold of one surface does not change: light
fades towards the fold, so no nearby point is exposed much more.
"""

import math
from dataclasses import replace

import numpy as np

from homofact.meshes.mesh import Mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.tangents import frames

# Rays of a vertex and of a place on the way; parts of them that are free at most of what is buried, and at least of
# what is in the open.
_RAYS, _FEW_RAYS = 64, 24
_BURIED, _OPEN = 1 / 32, 1 / 8
# Places along a line, as parts of its length.
_ALONG = (1 / 8, 1 / 4, 1 / 2, 3 / 4)


def with_open_origins(mesh: Mesh, occluder: Occluder) -> Mesh:
    """Return the mesh with `origins` for its buried vertices, or the mesh itself if no exposed point was found."""
    normals = mesh.normals
    buried = _free(mesh.positions, normals, occluder, _RAYS) <= _BURIED
    corners = [np.roll(mesh.triangles, -k, axis=1) for k in range(3)]
    own = np.concatenate([each[buried[each[:, 0]]] for each in corners])
    if not len(own):
        return mesh
    vertex, start = own[:, 0], mesh.positions[own[:, 0]]
    origins, left = mesh.positions.copy(), buried.copy()
    ends = [*(mesh.positions[own[:, k]] for k in (1, 2)), mesh.positions[own].mean(1)]
    for part in _ALONG:
        asked = np.flatnonzero(left[vertex])
        if not len(asked):
            break
        places = np.concatenate([start[asked] + part * (end[asked] - start[asked]) for end in ends])
        at = np.tile(vertex[asked], len(ends))
        free = _free(places, normals[at], occluder, _FEW_RAYS)
        # Of equally near places the one that sees most: the last in this order.
        order = np.argsort(free, kind="stable")
        order = order[free[order] >= _OPEN]
        origins[at[order]] = places[order]
        left[at[order]] = False
    return mesh if (left == buried).all() else replace(mesh, origins=origins)


def _free(places: np.ndarray, normals: np.ndarray, occluder: Occluder, count: int) -> np.ndarray:
    """Return the share (N,) of unblocked rays among `count` rays, uniform in solid angle above `normals` (N, 3)."""
    k = np.arange(count) + 0.5
    z, phi = 1 - k / count, k * (math.pi * (3 - math.sqrt(5)))
    flat = np.sqrt(1 - z * z)
    towards = np.stack((flat * np.cos(phi), flat * np.sin(phi), z), 1)
    rays = np.einsum("kj,njx->nkx", towards, frames(normals))
    starts = np.repeat(places + occluder.offset * normals, count, axis=0)
    return 1 - occluder.blocked(starts, rays.reshape(-1, 3)).reshape(-1, count).mean(1)
