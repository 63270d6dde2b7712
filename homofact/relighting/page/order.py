"""The order of a mesh's triangles that lets a graphics card shade few vertices twice.

A card keeps the last vertices that it has processed. Sander, Nehab and Barczak (2007) walk over the mesh fan by fan.
They draw all remaining triangles around a vertex, and go on to the neighbour that is still in the cache and has the
most remaining triangles. If there is none, they return to the last vertex with remaining triangles. A scanned mesh
needs two shaded vertices per triangle in the order of its file, and about 0.7 in this order.
"""

import numpy as np

from homofact.linear.kernels import kernel

CACHE = 16


def cached_order(triangles: np.ndarray) -> np.ndarray:
    """Return all triangles (T, 3) in that order, each unchanged."""
    flat = np.ascontiguousarray(triangles, np.int64).reshape(-1)
    if not len(flat):
        return triangles
    count = np.bincount(flat)
    start = np.concatenate(([0], np.cumsum(count)))
    around = np.argsort(flat, kind="stable") // 3
    return triangles[_walk(flat.reshape(-1, 3), start, around, count)]


@kernel()
def _walk(triangles: np.ndarray, start: np.ndarray, around: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return the triangle indices in drawing order; `left` (V,), the remaining triangles per vertex, is overwritten."""
    vertices = len(left)
    stamp = np.full(vertices, -CACHE - 1)
    drawn = np.zeros(len(triangles), np.bool_)
    order = np.empty(len(triangles), np.int64)
    # Each vertex that was touched, the last on top: where to go on from a dead end.
    stack = np.empty(3 * len(triangles), np.int64)
    place, depth, time, cursor, at = 0, 0, 0, 0, 0
    while True:
        first = depth
        for p in range(start[at], start[at + 1]):
            t = around[p]
            if drawn[t]:
                continue
            drawn[t] = True
            order[place] = t
            place += 1
            for v in triangles[t]:
                stack[depth] = v
                depth += 1
                left[v] -= 1
                if time - stamp[v] > CACHE:
                    stamp[v] = time
                    time += 1
        best, found = -1, -1
        for p in range(first, depth):
            v = stack[p]
            if left[v] <= 0:
                continue
            age = time - stamp[v]
            # Its fan must fit into what is kept, or it is as good as new.
            priority = age if age + 2 * left[v] <= CACHE else 0
            if priority > best:
                best, found = priority, v
        while found < 0 and depth > 0:
            depth -= 1
            if left[stack[depth]] > 0:
                found = stack[depth]
        while found < 0 and cursor < vertices:
            if left[cursor] > 0:
                found = cursor
            cursor += 1
        if found < 0:
            return order[:place]
        at = found
