"""Order measurements for short moves, as an open path from the parking position.

The path starts from nearest neighbours. 2-opt then reverses stretches of the path until no reversal helps, for at most
8 rounds. If the result is no shorter than the given order, the given order is kept.
"""

import numpy as np


def shortest_order(moves: np.ndarray, first: np.ndarray) -> list[int]:
    """Return a short order of N places, given the seconds of all moves (N, N) and of the first moves (N,)."""
    given = list(range(len(moves)))
    if len(given) < 2:
        return given
    path = _exchanged(_nearest(moves, first), moves, first)
    return path if seconds(path, moves, first) < seconds(given, moves, first) else given


def seconds(path: list[int], moves: np.ndarray, first: np.ndarray) -> float:
    """Return the seconds of a path from the start to its last place; 0 for an empty path."""
    if not path:
        return 0.0
    return float(first[path[0]] + moves[path[:-1], path[1:]].sum())


def _nearest(moves: np.ndarray, first: np.ndarray) -> list[int]:
    path = [int(np.argmin(first))]
    left = np.ones(len(moves), dtype=bool)
    left[path[0]] = False
    while left.any():
        path.append(int(np.argmin(np.where(left, moves[path[-1]], np.inf))))
        left[path[-1]] = False
    return path


def _exchanged(path: list[int], moves: np.ndarray, first: np.ndarray, rounds: int = 8) -> list[int]:
    places = np.array(path)
    count = len(places)
    for _ in range(rounds):
        improved = False
        for start in range(count - 1):
            # Turning places[start..end] round changes the moves into its first and out of its last place.
            ends = np.arange(start + 1, count)
            into = first if start == 0 else moves[places[start - 1]]
            change = into[places[ends]] - into[places[start]]
            after = ends[:-1] + 1
            change[:-1] += moves[places[start], places[after]] - moves[places[ends[:-1]], places[after]]
            best = int(np.argmin(change))
            if change[best] < -1e-9:
                places[start : ends[best] + 1] = places[start : ends[best] + 1][::-1]
                improved = True
        if not improved:
            break
    return places.tolist()
