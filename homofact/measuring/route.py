"""An order of measurements with short moves: an open path from where the axes are parked.

Nearest neighbours first, then exchanges of the ends of every stretch (2-opt) until none helps. The order that was given
is kept where it is no longer.
"""

import numpy as np


def shortest_order(moves: np.ndarray, first: np.ndarray) -> list[int]:
    """A short order of N places, of the seconds (N, N) between and (N,) from the start; no longer than 0, 1, 2 …"""
    given = list(range(len(moves)))
    if len(given) < 2:
        return given
    path = _exchanged(_nearest(moves, first), moves, first)
    return path if seconds(path, moves, first) < seconds(given, moves, first) else given


def seconds(path: list[int], moves: np.ndarray, first: np.ndarray) -> float:
    """Return what a path takes, from the start to its last place; 0 for none."""
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
