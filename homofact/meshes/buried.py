"""Vertices that lie inside other parts of a scene, and where to find the light that they receive instead.

A button that is sunk in its case, or the handle of a teapot that runs on inside the body, has vertices that see
nothing although a part of their triangles is in the open. Light mixed linearly from the corners is then too dark all
over the part that shows. What such a vertex is worth to the visible part of its triangles is the light next to where
they come out. Its light is therefore asked at the nearest place in the open on the lines from it to the other corners
and to the middles of its triangles; its normal stays its own. A vertex in a fold of one surface is left alone: there
light fades into the fold, and at no place near it does the surface see much more.
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
    """The mesh with `origins` for its buried vertices; itself if there are none that come out anywhere."""
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
    """The part (N,) of so many rays, even in solid angle above `normals` (N, 3), that nothing blocks."""
    k = np.arange(count) + 0.5
    z, phi = 1 - k / count, k * (math.pi * (3 - math.sqrt(5)))
    flat = np.sqrt(1 - z * z)
    towards = np.stack((flat * np.cos(phi), flat * np.sin(phi), z), 1)
    rays = np.einsum("kj,njx->nkx", towards, frames(normals))
    starts = np.repeat(places + occluder.offset * normals, count, axis=0)
    return 1 - occluder.blocked(starts, rays.reshape(-1, 3)).reshape(-1, count).mean(1)
