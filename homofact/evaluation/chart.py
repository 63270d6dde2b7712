"""Charts of error against cost: choose the fits and run all of them on the same splits of their source.

A plan combines methods × textures × sizes × searches × splits × seeds, as far as each method has these settings. Every
finished run is appended to a CSV file at once, so an interrupted chart resumes where it stopped. Runs without a row in
the CSV are fitted and measured as in a comparison.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace

from homofact.brdf.source import Source
from homofact.brdf.source_names import HELD_OUT
from homofact.errors import BadInput, HomofactError, Status
from homofact.evaluation.chart_ledger import ChartLedger, ChartRow, Identity, run_name, series_name
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.estimate import TimeEstimate, fit_seconds, training_count
from homofact.evaluation.machine import machine
from homofact.evaluation.metric_table import LIGHT
from homofact.evaluation.repeats import seeds_from
from homofact.evaluation.split import samples_digest
from homofact.methods.cole import Cole
from homofact.methods.cole_search import search_key
from homofact.methods.fitting import ProgressCallback
from homofact.methods.method import Method
from homofact.methods.nmf import Nmf
from homofact.version import __version__


@dataclass(frozen=True)
class Run:
    """One fit of a chart; `label` is the method as the user wrote it ("mccool:wi+h").

    `split_seed` is the seed of the held-out samples; the seed of the fit is in its settings.
    """

    label: str
    settings: Method
    split_seed: int = 0

    @property
    def series(self) -> str:
        """What it shares with its like in a chart: the method, and the search where the method takes one."""
        return series_name(self.label, self.search)

    @property
    def search(self) -> str:
        """The search's name, empty where the method takes none."""
        return self.settings.search

    @property
    def textures(self) -> int:
        """The requested number of textures."""
        return self.settings.most_textures

    @property
    def name(self) -> str:
        """The name of the run for messages, with both seeds if those of split and fit differ."""
        own = self.settings.seed
        seeds = "" if own == self.split_seed else f", split {self.split_seed}, seed {own}"
        return f"{run_name(self.series, self.textures, self.settings.size)}{seeds}"


def plan(
    methods: Mapping[str, Method],
    textures: Sequence[int],
    sizes: Sequence[int],
    searches: Sequence[str],
    seeds: int = 1,
    splits: Sequence[int] = (),
) -> tuple[Run, ...]:
    """Return all runs of a chart, smallest textures first; `methods` maps each label to its initial settings.

    Each fit is run with `seeds` consecutive seeds, starting at the seed of its settings, on the split of every seed in
    `splits`. If `splits` is empty, the seed of the settings determines the split. Settings that a method does not have
    are not varied: McCool's list of projections is run once per size, and nmf, which is deterministic, with one seed.
    Raises BadInput for an empty list, for fewer than one seed, and for settings that a method rejects.
    """
    for name, choices in (("methods", methods), ("textures", textures), ("sizes", sizes), ("searches", searches)):
        if not choices:
            raise BadInput(where=name, found="none", expected="at least one")
    runs: dict[Run, None] = {}
    for label, base in methods.items():
        varied = {"size": sizes, "textures": textures, "search": searches}
        own = {name: values for name, values in varied.items() if name in base.__dataclass_fields__}
        own["seed"] = seeds_from(base.seed, 1 if isinstance(base, Nmf) else seeds)
        for values in itertools.product(*own.values()):
            settings = replace(base, **dict(zip(own, values, strict=True)))
            runs |= dict.fromkeys(Run(label, settings, split) for split in splits or (base.seed,))
    return tuple(runs)


def identity(source: Source, digest: str, run: Run, held_out: float, where: str) -> Identity:
    """Return the identity of `run` on a source whose samples have this digest, on the machine `where`."""
    settings = run.settings
    if settings.epsilon is None:
        settings = replace(settings, epsilon=source.default_epsilon)
    used = {"method": settings.name} | {field.name: getattr(settings, field.name) for field in fields(settings)}
    words = [f"{name}={'+'.join(value) if isinstance(value, tuple) else value}" for name, value in used.items()]
    words += [f"held_out={held_out}", f"split_seed={run.split_seed}"]
    return Identity(digest, " ".join(words), where, __version__)


def finished(run: Run, row: ComparisonRow, held_out: float, wanted: Identity) -> ChartRow:
    """Return the line of a run that ended with `row`."""
    return ChartRow(
        source=row.source,
        label=run.label,
        search=run.search,
        textures_asked=run.textures,
        size=run.settings.size,
        textures=len(row.factorization.textures),
        bytes=row.factorization.nbytes,
        fetches=row.factorization.fetches,
        evaluations=row.report.evaluations,
        status=row.report.status.value,
        seconds_read=row.seconds_read,
        seconds_fit=row.seconds_fit,
        seconds_total=row.seconds_total,
        held_out=row.held_out,
        train=row.train,
        appearance=dict.fromkeys(LIGHT) if row.appearance is None else row.appearance.figures,
        epsilon=row.factorization.transform.epsilon,
        seed=row.settings.seed,
        split_seed=row.split.seed,
        samples=row.samples,
        channels=" ".join(row.factorization.channels),
        held_out_part=held_out,
        notes="; ".join(row.report.notes),
        **dataclasses.asdict(wanted),
    )


def found_rows(source: Source, runs: Sequence[Run], ledger: ChartLedger, held_out: float) -> list[ChartRow | None]:
    """Return the rows of `ledger` for `runs` on `source`, in their order; None for runs that are not fitted yet."""
    return [ledger.find(wanted) for wanted in _identities(source, runs, held_out)]


def estimate_charts(
    charts: Sequence[tuple[Source, ChartLedger]], runs: Sequence[Run], held_out: float = HELD_OUT
) -> TimeEstimate:
    """Return the time to run `runs` on all sources in turn; runs that a source's ledger contains count as done."""
    jobs, done = [], {}
    for source, ledger in charts:
        known: dict[str, int] = {}
        for run, row in zip(runs, found_rows(source, runs, ledger, held_out), strict=True):
            settings, before = run.settings, 0
            if row is not None:
                done[len(jobs)] = row.seconds_total - row.seconds_read
            elif isinstance(settings, Cole):
                key = search_key(settings)
                before, known[key] = known.get(key, 0), max(known.get(key, 0), run.textures)
            count = training_count(source, settings, held_out)
            jobs.append((settings.name, fit_seconds(settings, count, before)))
    estimate = TimeEstimate(jobs)
    for place, seconds in done.items():
        estimate.finish(place, seconds)
    return estimate


def _identities(source: Source, runs: Sequence[Run], held_out: float) -> list[Identity]:
    digest, where = samples_digest(source.samples), machine()
    return [identity(source, digest, run, held_out, where) for run in runs]


def run_chart(
    source: Source,
    runs: Sequence[Run],
    ledger: ChartLedger,
    held_out: float = HELD_OUT,
    started: Callable[[int, Run], None] | None = None,
    progress: ProgressCallback | None = None,
    ended: Callable[[int, ChartRow], None] | None = None,
) -> list[ChartRow]:
    """Return the rows of all `runs` on `source`, in their order; runs in `ledger` are not fitted again.

    `started` is called with the index of every run that is fitted, `ended` with its index and row. An interrupted fit
    gives no row, even if it has a partial result. KeyboardInterrupt is re-raised, and the ledger contains every
    finished run.
    """
    rows: list[ChartRow] = []
    warm: set[str] = set()
    for place, (run, wanted) in enumerate(zip(runs, _identities(source, runs, held_out), strict=True)):
        row = ledger.find(wanted)
        if row is None:
            if started is not None:
                started(place, run)
            if run.settings.name not in warm:
                _warm_up(source, run.settings)
                warm.add(run.settings.name)
            try:
                fitted = fit_and_measure(source, run.settings, held_out, progress, 0, run.split_seed)
            except BadInput as error:
                raise error.at(run.name) from error
            if fitted.report.status is Status.INTERRUPTED:
                raise KeyboardInterrupt
            row = finished(run, fitted, held_out, wanted)
            ledger.append(row)
            if ended is not None:
                ended(place, row)
        # One fit may be asked for under two names ("mccool" and "mccool:wi+h").
        rows.append(replace(row, label=run.label))
    return rows


def _warm_up(source: Source, settings: Method) -> None:
    """A throw-away fit of a few samples, so that no run's time holds what is paid once (compilation, first calls)."""
    least = {"size": 4, "search_size": 4, "search_samples": 0, "restarts": 1, "copies": 1, "budget": 0.05}
    own = {name: value for name, value in least.items() if name in settings.__dataclass_fields__}
    small = replace(settings, epsilon=0.01, **own)
    # What is wrong with the samples or the settings, the fit itself will say.
    with suppress(HomofactError):
        fitted = small.fit(source.samples.subset(64, settings.seed))
        if fitted.report.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
