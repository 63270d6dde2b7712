"""Summarise a quantity over several fits: mean, minimum, maximum, standard deviation."""

import math
import statistics
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """The spread of `count` numbers; `deviation` is the sample standard deviation (n − 1), None for a single number
    and where one is not finite."""

    count: int
    mean: float
    low: float
    high: float
    deviation: float | None

    @classmethod
    def of(cls, numbers: Iterable[float]) -> "Spread":
        """Return the spread of at least one number."""
        values = [float(number) for number in numbers]
        # An infinite PSNR has no deviation.
        deviation = statistics.stdev(values) if len(values) > 1 and all(map(math.isfinite, values)) else None
        return cls(len(values), statistics.fmean(values), min(values), max(values), deviation)

    def record(self) -> dict[str, float | None]:
        """Return the JSON form."""
        return {"mean": self.mean, "min": self.low, "max": self.high, "standard_deviation": self.deviation}
