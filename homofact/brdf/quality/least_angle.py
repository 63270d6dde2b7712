"""Find the angle that minimises a ratio of sums, with a bootstrap interval, from few evaluations.

The sums are computed per block, so one evaluation gives the sums of all bootstrap draws. All angles lie on one grid,
with steps of `COARSE` over the whole range and of `FINE` around the best coarse angle. Only a contiguous part of the
grid is evaluated. It starts with the steps next to the best angle. It grows at an end while the ratio has its minimum
at that end, for all blocks, for the first half of them, or for any draw. If each of these ratios has a single minimum,
the result is bit-identical to evaluating the whole grid.
"""

from collections.abc import Callable, Sequence

import numpy as np

COARSE, FINE = 0.05, 0.02  # degrees
DRAWS = 1000
_Sums = Callable[[float], np.ndarray]


def steps_round(centre: float, reach: float, step: float, limit: float) -> list[float]:
    """Return equally spaced angles within `reach` of `centre` and ±`limit`, rounded so that they compare equal."""
    grid = (centre + np.arange(-reach, reach + step / 2, step)).round(6) + 0.0
    return [degrees for degrees in grid.tolist() if abs(degrees) <= limit]


class LeastAngle:
    """Minimises the ratio of `sums(degrees)`, which returns numerators and denominators (2, 2 B) of 2 B blocks."""

    def __init__(self, sums: _Sums, known: dict[float, np.ndarray]) -> None:
        """Begin with the sums that are `known`."""
        self._sums = sums
        self._found = dict(known)

    def ratio(self, degrees: float) -> float:
        """Return the ratio of all blocks at an angle, evaluated once."""
        apart, both = self._at(degrees).sum(1)
        return float(apart / max(both, 1e-300))

    def best_of(self, grid: Sequence[float], guess: float) -> float:
        """Return the angle of an increasing grid with the least ratio, going downhill from the angle nearest
        `guess`."""
        place = min(range(len(grid)), key=lambda k: abs(grid[k] - guess))
        while True:
            beside = range(max(place - 1, 0), min(place + 2, len(grid)))
            # The first of equals, as over the whole grid.
            lowest = min(beside, key=lambda k: self.ratio(grid[k]))
            if lowest == place or self.ratio(grid[lowest]) == self.ratio(grid[place]):
                return grid[place]
            place = lowest

    def answer(self, grid: Sequence[float], best: float) -> tuple[float, tuple[float, float], float]:
        """Return (the angle of the least ratio, its 95% interval, the angle for the first half of the blocks).

        `grid` increases and contains `best`, around which the evaluated part of the grid grows.
        """
        first = last = grid.index(best)
        # What was evaluated on the way belongs to the run where it is beside it, and steps to both sides in any case.
        first, last = max(first - 1, 0), min(last + 1, len(grid) - 1)
        while first > 0 and grid[first - 1] >= best - COARSE:
            first -= 1
        while last < len(grid) - 1 and grid[last + 1] <= best + COARSE:
            last += 1
        while True:
            at = np.array(grid[first : last + 1])
            table = np.stack([self._at(degrees) for degrees in at.tolist()])
            drawn = self._drawn(table)
            lowest = _least(drawn)
            grown = first, last
            if first > 0 and bool((lowest == 0).any()):
                first -= 1
            if last < len(grid) - 1 and bool((lowest == len(at) - 1).any()):
                last += 1
            if (first, last) == grown:
                break
        vertex = _vertices(at, drawn, lowest)
        low, high = np.quantile(vertex[2:], (0.025, 0.975)).tolist()
        return float(vertex[0]), (low, high), float(vertex[1])

    def _at(self, degrees: float) -> np.ndarray:
        if degrees not in self._found:
            self._found[degrees] = self._sums(degrees)
        return self._found[degrees]

    @staticmethod
    def _drawn(table: np.ndarray) -> np.ndarray:
        """Ratios (K, 2 + DRAWS): of all blocks, of the first half of them, and of the draws, of a table (K, 2, 2 B)."""
        count = table.shape[2] // 2
        draws = np.random.default_rng(0).integers(0, count, (DRAWS, count))
        near, others = table[:, :, :count], table[:, :, count:]
        sums = np.concatenate(
            (table.sum(2)[:, :, None], near.sum(2)[:, :, None], (near + others)[:, :, draws].sum(3)), 2
        )
        return sums[:, 0] / np.maximum(sums[:, 1], 1e-300)


def _least(ratio: np.ndarray) -> np.ndarray:
    """Which of K angles is the first with the least ratio, (N,) of (K, N)."""
    return np.argmin(ratio, 0)


def _vertices(at: np.ndarray, ratio: np.ndarray, lowest: np.ndarray) -> np.ndarray:
    """The vertices (N,) of the parabolas through the least of K ratios and its neighbours, of (K, N)."""
    columns = np.arange(ratio.shape[1])
    inner = lowest.clip(1, len(at) - 2)
    below, above = at[inner - 1] - at[inner], at[inner + 1] - at[inner]
    left = (ratio[inner - 1, columns] - ratio[inner, columns]) / below
    right = (ratio[inner + 1, columns] - ratio[inner, columns]) / above
    curve = (right - left) / (above - below)
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = at[inner] - (left - curve * below) / (2 * curve)
    return np.where((inner == lowest) & (curve > 0), vertex, at[lowest])
