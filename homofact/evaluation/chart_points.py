"""Group runs that differ only in seed or split into one point of a chart, with the spread of their results."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from homofact.evaluation.chart_ledger import ChartRow
from homofact.evaluation.means import mean_record
from homofact.evaluation.spread import Spread


@dataclass(frozen=True)
class ChartPoint:
    """The runs with the same method, search, requested textures and size; `rows` are sorted by split, then seed."""

    rows: tuple[ChartRow, ...]

    @property
    def first(self) -> ChartRow:
        """The run of the lowest seeds."""
        return self.rows[0]

    @property
    def seeds(self) -> list[int]:
        """The seeds of the fits, each once."""
        return sorted({row.seed for row in self.rows})

    @property
    def splits(self) -> list[int]:
        """The seeds of the splits, each once."""
        return sorted({row.split_seed for row in self.rows})

    @property
    def series(self) -> str:
        """What it shares with its like in a chart."""
        return self.first.series

    @property
    def is_reference(self) -> bool:
        """Whether this is McCool's own factorization."""
        return self.first.is_reference

    @property
    def textures(self) -> str:
        """The number of textures of the fits: "2", or "1–2" if the runs differ."""
        low, high = (end(row.textures for row in self.rows) for end in (min, max))
        return str(low) if low == high else f"{low}–{high}"

    @property
    def error(self) -> Spread:
        """The held-out Cole error."""
        return Spread.of(row.held_out.log_mse for row in self.rows)

    def by_split(self) -> dict[int, float]:
        """Return the mean held-out Cole error on each split, by the seed of the split."""
        return {
            split: fmean(row.held_out.log_mse for row in self.rows if row.split_seed == split) for split in self.splits
        }

    @property
    def seconds(self) -> Spread:
        """Fitting time in seconds."""
        return Spread.of(row.seconds_fit for row in self.rows)

    @property
    def bytes(self) -> Spread:
        """Bytes of the textures as float32."""
        return Spread.of(row.bytes for row in self.rows)

    @property
    def fetches(self) -> Spread:
        """Texture lookups of one evaluation."""
        return Spread.of(row.fetches for row in self.rows)

    def record(self) -> dict[str, Any]:
        """Return the JSON form of the run; for several runs their means, with seeds, splits and spread."""
        records = [row.record() for row in self.rows]
        if len(records) == 1:
            return records[0]
        return mean_record(records, self.seeds, self.splits) | {"textures": self.textures}


def points_of(rows: Iterable[ChartRow]) -> list[ChartPoint]:
    """Return the points of a chart's rows, in the order of each one's first row."""
    by_point: dict[tuple[str, str, int, int], dict[tuple[int, int], ChartRow]] = {}
    for row in rows:
        point = by_point.setdefault((row.label, row.search, row.textures_asked, row.size), {})
        point.setdefault((row.split_seed, row.seed), row)
    return [ChartPoint(tuple(runs[drawn] for drawn in sorted(runs))) for runs in by_point.values()]


def best_lower_on(points: Sequence[ChartPoint]) -> list[int | None]:
    """Return for each point the number of splits on which the best point has a lower error; None for the best point.

    The best point is the one with the lowest mean error. Several seeds on a split count once, by their mean error.
    Splits on which a point has no run are not counted.
    """
    best = min(points, key=lambda point: point.error.mean)
    own = best.by_split()
    return [
        None if point is best else sum(own[split] < error for split, error in point.by_split().items() if split in own)
        for point in points
    ]


def reference(points: Sequence[ChartPoint]) -> ChartPoint | None:
    """Return McCool's own factorization with the lowest mean Cole error above 0, or None where the chart has none."""
    mccool = [point for point in points if point.is_reference and 0 < point.error.mean < float("inf")]
    return min(mccool, key=lambda point: point.error.mean, default=None)
