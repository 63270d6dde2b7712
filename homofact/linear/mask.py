"""Masks: which texels the projected domain can reach (thesis 3.2.4).

The domain of a projection (two discs, or a box) is convex and the projection linear, so its image is
the convex hull of the projected extreme points. A texel counts when its centre lies in the hull or a
point of the hull's rim reads it (a hull may be thinner than a texel); the neighbours of these count
too, so that bilinear interpolation at the rim finds all four texels.
"""

import numpy as np
import torch
from scipy.ndimage import binary_dilation
from scipy.spatial import ConvexHull, QhullError
from torch import Tensor

from homofact.linear.bilinear import stencil


def covered(points: Tensor, shape: tuple[int, int]) -> Tensor:
    """Mask (rows, columns) of the convex hull of `points` (M, 2) in texture coordinates, and its neighbours.

    Points on one line have no area; the texels along the segment between the outermost count.
    """
    rows, columns = shape
    try:
        hull = ConvexHull(points.cpu().numpy())
        equations = torch.from_numpy(hull.equations)
        rim = points.cpu()[torch.from_numpy(hull.vertices.astype(np.int64))]
    except (QhullError, ValueError):
        equations = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)  # contains nothing
        order = np.lexsort(points.cpu().numpy().T)
        rim = points.cpu()[[order[0], order[-1]]]
    # One texel alone sits at 0, in the middle of what it stands for.
    centres = [torch.linspace(-1, 1, n, dtype=torch.float64) if n > 1 else torch.zeros(1).double() for n in shape]
    grid = torch.cartesian_prod(*centres)
    inside = (grid.flip(-1) @ equations[:, :2].T + equations[:, 2] <= 1e-9).all(-1)
    along = torch.linspace(0, 1, 2 * (rows + columns), dtype=torch.float64)[:, None, None]
    edges = rim + along * (rim.roll(-1, 0) - rim)
    numbers, weights = stencil(edges.reshape(-1, 2), shape)
    inside[numbers[weights > 0]] = True
    return torch.from_numpy(binary_dilation(inside.reshape(shape).numpy(), np.ones((3, 3))))
