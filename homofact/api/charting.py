"""Charting: error against cost over methods, textures, sizes and searches."""

import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.comparing import named_methods
from homofact.api.places import check_place
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place, check_held_out, given_source, open_given
from homofact.brdf.source_names import HELD_OUT, MATERIAL_PREFIX
from homofact.errors import Advice, BadInput, Interrupted
from homofact.files.extras import check as check_library
from homofact.files.lock import claimed
from homofact.methods.table import methods_with, parsed_label
from homofact.sections import CHARTED, COMPARED, SourceSettings

if TYPE_CHECKING:
    from homofact.brdf.source import Source
    from homofact.evaluation.chart import Run
    from homofact.evaluation.chart_ledger import ChartLedger, ChartRow
    from homofact.evaluation.chart_points import ChartPoint
    from homofact.evaluation.estimate import TimeEstimate
    from homofact.methods.method import Method


@dataclass(frozen=True)
class SourceChart:
    """The chart of one source.

    Attributes
    ----------
    source : str
        Its name.
    rows : list of ChartRow
        Every run, in their order.
    files : list of Path
        The CSV with all runs, and the pictures.
    others : int
        Number of runs with other settings in the CSV.
    """

    source: str
    rows: "list[ChartRow]"
    files: list[Path]
    others: int

    def points(self) -> "list[ChartPoint]":
        """Return one point for each group of runs that differ only in their seed or split."""
        from homofact.evaluation.chart_points import points_of

        return points_of(self.rows)

    def reference(self) -> float | None:
        """Return the lowest mean error of McCool's own projections, or None if the chart has no such run."""
        from homofact.evaluation.chart_points import reference

        found = reference(self.points())
        return None if found is None else found.error.mean


@dataclass(frozen=True)
class ChartResult:
    """The charts of all sources.

    Attributes
    ----------
    charts : tuple of SourceChart
        One for each source.
    """

    charts: tuple[SourceChart, ...] = field(repr=False)

    @property
    def files(self) -> list[Path]:
        """All files."""
        return [file for chart in self.charts for file in chart.files]

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        rows = [row.record() for chart in self.charts for row in chart.rows]
        return {"rows": rows, "files": [str(file) for file in self.files]}


def chart(
    source: Any,
    to: Place,
    methods: "Sequence[str | Method] | Mapping[str, Method]" = COMPARED,
    *,
    textures: Sequence[int] = CHARTED["textures"],
    sizes: Sequence[int] = CHARTED["size"],
    searches: Sequence[str] = CHARTED["search"],
    seeds: int = 1,
    splits: int = 1,
    held_out: float = HELD_OUT,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> ChartResult:
    """Run methods × textures × sizes × searches, and draw error against cost.

    Runs that are already in the folder are not fitted again. After an interruption, repeat the call to continue.

    Parameters
    ----------
    source : source, path, or list of these
        What is fitted, as for `fit`.
    to : path
        The output folder. Each source gets NAME.csv, and the figures NAME_time and NAME_cost as PNG and SVG.
    methods : sequence of str or Method, or dict, optional
        As for `compare`.
    textures : sequence of int, optional
        Numbers of textures to try.
    sizes : sequence of int, optional
        Texels per side.
    searches : sequence of str, optional
        How `search` refines: "gradient", "powell", "nlopt-NAME".
    seeds : int, optional
        Number of seeds to fit with, starting at `seed`.
    splits : int, optional
        Number of splits into training and held-out samples, drawn with successive seeds starting at `seed`.
    held_out : float, optional
        The part of the samples that is held out of the fits.
    seed : int, optional
        Seed of the split, of a model's samples, and of the methods that you give by name.
    force : bool, optional
        Fit all runs anew.
    progress : callable, optional
        Called with a `ProgressStep` on the way.
    **settings
        Settings of the methods that you give by name. Each method gets only the settings that it has.

    Returns
    -------
    ChartResult
        Every run by source, and the files.

    Raises
    ------
    BadInput
        For sources, methods or settings that cannot be used, and a folder that cannot be written.
    Interrupted
        If you press Ctrl-C. The folder contains the finished runs.

    Examples
    --------
    >>> found = homofact.chart("material:phong-30", "charts", ["mccool"], sizes=[4, 8])
    >>> [row.size for row in found.charts[0].rows]
    [4, 8]
    """
    check_held_out(held_out)
    several = isinstance(source, list)
    names = {name: given_source(one) for name, one in _names(source if several else [source]).items()}
    varied = {"textures": textures, "size": sizes, "search": searches}
    if not isinstance(methods, Mapping):
        methods = named_methods(methods, charted(methods, varied, settings) | {"seed": seed})

    from homofact.evaluation.chart import plan
    from homofact.evaluation.repeats import splits_from

    runs = plan(methods, textures, sizes, searches, seeds, splits_from(seed, splits, held_out))
    # A library that is missing is known before anything is fitted.
    check_library("charts", "matplotlib")
    folder = Path(to)
    check_place(folder)
    return _Charting(names, runs, folder, held_out, seed, force, ProgressSteps(progress)).run()


def charted(
    labels: "Sequence[str | Method]", varied: Mapping[str, Sequence[Any]], settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the settings of a chart's first run: the first value of each varied setting that a method has."""
    names = {parsed_label(label)[0] for label in labels if isinstance(label, str)}
    first = {name: values[0] for name, values in varied.items() if not names.isdisjoint(methods_with(name))}
    return {name: value for name, value in settings.items() if name not in varied} | first


@dataclass(frozen=True)
class _Charting:
    """Charts in progress: the sources by the names of the chart files, the runs, and the output folder."""

    sources: dict[str, Any]
    runs: "tuple[Run, ...]"
    folder: Path
    held_out: float
    seed: int
    force: bool
    steps: ProgressSteps

    def run(self) -> ChartResult:
        """Return all charts. Raises Interrupted for Ctrl-C."""
        from homofact.evaluation.chart import estimate_charts
        from homofact.evaluation.chart_ledger import ChartLedger

        # How many runs, of all sources, are behind us.
        self_kept = [0]
        with ExitStack() as claims:
            ledgers = {}
            for name in self.sources:
                path = self.folder / f"{name}.csv"
                claims.enter_context(claimed(path))
                ledgers[name] = ChartLedger(path, self.force)
            try:
                self.steps.stage("reading")
                opened = {name: open_given(source, self.seed) for name, source in self.sources.items()}
                pairs = [(opened[name], ledgers[name]) for name in self.sources]
                estimate = estimate_charts(pairs, self.runs, self.held_out)
                self.steps.estimate(estimate)
                charts = [self._one(name, opened[name], ledgers[name], estimate, self_kept) for name in self.sources]
            except KeyboardInterrupt as error:
                total = len(self.runs) * len(self.sources)
                goes_on = f", without {Advice('force', True)}" if self.force else ""
                kept = f"{self_kept[0]} of {total} runs are kept in {self.folder}: the same command goes on there"
                raise Interrupted(kept + goes_on) from error
        return ChartResult(tuple(charts))

    def _one(
        self, name: str, source: "Source", ledger: "ChartLedger", estimate: "TimeEstimate", kept: list[int]
    ) -> SourceChart:
        from homofact.evaluation.chart import run_chart
        from homofact.figures.chart import write_charts

        before, total = kept[0], len(self.runs) * len(self.sources)

        def started(place: int, run: "Run") -> None:
            kept[0] = before + place
            estimate.begin(kept[0])
            self.steps.run(f"{source.name}: {run.name}", kept[0], total, estimate.time_left())

        def ended(place: int, row: "ChartRow") -> None:
            # The row's own seconds also count a search that an earlier fit did.
            estimate.end()

        rows = run_chart(source, self.runs, ledger, self.held_out, started, self.steps, ended)
        kept[0] = before + len(self.runs)
        files = [ledger.path, *write_charts(self.folder, name, rows)]
        return SourceChart(source.name, rows, files, max(len(ledger) - len(rows), 0))


def _names(sources: Sequence[Any]) -> dict[str, Any]:
    """Return the sources by the name of their files. Raises BadInput for no source or equal names."""
    if not sources:
        raise BadInput(where="source", found="none", expected="at least one")
    names: dict[str, Any] = {}
    for source in sources:
        text = source.path if isinstance(source, SourceSettings) else getattr(source, "name", source)
        text = text if isinstance(text, str) else "samples"
        stem = text.removeprefix(MATERIAL_PREFIX) if text.startswith(MATERIAL_PREFIX) else Path(text).stem
        name = re.sub(r"[^\w.+-]", "_", stem) or "_"
        if name in names:
            raise BadInput(
                where="SOURCE", found=f"two named {name}", expected="names that differ: their files would be the same"
            )
        names[name] = source
    return names
