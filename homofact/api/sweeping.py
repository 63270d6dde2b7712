"""Sweeping: fit every source by every method on all processors and save the results, or fit all sources together."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from homofact.api.places import check_place
from homofact.api.progress import Progress, ProgressSteps
from homofact.api.subjects import Place
from homofact.errors import Advice, BadInput, Interrupted
from homofact.files.folder import check_new_folder
from homofact.files.kinds import SITE
from homofact.files.lock import claimed

if TYPE_CHECKING:
    from homofact.sweeps.ledger import Aside
    from homofact.sweeps.local import TaskEnding
    from homofact.sweeps.run import State
    from homofact.sweeps.summary import FitRow
    from homofact.sweeps.sweep_file import AskedSweep


# The report's place in the folder of a sweep.
_SITE = "report"


@dataclass(frozen=True)
class SweepResult:
    """What a sweep has done.

    Attributes
    ----------
    folder : Path
        The folder of the results, in which the same call resumes the sweep.
    name : str
        The sweep's name.
    rows : list of FitRow
        The figures of every result.
    aside : list of Aside
        The fits that were set aside permanently, with the reasons.
    tasks, done_before, done : int
        The number of all fits, of the fits done before this call, and of the fits done by this call.
    site : Path or None
        The report's folder, where one was written.
    """

    folder: Path
    name: str
    rows: "list[FitRow]" = field(repr=False)
    aside: "list[Aside]" = field(repr=False)
    tasks: int
    done_before: int
    done: int
    site: Path | None = None

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        from homofact.sweeps.summary import summary_records

        return {
            "folder": str(self.folder),
            "name": self.name,
            "tasks": self.tasks,
            "done_before": self.done_before,
            "done": self.done,
            "set_aside": [
                {**aside.task.record(), "reason": aside.reason, "deaths": aside.deaths} for aside in self.aside
            ],
            "error": summary_records(self.rows),
            "site": None if self.site is None else str(self.site),
        }


@dataclass(frozen=True)
class TogetherResult:
    """Sources fitted together: a spatially varying material, or a common basis.

    Attributes
    ----------
    folder : Path
        The output folder.
    kind : str
        "svbrdf" or "basis".
    facts : dict
        Errors and bytes, as in the folder's .json file.
    """

    folder: Path
    kind: str
    facts: dict[str, Any]

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {"folder": str(self.folder)} | self.facts


def sweep(
    asked: "Place | AskedSweep",
    to: Place,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    svbrdf: bool = False,
    basis: int | None = None,
    site: bool = False,
    progress: Progress | None = None,
) -> SweepResult | TogetherResult:
    """Fit many sources by several methods, and keep every result.

    Finished fits are not repeated: after Ctrl-C or a crash, the same call resumes the sweep. The sweep sets aside a
    source that cannot be read or whose worker process dies twice, and reports it.

    Parameters
    ----------
    asked : path or AskedSweep
        A TOML file with sources, methods, bytes and seeds.
    to : path
        The folder of the results.
    workers : int, optional
        Processes on this machine. Default: one for each processor.
    scheduler : str, optional
        Use Dask workers instead: "local", "tcp://HOST:8786", a scheduler's .json file, or MODULE:CLASS of a cluster.
    retry : bool, optional
        Retry the fits that were set aside.
    svbrdf : bool, optional
        Treat the sources as the clusters of one spatially varying material, with the section [svbrdf] of the file.
    basis : int, optional
        Fit a common basis with this number of textures to all sources.
    site : bool, optional
        Also write the report to the subfolder report, like `homofact.report` with `viewers=False`.
    progress : callable, optional
        Called with a `ProgressStep` on the way.

    Returns
    -------
    SweepResult or TogetherResult
        The figures of every result; with `svbrdf` or `basis`, those of the common fit.

    Raises
    ------
    BadInput
        For a file or sources that cannot be read, options that exclude each other, and a folder that contains another
        sweep.

    Examples
    --------
    >>> lines = ['sources = ["material:phong-10"]', '[source]', 'count = 500', '[[method]]', 'method = "mccool"']
    >>> _ = Path("sweep.toml").write_text("\\n".join([*lines, "size = 4"]))
    >>> found = homofact.sweep("sweep.toml", "swept", workers=1)
    >>> found.done, [row.name for row in found.rows]
    (1, ['phong-10'])
    """
    if workers is not None and workers < 1:
        raise BadInput(where="workers", found=workers, expected="1 or more")
    folder = Path(to)
    steps = ProgressSteps(progress)
    if svbrdf or basis is not None:
        beside = {"workers": workers is not None, "scheduler": scheduler is not None, "retry": retry}
        beside["basis"] = svbrdf and basis is not None
        for name in (name for name, given in beside.items() if given):
            what = "svbrdf" if svbrdf else "basis"
            raise BadInput(f"found it beside {what}, which is one fit, in this process", where=name)
        if basis is not None:
            return _basis(_read(asked), basis, folder, steps)
        return _svbrdf(_read(asked), folder, steps)
    check_place(folder)
    if site:
        check_new_folder(folder / _SITE, SITE, True)

    from homofact.sweeps.cluster import DaskCluster
    from homofact.sweeps.local import Local
    from homofact.sweeps.progress import SweepProgress
    from homofact.sweeps.run import sweep as run_sweep
    from homofact.sweeps.summary import rows_of

    wanted = _read(asked)
    if wanted.svbrdf is not None:
        raise BadInput(
            where=_words(asked), found="a section [svbrdf]", expected=f"{Advice('svbrdf', True)} beside it, or none"
        )
    count = workers or _processors()
    engine = Local(folder, count) if scheduler is None else DaskCluster(folder, scheduler, count, steps.note)
    counted = SweepProgress(count)
    steps.stage("reading the sources")

    def told(state: "State", ending: "TaskEnding | None") -> None:
        if ending is None:
            steps.note(counted.begin(state))
        else:
            counted.end(state, ending)
            if ending.seconds is None:
                steps.note(f"{ending.task.words}: {counted.misfortune(state, ending)}")
        if state.left:
            steps.run(counted.words(), len(state.tasks) - state.left, len(state.tasks), counted.time_left)

    try:
        state = run_sweep(wanted, folder, engine, told, retry)
    except KeyboardInterrupt as error:
        kept = f"{counted.done} of {counted.total} results are kept in {folder}: the same command goes on there"
        raise Interrupted(kept) if counted.total else error from error
    aside = [task for task in state.aside.values() if task.final]
    rows = rows_of(folder)
    made = _site(folder, steps) if site and rows else None
    return SweepResult(folder, wanted.name, rows, aside, len(state.tasks), state.before, state.done, made)


def _site(folder: Path, steps: ProgressSteps) -> Path:
    """Write the report of a sweep into its folder, and replace an older one."""
    from homofact.sweeps.report.site import write_site

    steps.stage("writing the report")
    target = folder / _SITE
    write_site(folder, target, viewers=False, force=True, notify=steps.run)
    return target


def _read(asked: "Place | AskedSweep") -> "AskedSweep":
    from homofact.sweeps.sweep_file import AskedSweep, read_sweep

    if isinstance(asked, AskedSweep):
        return asked
    if not isinstance(asked, str | os.PathLike):
        raise BadInput(where="sweep", found=type(asked).__name__, expected="a TOML file")
    return read_sweep(Path(asked))


def _words(asked: "Place | AskedSweep") -> str:
    return os.fspath(asked) if isinstance(asked, str | os.PathLike) else asked.name


def _svbrdf(asked: "AskedSweep", folder: Path, steps: ProgressSteps) -> TogetherResult:
    """Fit the clusters of one material, compare with separate fits, and write texture arrays and shaders."""
    from homofact.sweeps.svbrdf import check_place as check_new
    from homofact.sweeps.svbrdf import fit_clusters, read_asked, write_clusters

    check_new(folder)
    with claimed(folder):
        opened = read_asked(asked, lambda words: steps.stage(f"reading {words}"))
        fit = fit_clusters(opened, steps, steps.run)
        steps.stage("fitting lobes to draw from, and writing")
        return TogetherResult(folder, "svbrdf", dict(write_clusters(folder, fit)))


def _basis(asked: "AskedSweep", count: int, folder: Path, steps: ProgressSteps) -> TogetherResult:
    """Fit a common basis of `count` log textures."""
    from homofact.sweeps.basis_folder import check_place as check_new
    from homofact.sweeps.basis_folder import fit_asked, write_basis

    if count < 1:
        raise BadInput(where="basis", found=count, expected="1 or more")
    if asked.svbrdf is not None:
        raise BadInput(where=asked.name, found="a section [svbrdf]", expected="none beside basis")
    check_new(folder)
    with claimed(folder):
        fit = fit_asked(asked, count, steps, lambda words: steps.stage(f"reading {words}"), steps.run)
        steps.stage("writing")
        return TogetherResult(folder, "basis", dict(write_basis(folder, fit)))


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
