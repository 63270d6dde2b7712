"""Trees that find the nearest of many points, made by scipy when the first one is needed.

scipy.spatial and what it loads take a fifth of a second, and many commands look for no neighbours at all.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.spatial import KDTree


def tree_of(places: np.ndarray) -> "KDTree":
    """Return scipy's tree of points (N, k).

    Raises
    ------
    ValueError
        For an array of another dimension, or one with values that are not finite.
    """
    from scipy.spatial import KDTree

    return KDTree(places)
