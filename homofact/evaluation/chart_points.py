"""The points of a chart: the runs that differ in their seed alone are one, with the spread of what was measured."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from homofact.evaluation.chart_ledger import ChartRow
from homofact.evaluation.means import mean_record
from homofact.evaluation.spread import Spread


@dataclass(frozen=True)
class ChartPoint:
    """One or more runs of one method, search, number of textures asked for and size; `rows` by rising seed."""

    rows: tuple[ChartRow, ...]

    @property
    def first(self) -> ChartRow:
        """The run of the lowest seed."""
        return self.rows[0]

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
        """How many textures were kept: "2", or "1–2" where the seeds differ."""
        low, high = (end(row.textures for row in self.rows) for end in (min, max))
        return str(low) if low == high else f"{low}–{high}"

    @property
    def error(self) -> Spread:
        """The held-out Cole error."""
        return Spread.of(row.held_out.log_mse for row in self.rows)

    @property
    def seconds(self) -> Spread:
        """Of the fit."""
        return Spread.of(row.seconds_fit for row in self.rows)

    @property
    def bytes(self) -> Spread:
        """Of the textures as float32."""
        return Spread.of(row.bytes for row in self.rows)

    @property
    def fetches(self) -> Spread:
        """Texture lookups of one evaluation."""
        return Spread.of(row.fetches for row in self.rows)

    def record(self) -> dict[str, Any]:
        """The JSON form: that of the first run; with several seeds means, and beside them "seeds" and "spread"."""
        records = [row.record() for row in self.rows]
        return records[0] if len(records) == 1 else mean_record(records) | {"textures": self.textures}


def points_of(rows: Iterable[ChartRow]) -> list[ChartPoint]:
    """Return the points of a chart's rows, in the order of each one's first row."""
    by_point: dict[tuple[str, str, int, int], dict[int, ChartRow]] = {}
    for row in rows:
        by_point.setdefault((row.label, row.search, row.textures_asked, row.size), {}).setdefault(row.seed, row)
    return [ChartPoint(tuple(by_seed[seed] for seed in sorted(by_seed))) for by_seed in by_point.values()]


def reference(points: Sequence[ChartPoint]) -> ChartPoint | None:
    """Return McCool's own factorization with the lowest mean Cole error above 0, or None where the chart has none."""
    mccool = [point for point in points if point.is_reference and 0 < point.error.mean < float("inf")]
    return min(mccool, key=lambda point: point.error.mean, default=None)
