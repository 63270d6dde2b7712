"""Repeat fits of one method to one source with several seeds and splits, to see how much an error depends on chance.

    several = fit_repeats(source, settings, splits=5)
    several.held_out["log_mse"].mean, several.held_out["log_mse"].deviation

The seed determines the random choices of a method. On one split, the fits of all seeds use the same training samples
and are measured on the same held-out samples. The split determines which samples are held out. Splits of one source
share most of their training samples, so the deviation over them is no confidence interval: it shows how far the choice
of the held-out samples moves an error.
"""

import itertools
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
class RepeatedRows:
    """The rows of one method for several seeds or splits (at least one row), sorted by split, then by seed."""

    rows: tuple[ComparisonRow, ...]

    def __post_init__(self) -> None:
        """Refuse rows of splits that differ in more than their seed: another source, another part held out."""
        if not self.rows:
            raise BadInput(where="seeds", found="no fit", expected="at least one")
        if len({replace(row.split, seed=0) for row in self.rows}) > 1:
            found = "fits to other samples or other parts of them"
            raise BadInput(where="splits", found=found, expected="splits of one source into the same parts")

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of the fits, each once."""
        return tuple(dict.fromkeys(row.settings.seed for row in self.rows))

    @property
    def splits(self) -> tuple[int, ...]:
        """The seeds of the splits, each once."""
        return tuple(dict.fromkeys(row.split.seed for row in self.rows))

    def of_split(self, seed: int) -> "RepeatedRows":
        """Return the rows on the split with this `seed`. Raises BadInput if there is none."""
        return RepeatedRows(tuple(row for row in self.rows if row.split.seed == seed))

    @property
    def first(self) -> ComparisonRow:
        """The row of the first split and seed."""
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
        """Return the JSON form: that of one row, with the means of errors, times and evaluations.

        "seeds" are the seeds of the fits, and "splits" those of their splits. "spread" has the mean, minimum, maximum
        and standard deviation of each figure, and "rows" has the individual rows. Textures, bytes and fetches are those
        of the largest fit. A single row has its usual JSON form.
        """
        records = [row.record() for row in self.rows]
        if len(records) == 1:
            return records[0]
        return mean_record(records, self.seeds, self.splits) | {"rows": records}


def fit_repeats(
    source: Source,
    settings: Method,
    seeds: int | Sequence[int] = 1,
    held_out: float = HELD_OUT,
    progress: ProgressCallback | None = None,
    subset: int = 0,
    splits: int | Sequence[int] = 1,
) -> RepeatedRows:
    """Fit one method with each of `seeds` on each of `splits`, and measure each fit on the held-out samples.

    `seeds` and `splits` are sequences of seeds, or a number of consecutive seeds that start at the seed of `settings`.
    An interrupted fit is the last one. Raises BadInput if there are no seeds or splits, or several splits although
    nothing is held out, and for the reasons of `fit_and_measure`.
    """
    listed = seeds_from(settings.seed, seeds) if isinstance(seeds, int) else tuple(seeds)
    drawn = splits_from(settings.seed, splits, held_out) if isinstance(splits, int) else tuple(splits)
    rows: list[ComparisonRow] = []
    for split, seed in itertools.product(drawn, listed):
        rows.append(fit_and_measure(source, replace(settings, seed=seed), held_out, progress, subset, split))
        if rows[-1].report.status is Status.INTERRUPTED:
            break
    return RepeatedRows(tuple(rows))


def asked_seeds(first: int, text: str) -> tuple[int, ...]:
    """Return the seeds that a text selects: "3" for three seeds from `first` on, or "0,1,2" for these seeds.

    Raises BadInput for any other text, for no seeds, and for a repeated seed.
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


def seeds_from(first: int, count: int, name: str = "seeds") -> tuple[int, ...]:
    """Return `count` seeds from `first` on. Raises BadInput, whose message uses `name`, if `count` is below 1."""
    if count < 1:
        raise BadInput(where=name, found=count, expected="at least 1")
    return tuple(range(first, first + count))


def splits_from(first: int, count: int, held_out: float) -> tuple[int, ...]:
    """Return the seeds of `count` splits from `first` on.

    Raises BadInput if `count` is below 1, and for several splits if nothing is held out, since all splits would be
    equal.
    """
    if count > 1 and held_out == 0:
        raise BadInput(where="splits", found=f"{count} with nothing held out", expected="1, or a part to hold out")
    return seeds_from(first, count, "splits")


def _spreads(errors: Sequence[SixErrors]) -> dict[str, Spread]:
    return {name: Spread.of(getattr(error, name) for error in errors) for name in SIX}
