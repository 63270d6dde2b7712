"""Smoothing rows: the 5-point Laplacian of a texture, inside its mask (McCool 2001; thesis 3.2.5).

At a texel with both neighbours along an axis the row has the second difference of that axis; both axes
give the 5-point Laplacian, the texture's edge gives the difference along it. A texel that is in no such
row is tied to the mean of the neighbours it has. On a whole rectangle the null space is
{1, x, y, xy}: smoothing costs nothing on ramps, so it bends a fit, but never flattens it.

A periodic axis has no edge: the texels before the first are the last ones, and of the null space only what goes round
unchanged is left, {1, y} where x is periodic and {1} where both are. At a pole (`linear.layout`) the n texels of one
place are all neighbours of one another: in place of their second differences along the line, each has the row
n y − Σ y of the line, which costs nothing where they are equal, as a function on the surface must have them, and
binds the more the more texels share the place.
"""

import torch
from torch import Tensor

from homofact.linear.layout import CLAMPED, Axes, Axis


def laplacian(mask: Tensor, axes: Axes = CLAMPED) -> Tensor:
    """The rows (T, T), dense float64, of a texture with T = rows × columns texels.

    Rows and columns of texels outside `mask` (rows, columns) are zero; `axes` are the kinds of its axes.
    """
    rows, columns = mask.shape
    count = rows * columns
    # Many small steps: on the CPU, wherever the mask is.
    inside = mask.reshape(-1).cpu()
    number = torch.arange(count, device="cpu").reshape(rows, columns)
    result = torch.zeros(count, count, dtype=torch.float64, device="cpu")
    for own, other, lines in ((axes[1], axes[0], number.T), (axes[0], axes[1], number)):
        # `lines` (texels along this axis, texels along the other).
        before, centre, after = lines.roll(1, 0), lines, lines.roll(-1, 0)
        if own is not Axis.PERIODIC:
            before, centre, after = before[1:-1], centre[1:-1], after[1:-1]
        if other is Axis.POLAR:
            before, centre, after = before[:, 1:], centre[:, 1:], after[:, 1:]
            pole = lines[:, 0][inside[lines[:, 0]]]
            result[pole[:, None], pole] -= 1
            result[pole, pole] += len(pole)
        before, centre, after = before.flatten(), centre.flatten(), after.flatten()
        kept = inside[centre] & inside[before] & inside[after]
        c = centre[kept]
        result[c, c] += 2
        result[c, before[kept]] -= 1
        result[c, after[kept]] -= 1
    for texel in (inside & (result.abs().sum(0) == 0)).nonzero().flatten().tolist():
        near = [each for each in _around(texel, rows, columns, axes) if bool(inside[each])]
        if near:
            result[texel, texel] = len(near)
            result[texel, near] = -1.0
    return result.to(mask.device)


def _around(texel: int, rows: int, columns: int, axes: Axes) -> list[int]:
    """The numbers of up to four neighbours of a texel."""
    row, column = divmod(texel, columns)
    found = set()
    for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
        r = r % rows if axes[0] is Axis.PERIODIC else r
        c = c % columns if axes[1] is Axis.PERIODIC else c
        if 0 <= r < rows and 0 <= c < columns:
            found.add(r * columns + c)
    return sorted(found - {texel})
