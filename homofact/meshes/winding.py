"""Orient the triangles of a mesh without normals consistently; otherwise the normals of neighbours would cancel.

Two triangles that share an edge agree if they traverse it in opposite directions. A graph contains each triangle twice,
unchanged and flipped, and its edges join triangles that agree. A connected part of the mesh then gives two components,
one per orientation, or a single component if it has only one side, like a Möbius strip.
"""

import numpy as np


def wound_alike(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Return triangles (T, 3), flipping in each part those that disagree with most others, and the flip count.

    A closed part with flipped triangles is then wound outward as a whole. Edges of more than two triangles are ignored,
    and one-sided parts do not change. Vertices at the same position count as one.
    """
    count = len(triangles)
    first, second, alike = _neighbours(positions, triangles)
    if alike.all():
        return triangles, 0
    # Few meshes come this far.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # As they are from 0, turned from `count`.
    ends = np.where(alike, second, second + count)
    others = np.where(alike, second + count, second)
    rows, columns = np.concatenate((first, first + count)), np.concatenate((ends, others))
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(2 * count, 2 * count))
    label = connected_components(graph, directed=False)[1]
    kept, turned = label[:count], label[count:]
    part = np.minimum(kept, turned)
    away = kept != part
    # The majority of a part stays.
    size, minority = np.bincount(part, minlength=2 * count), np.bincount(part, away, 2 * count)
    mixed = (minority > 0) & (minority < size) & np.bincount(part, kept != turned, 2 * count).astype(bool)
    away = np.where(2 * minority[part] > size[part], ~away, away) & mixed[part]
    made = np.where(away[:, None], triangles[:, ::-1], triangles)
    a, b, c = (positions[made[:, k]] for k in range(3))
    volume = np.bincount(part, (a * np.cross(b, c)).sum(1), 2 * count)
    edges = np.bincount(np.concatenate((part[first], part[second])), minlength=2 * count)
    inward = mixed & (edges == 3 * size) & (volume < 0)
    made = np.where(inward[part][:, None], made[:, ::-1], made)
    return made, int((away ^ inward[part]).sum())


def _neighbours(positions: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (E,) pairs of triangles that share an edge with no third one, and whether they agree."""
    place = np.unique(positions, axis=0, return_inverse=True)[1].reshape(-1)
    corners = place[triangles]
    start, end = corners.T.ravel(), np.roll(corners, -1, 1).T.ravel()
    owner = np.tile(np.arange(len(triangles)), 3)
    real = start != end
    start, end, owner = start[real], end[real], owner[real]
    key = np.minimum(start, end) * (place.max() + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    begins = np.flatnonzero(np.r_[True, np.diff(key[order]) > 0])
    pairs = begins[np.diff(np.r_[begins, len(order)]) == 2]
    one, two = order[pairs], order[pairs + 1]
    return owner[one], owner[two], start[one] != start[two]
