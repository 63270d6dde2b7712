"""What a comparison found: the fits of every method to every source, with their metrics and means."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.evaluation.means import MeanRow, MeasuredFit
    from homofact.evaluation.paired import MethodPair
    from homofact.evaluation.repeats import RepeatedRows


@dataclass(frozen=True)
class SourceComparison:
    """The methods' fits to one source, each with its metrics.

    Attributes
    ----------
    source : Source
        What was fitted.
    rows : dict of RepeatedRows
        The fits of each method by label, one for every split and seed.
    values : dict
        The chosen metrics of each fit by label, on the held-out samples.
    conditions : list of str
        The conditions under which the metrics were measured, in sentences.
    """

    source: "Source"
    rows: "dict[str, RepeatedRows]"
    values: dict[str, list[dict[str, float | None]]]
    conditions: list[str]

    def records(self) -> dict[str, dict[str, Any]]:
        """Return the JSON form of each method's fits, by label."""
        means = self.metrics()
        return {label: rows.record() | {"metrics": means[label]} for label, rows in self.rows.items()}

    def metrics(self) -> dict[str, Mapping[str, float | None]]:
        """Return the means of the chosen metrics over the fits, by label; None where a fit has none."""
        return {label: _means(values) for label, values in self.values.items()}

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "source": self.source.name,
            "rows": [{"label": label, **record} for label, record in self.records().items()],
            "metric_conditions": self.conditions,
            **({"split_by_split": [pair.record() for pair in pairs]} if (pairs := self.split_by_split()) else {}),
        }

    def split_by_split(self) -> "list[MethodPair]":
        """Compare each pair of methods over the splits, lower mean Cole error first; empty for one split."""
        from homofact.evaluation.paired import split_by_split

        return split_by_split(self.rows)

    def measured(self) -> "list[MeasuredFit]":
        """Return every fit with its numbers."""
        from homofact.brdf.pair_density import scheme_of
        from homofact.evaluation.means import MeasuredFit, settings_in_words
        from homofact.evaluation.wording import listed_seeds
        from homofact.methods.table import bytes_to_fill

        found = []
        for label, seeds in self.rows.items():
            for row, values in zip(seeds.rows, self.values[label], strict=True):
                fit, held_out = row.factorization, round(row.split.held_out * row.samples)
                scheme = scheme_of(self.source.samples)
                done = "; ".join(_repairs(self.source.samples.provenance))
                drawn = "as measured" if scheme is None else f"drawn by the scheme {scheme}"
                sampling = f"{drawn}, split by {listed_seeds(seeds.splits)}{f'; {done}' if done else ''}"
                found.append(
                    MeasuredFit(
                        self.source.name, label, row.settings.seed, fit.nbytes, fit.fetches, values,
                        fit.transform.epsilon, row.samples, held_out, row.verdict.figures.light.reciprocity,
                        settings_in_words(row.settings), bytes_to_fill(row.settings), sampling, row.split.seed,
                    )
                )  # fmt: skip
        return found


@dataclass(frozen=True)
class CompareResult:
    """What a comparison found.

    Attributes
    ----------
    sources : tuple of SourceComparison
        The fits to each source.
    fits : int
        The planned number of pairs of a source and a method.
    several : bool
        Whether the call had a list of sources.
    interrupted : bool
        Whether Ctrl-C ended the comparison before all fits were done.
    files : dict of Path
        The files that were written: "plot", "csv", "latex".
    by_source : bool
        Whether the LaTeX table also has rows for each source.
    """

    sources: tuple[SourceComparison, ...] = field(repr=False)
    fits: int
    several: bool
    interrupted: bool
    files: dict[str, Path]
    by_source: bool = False

    @property
    def rows(self) -> "dict[str, RepeatedRows]":
        """The fits to the first source, by label."""
        return self.sources[0].rows

    @property
    def fits_done(self) -> int:
        """The number of pairs of a source and a method in the comparison."""
        return sum(len(source.rows) for source in self.sources)

    @property
    def with_means(self) -> bool:
        """Whether the JSON form has the means over sources, seeds and splits."""
        return self.several or not self.files.keys().isdisjoint(("csv", "latex"))

    def measured(self) -> "list[MeasuredFit]":
        """Return every fit with its numbers."""
        return [fit for source in self.sources for fit in source.measured()]

    def means(self) -> "list[MeanRow]":
        """Return means and standard deviations over sources, seeds and splits, by method and bytes."""
        from homofact.evaluation.means import mean_rows

        return mean_rows(self.measured())

    @property
    def pairs_in_words(self) -> list[str]:
        """One line for each pair of methods, which compares them over the splits; empty for one split."""
        return [
            f"{source.source.name}: {pair.words}" if len(self.sources) > 1 else pair.words
            for source in self.sources
            for pair in source.split_by_split()
        ]

    @property
    def warnings(self) -> list[str]:
        """Warnings: an uncorrected tilt, errors with different ε, or seeds that gave identical fits."""
        from homofact.evaluation.means import mixed_epsilons, same_fits, without_numbers

        tilts = {each.source.name: each.source.samples.provenance.get("tilt") or {} for each in self.sources}
        tilted = [f"{name}: {tilt['words']}" for name, tilt in tilts.items() if tilt.get("left_in")]
        measured = self.measured()
        of_means = (mixed_epsilons(measured), without_numbers(measured)) if self.with_means else ()
        return [line for line in (*tilted, *of_means, same_fits(measured)) if line]

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        records = [source.record() for source in self.sources]
        answer: dict[str, Any] = {"sources": records} if self.several else records[0]
        if self.with_means:
            answer["means"] = [
                {
                    "method": row.method,
                    "bytes": row.nbytes,
                    "fetches": row.fetches,
                    "sources": row.sources,
                    "fits": row.fits,
                    "epsilon": row.epsilon,
                    "metrics": {
                        name: spread and spread.record() | {"within_source": row.within_source[name]}
                        for name, spread in row.spreads.items()
                    },
                }
                for row in self.means()
            ]
        return answer | {name: str(file) for name, file in self.files.items()}


def _repairs(provenance: Mapping[str, Any]) -> list[str]:
    """Return one line per repair of the samples; for a tilt, only whether it was corrected."""
    from homofact.brdf.quality.mending import mending_lines

    lines, tilt = mending_lines(dict(provenance)), provenance.get("tilt") or {}
    ending = "undone" if tilt.get("undone") else "left in" if tilt.get("left_in") else ""
    return [f"{tilt['found']}, {ending}" if ending and line == tilt["words"] else line for line in lines]


def _means(measured: list[dict[str, float | None]]) -> Mapping[str, float | None]:
    """Return the mean of every metric over the fits; None if a fit lacks it."""
    found = {name: [values[name] for values in measured] for name in measured[0]}
    return {
        name: None if None in numbers else sum(number or 0.0 for number in numbers) / len(numbers)
        for name, numbers in found.items()
    }
