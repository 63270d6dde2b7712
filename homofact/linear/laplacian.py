"""Smoothing rows: the 5-point Laplacian of a texture, inside its mask (McCool 2001; thesis 3.2.5).

If a texel has both neighbours along an axis, its row contains the second difference along that axis. With both axes,
this is the 5-point Laplacian; at the edge of the texture, it is the second difference along the edge. A texel that
occurs in no such row gets a row for its difference from the mean of its neighbours. On a whole rectangle, the null
space is {1, x, y, xy}: ramps have no smoothing cost, so smoothing does not flatten them.

A periodic axis has no edge: the last texels precede the first. The null space then contains only periodic functions:
{1, y} if x is periodic and {1} if both axes are. At a pole (`linear.layout`), the n texels of the pole's line represent
one point, so each is a neighbour of all others. Instead of the second difference along the line, each has the row n y −
Σ y over the line. This row is zero if the texels are equal, as every function on the surface requires, and its weight
grows with the number of texels at the place.
"""

import numpy as np
import scipy.sparse
from torch import Tensor

from homofact.linear.layout import CLAMPED, Axes, Axis


def laplacian(mask: Tensor, axes: Axes = CLAMPED) -> scipy.sparse.csr_matrix:
    """Return the rows (T, T), sparse float64 on the CPU, of a texture with T = rows × columns texels.

    Rows and columns of texels outside `mask` (rows, columns) are empty; `axes` are the kinds of its axes.
    """
    rows, columns = mask.shape
    count = rows * columns
    inside = mask.reshape(-1).cpu().numpy()
    number = np.arange(count).reshape(rows, columns)
    entries: list[tuple[np.ndarray, np.ndarray, float]] = []
    for own, other, lines in ((axes[1], axes[0], number.T), (axes[0], axes[1], number)):
        # `lines` (texels along this axis, texels along the other).
        before, centre, after = np.roll(lines, 1, 0), lines, np.roll(lines, -1, 0)
        if own is not Axis.PERIODIC:
            before, centre, after = before[1:-1], centre[1:-1], after[1:-1]
        if other is Axis.POLAR:
            before, centre, after = before[:, 1:], centre[:, 1:], after[:, 1:]
            pole = lines[:, 0][inside[lines[:, 0]]]
            if len(pole) > 1:
                entries.append((np.repeat(pole, len(pole)), np.tile(pole, len(pole)), -1.0))
                entries.append((pole, pole, float(len(pole))))
        kept = inside[centre] & inside[before] & inside[after]
        c = centre[kept]
        entries += [(c, c, 2.0), (c, before[kept], -1.0), (c, after[kept], -1.0)]
    held = np.zeros(count, dtype=bool)
    for _, texels, _ in entries:
        held[texels] = True
    for texel in np.flatnonzero(inside & ~held).tolist():
        near = [neighbour for neighbour in _around(texel, rows, columns, axes) if inside[neighbour]]
        if near:
            alone = np.full(len(near), texel)
            entries += [(alone[:1], alone[:1], float(len(near))), (alone, np.asarray(near), -1.0)]
    where = tuple(np.concatenate([entry[place] for entry in entries]) for place in (0, 1))
    values = np.concatenate([np.full(len(texels), value) for texels, _, value in entries])
    result = scipy.sparse.csr_matrix((values, where), shape=(count, count))
    result.eliminate_zeros()
    return result


def _around(texel: int, rows: int, columns: int, axes: Axes) -> list[int]:
    """The numbers of up to four neighbours of a texel."""
    row, column = divmod(texel, columns)
    neighbours = set()
    for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
        r = r % rows if axes[0] is Axis.PERIODIC else r
        c = c % columns if axes[1] is Axis.PERIODIC else c
        if 0 <= r < rows and 0 <= c < columns:
            neighbours.add(r * columns + c)
    return sorted(neighbours - {texel})
