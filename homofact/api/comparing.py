"""Comparing: fit several methods to the same split of one or more sources, and measure them alike."""

import itertools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.compared import CompareResult, SourceComparison
from homofact.api.places import check_file
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.refusing import Refusal
from homofact.api.subjects import Place, check_held_out, given_source, open_given, subset_of
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput, Status
from homofact.files import extras
from homofact.methods.table import made_each
from homofact.sections import COMPARED, SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.evaluation.compare import ComparisonRow
    from homofact.evaluation.estimate import TimeEstimate
    from homofact.evaluation.repeats import RepeatedRows
    from homofact.methods.method import Method


def compare(
    source: Any,
    methods: "Sequence[str | Method] | Mapping[str, Method]" = COMPARED,
    *,
    held_out: float = HELD_OUT,
    seeds: int | Sequence[int] | str = 1,
    splits: int = 1,
    seed: int = 0,
    metrics: Sequence[str] = ("six",),
    plot: Place | None = None,
    csv: Place | None = None,
    latex: Place | None = None,
    by_source: bool = False,
    strict: bool | float = False,
    refuse: Sequence[str] = (),
    progress: Progress | None = None,
    **settings: Any,
) -> CompareResult:
    """Fit several methods to the same samples and measure them on the same held-out ones.

    Parameters
    ----------
    source : source, path, or list of these
        The source to fit, as for `fit`. For several sources, the result also has means and standard deviations.
    methods : sequence of str or Method, or dict, optional
        Methods by name ("mccool:theta_h-theta_d+wi" has fixed projections, "ggx:2" two lobes,
        "svd:half-diff" other coordinates), as objects, or as
        objects by label.
    held_out : float, optional
        The part of the samples that is held out of the fits.
    seeds : int, sequence of int or str, optional
        Number of seeds to fit with, starting at `seed`, or the seeds themselves. As text: "3" or "0,1,2".
    splits : int, optional
        Number of splits into training and held-out samples, drawn with successive seeds starting at `seed`. With
        several splits, the result also counts, for each pair of methods, the splits on which one is better.
    seed : int, optional
        Seed of the split, of a model's samples, and of the methods that you give by name.
    metrics : sequence of str, optional
        "six", "all", or names of metrics.
    plot, csv, latex : path, optional
        Files to write: a figure of the errors (.png, .pdf, .svg; one source only), and the means (.csv, .tex).
    by_source : bool, optional
        Whether the LaTeX table also has rows for each source. Needs `latex`.
    strict : bool or float, optional
        Raise an error if the verdict warns; a number is the largest accepted probability of a bad fit.
    refuse : sequence of str, optional
        Refuse a fit with any of these findings.
    progress : callable, optional
        Called with a `ProgressStep` on the way.
    **settings
        Settings of the methods that you give by name. Each method gets only the settings that it has.

    Returns
    -------
    CompareResult
        The fits and their errors by source and label. After Ctrl-C, the result contains the fits made so far.

    Raises
    ------
    BadInput
        For sources, methods, settings or metrics that cannot be used, and for a fit that is refused.

    Examples
    --------
    >>> found = homofact.compare("material:phong-30", [homofact.McCool(size=8), homofact.Svd(size=8)])
    >>> list(found.rows), found.rows["mccool"].held_out["log_mse"].mean < 1
    (['mccool', 'svd'], True)
    """
    refusal = Refusal.of(strict, refuse)
    check_held_out(held_out)
    several = isinstance(source, list | tuple) and not _is_samples(source)
    sources = [given_source(one) for one in (source if several else [source])]
    files = _files(plot, csv, latex, len(sources))
    if by_source and latex is None:
        raise BadInput(where="by_source", found="no LaTeX table", expected="a file for one (latex)")
    fits = named_methods(methods, settings | {"seed": seed})

    from homofact.brdf.source import with_tilt_looked_at
    from homofact.evaluation.judging import chosen_metrics
    from homofact.evaluation.repeats import asked_seeds, seeds_from, splits_from

    names = chosen_metrics(metrics)
    if isinstance(seeds, str):
        listed = asked_seeds(seed, seeds)
    else:
        listed = seeds_from(seed, seeds) if isinstance(seeds, int) else tuple(seeds)
    drawn = splits_from(seed, splits, held_out)
    work = _Comparison(fits, listed, drawn, held_out, names, refusal, ProgressSteps(progress))
    work.steps.stage("reading")
    opened = [with_tilt_looked_at(open_given(one, seed)) for one in sources]
    work.steps.warm_up()
    done, interrupted = work.run(opened, [subset_of(one) for one in sources])
    several = several and len(sources) > 1
    result = CompareResult(tuple(done), len(opened) * len(fits), several, interrupted, files, by_source)
    _write(result, work.steps)
    return result


def named_methods(
    methods: "Sequence[str | Method] | Mapping[str, Method]", settings: Mapping[str, Any]
) -> "dict[str, Method]":
    """Return the methods by label.

    Raises BadInput for an empty list, a method that occurs twice, and settings that no method has.
    """
    if isinstance(methods, Mapping):
        return dict(methods)
    listed = [methods] if isinstance(methods, str) or not isinstance(methods, Sequence) else list(methods)
    if not listed:
        raise BadInput(where="methods", found="none", expected="at least one")
    by_name = [method for method in listed if isinstance(method, str)]
    made = made_each(by_name, settings) if by_name else {}
    if not by_name and settings.keys() - {"seed"}:
        raise BadInput(where=next(iter(settings)), found="it beside methods as objects", expected="it in these")
    found: dict[str, Method] = {}
    for method in listed:
        if isinstance(method, type) or not (isinstance(method, str) or hasattr(method, "fit")):
            words = f"the class {method.__name__}" if isinstance(method, type) else repr(method)
            raise BadInput(
                where="methods", found=words, expected="a name, or an object such as homofact.McCool(size=16)"
            )
        label = method if isinstance(method, str) else method.name
        if label in found:
            raise BadInput(where="methods", found=f"{label} twice", expected="labels in a dict: {label: method}")
        found[label] = made[method] if isinstance(method, str) else method
    return found


@dataclass(frozen=True)
class _Comparison:
    """A comparison in progress: its methods, seeds, splits and metrics, and which fits to reject."""

    fits: "dict[str, Method]"
    seeds: tuple[int, ...]
    splits: tuple[int, ...]
    held_out: float
    metrics: tuple[str, ...]
    refusal: Refusal
    steps: ProgressSteps

    def run(self, sources: "Sequence[Source]", subsets: Sequence[int]) -> tuple[list[SourceComparison], bool]:
        """Return the fits of every source, and whether Ctrl-C ended the run; raise if no fit was finished."""
        estimate = self._estimate(sources, subsets)
        self.steps.estimate(estimate)
        done: list[SourceComparison] = []
        for source, subset in zip(sources, subsets, strict=True):
            rows: dict[str, RepeatedRows] = {}
            interrupted = self._fit(source, subset, rows, estimate, bool(done), len(sources))
            if rows:
                done.append(self._measured(source, rows))
            if interrupted:
                return done, True
        return done, False

    def _estimate(self, sources: "Sequence[Source]", subsets: Sequence[int]) -> "TimeEstimate":
        from homofact.evaluation.estimate import TimeEstimate, fit_seconds, training_count

        jobs = []
        for source, subset in zip(sources, subsets, strict=True):
            for fit in self.fits.values():
                seconds = fit_seconds(fit, training_count(source, fit, self.held_out, subset))
                jobs += [(fit.name, seconds)] * len(self.seeds) * len(self.splits)
        return TimeEstimate(jobs)

    def _fit(
        self,
        source: "Source",
        subset: int,
        rows: "dict[str, RepeatedRows]",
        estimate: "TimeEstimate",
        some: bool,
        count: int,
    ) -> bool:
        """Add the fits of every method to `rows`; return whether Ctrl-C ended them, or raise if no fit is done."""
        from homofact.evaluation.repeats import RepeatedRows, fit_repeats

        runs = count * len(self.fits) * len(self.seeds) * len(self.splits)
        for label, fit in self.fits.items():
            of = f"{source.name}, {label}" if count > 1 else label
            made: list[ComparisonRow] = []
            for split, seed in itertools.product(self.splits, self.seeds):
                estimate.begin()
                self.steps.run(of, estimate.done, runs, estimate.time_left())
                try:
                    made += fit_repeats(source, fit, (seed,), self.held_out, self.steps, subset, (split,)).rows
                except KeyboardInterrupt:
                    if not rows and not some:
                        raise
                    return True
                estimate.end()
                rows[label] = RepeatedRows(tuple(made))
                self.refusal.check(made[-1].verdict, label)
                # The fit may have kept its best: a row, but the last one.
                if made[-1].report.status is Status.INTERRUPTED:
                    return True
        return False

    def _measured(self, source: "Source", rows: "dict[str, RepeatedRows]") -> SourceComparison:
        from homofact.evaluation.judging import FitEvaluator

        self.steps.stage("measuring")
        judge = FitEvaluator(source, self.metrics)
        values = {
            label: [judge.measure(row.factorization, row.split) for row in several.rows]
            for label, several in rows.items()
        }
        return SourceComparison(source, rows, values, judge.conditions())


def _files(plot: Place | None, csv: Place | None, latex: Place | None, sources: int) -> dict[str, Path]:
    """Return the files to write, by kind. Raises BadInput if a file cannot be written."""
    if plot is not None and sources > 1:
        raise BadInput(
            where="plot", found=f"{sources} sources", expected="one for a figure; draw each in a run of its own"
        )
    asked = (("plot", plot, (".png", ".pdf", ".svg")), ("csv", csv, (".csv",)), ("latex", latex, (".tex",)))
    places = {}
    for name, given, endings in asked:
        if given is not None:
            check_file(Path(given), *endings)
            places[name] = Path(given)
    if plot is not None:
        extras.check("plot", "matplotlib")
    return places


def _write(result: CompareResult, steps: ProgressSteps) -> None:
    """Write the requested files."""
    from homofact.evaluation.latex_means import latex_of
    from homofact.evaluation.means import csv_of
    from homofact.files.atomic import write_text

    for name, place in result.files.items():
        steps.stage("drawing" if name == "plot" else "writing")
        place.parent.mkdir(parents=True, exist_ok=True)
        if name == "plot":
            from homofact.figures.plot import plot_rows

            plot_rows(place, result.rows)
        else:
            fits = result.measured()
            text = csv_of(fits) if name == "csv" else latex_of(fits, result.by_source, result.pairs_in_words)
            write_text(place, text)


def _is_samples(source: Any) -> bool:
    """Return whether a tuple contains (wi, wo, values, …) of one source, and not several sources."""
    return (
        isinstance(source, tuple)
        and len(source) >= 3
        and not any(isinstance(part, str | os.PathLike | SourceSettings) or hasattr(part, "samples") for part in source)
    )
