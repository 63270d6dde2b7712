"""Several fits that differ in their seed alone: how much of an error is luck.

    several = fit_seeds(source, settings, 5)
    several.held_out["log_mse"].mean, several.held_out["log_mse"].deviation

The split keeps its own seed, so all fits have the same training samples and are measured on the same held-out ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput, Status
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.means import mean_record
from homofact.evaluation.metric_table import SIX
from homofact.evaluation.metrics import SixErrors
from homofact.evaluation.spread import Spread
from homofact.methods.fitting import ProgressCallback
from homofact.methods.method import Method


@dataclass(frozen=True)
class SeedRows:
    """The rows of one method by several seeds, at least one, on one split."""

    rows: tuple[ComparisonRow, ...]

    def __post_init__(self) -> None:
        """Refuse rows of several splits, whose errors are not of the same samples."""
        if not self.rows:
            raise BadInput(where="seeds", found="no fit", expected="at least one")
        if len({row.split for row in self.rows}) > 1:
            raise BadInput(where="seeds", found="fits on different splits", expected="one split for all")

    @property
    def seeds(self) -> tuple[int, ...]:
        """The fits' seeds."""
        return tuple(row.settings.seed for row in self.rows)

    @property
    def first(self) -> ComparisonRow:
        """The row of the first seed."""
        return self.rows[0]

    @property
    def held_out(self) -> dict[str, Spread]:
        """Every error on the held-out samples, by name."""
        return _spreads([row.held_out for row in self.rows])

    @property
    def train(self) -> dict[str, Spread]:
        """Every error on the training samples, by name."""
        return _spreads([row.train for row in self.rows])

    def record(self) -> dict[str, Any]:
        """Return the JSON form: that of a row, with means as its errors, times and evaluations.

        "seeds" are the fits', "spread" has the mean, least, greatest and standard deviation of each, and "rows" every
        row by itself. Textures, bytes and fetches are those of the largest fit. One seed is that of the row itself.
        """
        records = [row.record() for row in self.rows]
        if len(records) == 1:
            return records[0]
        return mean_record(records) | {
            "textures": max(record["textures"] for record in records),
            "shapes": max(records, key=lambda record: record["bytes"])["shapes"],
            "rows": records,
        }


def fit_seeds(
    source: Source,
    settings: Method,
    seeds: int | Sequence[int],
    held_out: float = HELD_OUT,
    progress: ProgressCallback | None = None,
    subset: int = 0,
    split_seed: int | None = None,
) -> SeedRows:
    """Fit one method by every one of `seeds` and measure each on the same split.

    A number of seeds counts up from that of `settings`, which also draws the split unless `split_seed` does. An
    interrupted fit is the last. Raises BadInput for no seeds, and as `fit_and_measure`.
    """
    listed = seeds_from(settings.seed, seeds) if isinstance(seeds, int) else tuple(seeds)
    drawn = settings.seed if split_seed is None else split_seed
    rows: list[ComparisonRow] = []
    for seed in listed:
        rows.append(fit_and_measure(source, replace(settings, seed=seed), held_out, progress, subset, drawn))
        if rows[-1].report.status is Status.INTERRUPTED:
            break
    return SeedRows(tuple(rows))


def asked_seeds(first: int, text: str) -> tuple[int, ...]:
    """Return the seeds that "3" (so many from `first` on) or "0,1,2" (these) asks for.

    Raises BadInput for anything else, none, and one that stands twice.
    """
    words = [word.strip() for word in text.split(",")]
    listed = "," in text
    words = words[:-1] if listed and not words[-1] else words
    # Digits alone, of which int would also take other alphabets'.
    if not all(word.isascii() and word.isdigit() and len(word) < 20 for word in words):
        raise BadInput(
            where="seeds", found=repr(text), expected="how many (3), or the seeds themselves with commas (0,1,2)"
        )
    numbers = tuple(map(int, words))
    if not listed:
        return seeds_from(first, numbers[0])
    if max(numbers) >= 2**63 or len(set(numbers)) < len(numbers):
        raise BadInput(where="seeds", found=repr(text), expected="different seeds below 2^63")
    return numbers


def seeds_from(first: int, count: int) -> tuple[int, ...]:
    """Return `count` seeds from `first` on. Raises BadInput for none."""
    if count < 1:
        raise BadInput(where="seeds", found=count, expected="at least 1")
    return tuple(range(first, first + count))


def _spreads(errors: Sequence[SixErrors]) -> dict[str, Spread]:
    return {name: Spread.of(getattr(error, name) for error in errors) for name in SIX}
