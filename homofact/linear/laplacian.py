"""Smoothing rows: the 5-point Laplacian of a texture, inside its mask (McCool 2001; thesis 3.2.5).

At a texel with both neighbours along an axis the row has the second difference of that axis; both axes
give the 5-point Laplacian, the texture's edge gives the difference along it. A texel that is in no such
row is tied to the mean of the neighbours it has. On a whole rectangle the null space is
{1, x, y, xy}: smoothing costs nothing on ramps, so it bends a fit, but never flattens it.
"""

import torch
from torch import Tensor


def laplacian(mask: Tensor) -> Tensor:
    """The rows (T, T), dense float64, of a texture with T = rows × columns texels.

    Rows and columns of texels outside `mask` (rows, columns) are zero.
    """
    rows, columns = mask.shape
    count = rows * columns
    inside = mask.reshape(-1)
    number = torch.arange(count, device=mask.device).reshape(rows, columns)
    result = torch.zeros(count, count, dtype=torch.float64, device=mask.device)
    axes = (
        (number[:, 1:-1].reshape(-1), number[:, :-2].reshape(-1), number[:, 2:].reshape(-1)),
        (number[1:-1].reshape(-1), number[:-2].reshape(-1), number[2:].reshape(-1)),
    )
    for centre, before, after in axes:
        whole = inside[centre] & inside[before] & inside[after]
        c = centre[whole]
        result[c, c] += 2
        result[c, before[whole]] -= 1
        result[c, after[whole]] -= 1
    for texel in (inside & (result.abs().sum(0) == 0)).nonzero().flatten().tolist():
        row, column = divmod(texel, columns)
        around = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
        near = [r * columns + c for r, c in around if 0 <= r < rows and 0 <= c < columns and bool(mask[r, c])]
        if near:
            result[texel, texel] = len(near)
            result[texel, near] = -1.0
    return result
