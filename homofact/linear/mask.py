"""Masks: which texels the projected domain can reach (thesis 3.2.4).

The domain of a projection (two discs, or a box) is convex and the projection linear, so its image is
the convex hull of the projected extreme points. A texel belongs to the mask if its centre lies in the hull, or if a
lookup on the hull's boundary reads it (a hull may be thinner than a texel). Neighbours of these texels also belong to
the mask, so that bilinear interpolation at the boundary has all four texels.

For the hull, a periodic axis is the interval from −1 to +1. Its first texel belongs to the mask if either end does.
Growing and filling continue across the ends.
"""

import numpy as np
import torch
from torch import Tensor

from homofact.linear.bilinear import stencil
from homofact.linear.layout import CLAMPED, Axes, Axis, Shape, texel_centres

_AROUND = np.ones((3, 3))


def covered(points: Tensor, shape: Shape, axes: Axes = CLAMPED) -> Tensor:
    """Return the mask (rows, columns) of the convex hull of `points` (M, 2) in texture coordinates, with neighbours.

    If the points lie on one line, the mask contains the texels along the segment between the outermost points.
    """
    from scipy.spatial import ConvexHull, QhullError  # not by commands that read a fit alone

    flat = points.cpu()
    try:
        hull = ConvexHull(flat.numpy())
        equations = torch.from_numpy(hull.equations)
        rim = flat[torch.from_numpy(hull.vertices.astype(np.int64))]
    except (QhullError, ValueError):
        equations = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, device="cpu")  # contains nothing
        order = np.lexsort(flat.numpy().T)
        rim = flat[[order[0], order[-1]]]
    # Flat, a periodic axis has its first texel at both ends.
    ends = [(centres, centres[:1] + 2) for centres in map(texel_centres, shape, axes)]
    places = [torch.cat(end) if axis is Axis.PERIODIC else end[0] for end, axis in zip(ends, axes, strict=True)]
    grid = torch.cartesian_prod(*places)
    inside = (grid.flip(-1) @ equations[:, :2].T + equations[:, 2] <= 1e-9).all(-1).reshape(*map(len, places))
    for dimension, axis in enumerate(axes):
        if axis is Axis.PERIODIC:
            first, last = inside.select(dimension, 0), inside.select(dimension, -1)
            first |= last
            inside = inside.narrow(dimension, 0, shape[dimension])
    along = torch.linspace(0, 1, 2 * sum(shape), dtype=torch.float64, device="cpu")[:, None, None]
    edges = rim + along * (rim.roll(-1, 0) - rim)
    numbers, weights = stencil(edges.reshape(-1, 2), shape, axes=axes)
    reached = inside.reshape(-1).clone()
    reached[numbers[weights > 0]] = True
    return grown(reached.reshape(shape), 1, axes).to(points.device)


def grown(mask: Tensor, steps: int, axes: Axes = CLAMPED) -> Tensor:
    """Return the mask (rows, columns) grown by `steps` texels, also diagonally, across periodic ends and poles."""
    from scipy.ndimage import binary_dilation

    array = mask.cpu().numpy()
    rounds = tuple((1, 1) if axis is Axis.PERIODIC else (0, 0) for axis in axes)
    cut = tuple(slice(1, -1) if axis is Axis.PERIODIC else slice(None) for axis in axes)
    for _ in range(steps):
        array = binary_dilation(np.pad(array, rounds, mode="wrap"), _AROUND)[cut].copy()
        for line, axis in ((array[0], axes[0]), (array[:, 0], axes[1])):
            if axis is Axis.POLAR and line.any():
                line[:] = True
    return torch.from_numpy(array).to(mask.device)


def filled(texture: Tensor, mask: Tensor, axes: Axes = CLAMPED) -> Tensor:
    """Return the texture with each texel outside the mask set to the value of the nearest texel inside."""
    from scipy.ndimage import distance_transform_edt

    outside = ~mask.cpu().numpy()
    rounds = tuple((n, n) if axis is Axis.PERIODIC else (0, 0) for n, axis in zip(mask.shape, axes, strict=True))
    wide = np.pad(outside, rounds, mode="wrap")
    places = np.asarray(distance_transform_edt(wide, return_distances=False, return_indices=True))
    cut = tuple(slice(before, before + n) for (before, _), n in zip(rounds, mask.shape, strict=True))
    row, column = (
        torch.from_numpy(place[cut] % n).long().to(texture.device) for place, n in zip(places, mask.shape, strict=True)
    )
    return texture[row, column]
