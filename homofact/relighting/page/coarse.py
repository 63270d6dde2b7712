"""Fewer triangles for moving pictures: vertices collapse into a neighbour, the cheapest edges first.

This is half-edge collapse (see Hoppe 1996): vertices keep their places and their light, so only a list of triangles is
added to the page. In each round every edge gets a cost from its squared length and from the angle between the normals
of its ends. The cheapest edges collapse first, and each vertex and its ring takes part at most once per round. No edge
collapses that would flip a triangle, pinch the surface or move its border.
"""

import numpy as np

from homofact.linear.kernels import kernel
from homofact.meshes.mesh import Mesh

PART = 0.25
# Fewer triangles than this are drawn as they are.
FEW = 4000
_ROUNDS = 40
# An edge in a flat place still counts by its length: light changes there too.
_FLAT = 0.1
# What a triangle may turn by in one collapse, and stand off the normals of its corners: 60°.
_LEAST = 0.5


def coarse_triangles(mesh: Mesh) -> np.ndarray | None:
    """Triangles (T', 3) among a mesh's vertices, about a quarter of its own; None where more than half must stay."""
    triangles = np.ascontiguousarray(mesh.triangles, np.int64)
    count = len(triangles)
    if count < FEW:
        return None
    positions, normals = (np.ascontiguousarray(each, np.float64) for each in (mesh.positions, mesh.normals))
    goal = int(PART * count)
    for _ in range(_ROUNDS):
        if len(triangles) <= goal:
            break
        target = _collapses(triangles, positions, normals, (len(triangles) - goal + 1) // 2)
        moved = target[triangles]
        kept = (moved[:, 0] != moved[:, 1]) & (moved[:, 1] != moved[:, 2]) & (moved[:, 2] != moved[:, 0])
        if kept.all():
            break
        triangles = moved[kept]
    return triangles if len(triangles) <= count // 2 else None


def _collapses(triangles: np.ndarray, positions: np.ndarray, normals: np.ndarray, most: int) -> np.ndarray:
    """Return the vertex (V,) into which each vertex collapses in one round of at most `most` collapses."""
    edges = np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    one, sides = np.unique(np.sort(edges, 1), axis=0, return_counts=True)
    held = np.zeros(len(positions), np.bool_)
    held[one[sides != 2]] = True
    part = positions[one[:, 0]] - positions[one[:, 1]]
    bend = 1 + _FLAT - (normals[one[:, 0]] * normals[one[:, 1]]).sum(1)
    order = one[np.argsort((part**2).sum(1) * bend, kind="stable")]
    flat = triangles.reshape(-1)
    start = np.concatenate(([0], np.cumsum(np.bincount(flat, minlength=len(positions)))))
    around = np.argsort(flat, kind="stable") // 3
    return _round(triangles, positions, normals, order, held, start, around, most)


@kernel()
def _round(
    triangles: np.ndarray,
    positions: np.ndarray,
    normals: np.ndarray,
    order: np.ndarray,
    held: np.ndarray,
    start: np.ndarray,
    around: np.ndarray,
    most: int,
) -> np.ndarray:
    """Return the collapses of a round; `held` (V,) vertices and neighbours of a collapse do not move."""
    target = np.arange(len(positions))
    touched = np.zeros(len(positions), np.bool_)
    mark = np.full(len(positions), -1)
    done = 0
    for e in range(len(order)):
        if done == most:
            break
        for turn in range(2):
            v, u = order[e, turn], order[e, 1 - turn]
            if held[v] or touched[v] or touched[u]:
                continue
            if not _fits(triangles, positions, normals, start, around, mark, v, u):
                continue
            target[v] = u
            for p in range(start[v], start[v + 1]):
                for w in triangles[around[p]]:
                    touched[w] = True
            done += 1
            break
    return target


@kernel()
def _fits(
    triangles: np.ndarray,
    positions: np.ndarray,
    normals: np.ndarray,
    start: np.ndarray,
    around: np.ndarray,
    mark: np.ndarray,
    v: int,
    u: int,
) -> bool:
    """Return whether v may collapse into u: their rings share only two vertices, and no triangle flips."""
    for p in range(start[u], start[u + 1]):
        for w in triangles[around[p]]:
            mark[w] = u
    shared, seen = 0, -2 - u
    for p in range(start[v], start[v + 1]):
        corner = triangles[around[p]]
        a, b, c = corner[0], corner[1], corner[2]
        for w in corner:
            if w != v and w != u and mark[w] == u:
                shared += 1
                mark[w] = seen
        if u in (a, b, c):
            continue
        before = _normal(positions[a], positions[b], positions[c])
        x, y, z = u if a == v else a, u if b == v else b, u if c == v else c
        after = _normal(positions[x], positions[y], positions[z])
        if _cosine(before, after) < _LEAST or _cosine(after, normals[x] + normals[y] + normals[z]) < _LEAST:
            return False
    return shared == 2


@kernel()
def _cosine(a: np.ndarray, b: np.ndarray) -> float:
    """Return the cosine of the angle between two vectors; 0 if one has zero length."""
    lengths = np.sqrt((a**2).sum() * (b**2).sum())
    return (a * b).sum() / lengths if lengths > 0 else 0.0


@kernel()
def _normal(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return the cross product of two sides of a triangle."""
    p, q = b - a, c - a
    return np.array([p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]])
