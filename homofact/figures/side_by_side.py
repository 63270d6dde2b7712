"""Move markers that would cover each other sideways, just so far that each one is seen whole."""

import math
from collections.abc import Sequence

_APART = 1.0  # between the edges of two markers
_FARTHEST = 14  # points sideways: farther away, a marker would show another quantity
_MOVES = (0.0, *(float(side * step) for step in range(1, _FARTHEST + 1) for side in (1, -1)))


def side_by_side(points: Sequence[tuple[float, float]], radii: Sequence[float]) -> list[float]:
    """Return for each point (x, y) how far to move its marker in x, in the unit of the points (1/72 inch).

    Earlier points move less: each one takes the nearest free place beside those before it. If no place within
    `_FARTHEST` is free, it takes the one where it is covered least.

    Examples
    --------
    >>> side_by_side([(0, 0), (1, 0), (0, 20)], [3, 3, 3])
    [0.0, 6.0, 0.0]
    """
    placed: list[tuple[float, float, float]] = []
    moves = []
    for (x, y), radius in zip(points, radii, strict=True):
        room = [_room(x + move, y, radius, placed) for move in _MOVES]
        free = [move for move, space in zip(_MOVES, room, strict=True) if space >= 0]
        move = free[0] if free else _MOVES[room.index(max(room))]
        placed.append((x + move, y, radius))
        moves.append(move)
    return moves


def _room(x: float, y: float, radius: float, placed: Sequence[tuple[float, float, float]]) -> float:
    """Return the least gap to the markers (x, y, radius) in their places, beyond `_APART`; below 0 if it is less."""
    gaps = (math.hypot(x - left, y - top) - radius - other - _APART for left, top, other in placed)
    return min(gaps, default=math.inf)
