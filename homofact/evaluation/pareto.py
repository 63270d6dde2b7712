"""Pareto fronts: the points that no other point beats in two quantities to be minimised."""

import math
from collections.abc import Sequence


def dominates(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Return whether `a` is nowhere larger than `b` and somewhere smaller."""
    return a[0] <= b[0] and a[1] <= b[1] and a != b


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Return the indices of the points that no other dominates, sorted by rising first coordinate.

    Equal points are all on the front. Points with a coordinate that is not finite are not.
    """
    order = sorted((i for i, point in enumerate(points) if all(map(math.isfinite, point))), key=lambda i: points[i])
    places: list[int] = []
    for i in order:
        if not places or points[i][1] < points[places[-1]][1] or points[i] == points[places[-1]]:
            places.append(i)
    return places
