"""Read a sweep's folder for a report: every fit with its figures and verdict, and the tasks without a fit.

Every figure is checked when it is read, because the folder may have been edited. The reports are not kept in memory,
because a sweep may have thousands of them.
"""

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from homofact.errors import BadInput
from homofact.evaluation.bar.error_bar import WORDS, BarKind
from homofact.evaluation.metric_table import REPORTED
from homofact.evaluation.wording import trust_in_words
from homofact.exporting.result import REPORT
from homofact.files.fields import Fields
from homofact.sweeps.ledger import SWEEP, Aside, Result, SweepLedger
from homofact.sweeps.summary import FitRow, row_of
from homofact.sweeps.task import Task
from homofact.version import __version__

_MOST = 2**53


@dataclass(frozen=True)
class ReportedFinding:
    """One finding of a verdict: what it is about, what was found, and the remedy."""

    name: str
    about: str
    found: str
    remedy: str


@dataclass(frozen=True)
class ReportedFit:
    """One result: its task, its figures, the verdict's sentence and findings, and the folder that it is in."""

    task: Task
    row: FitRow
    summary: str
    findings: tuple[ReportedFinding, ...]
    folder: Path

    @property
    def material(self) -> str:
        """The name of its page: the first 16 digits of the source's digest."""
        return self.task.digest[:16]

    @property
    def match(self) -> tuple[str, str, int]:
        """The key of the same fit in another sweep: the source's digest, label and seed."""
        return self.task.digest, self.row.label, self.row.seed


@dataclass(frozen=True)
class ReadSweep:
    """A sweep: `fits` in the requested order, tasks set `aside` after failures, and the number of open tasks."""

    name: str
    folder: Path
    fits: tuple[ReportedFit, ...]
    aside: tuple[Aside, ...]
    left: int

    @property
    def versions(self) -> tuple[str, ...]:
        """The versions of homofact that made its fits."""
        return tuple(sorted({fit.task.version for fit in self.fits}, key=_parts))

    def materials(self) -> dict[str, list[ReportedFit]]:
        """Return the fits of each source, by its page's name."""
        by_page: dict[str, list[ReportedFit]] = {}
        for fit in self.fits:
            by_page.setdefault(fit.material, []).append(fit)
        return by_page

    def names(self) -> dict[str, str]:
        """Return each material's name by its page's name; if two files have the same name, with their folders."""
        tasks = {page: fits[0].task for page, fits in self.materials().items()}
        names = {page: task.name for page, task in tasks.items()}
        folders = {page: f"{Path(task.source).parent.name}/{task.name}" for page, task in tasks.items()}
        for longer in (folders, {page: f"{task.name} {page[:8]}" for page, task in tasks.items()}):
            count = Counter(names.values())
            names = {page: name if count[name] == 1 else longer[page] for page, name in names.items()}
        return names


def read_results(folder: Path) -> ReadSweep:
    """Return the sweep in a folder.

    Raises BadInput if the folder is not a sweep's, contains no result, was edited, or contains fits of a newer
    homofact.
    """
    ledger = SweepLedger(folder)
    name, asked = ledger.name, ledger.asked()
    for task in asked:
        if _parts(task.version) > _parts(__version__):
            raise BadInput(
                where=folder / SWEEP,
                found=f"fits of homofact {task.version}",
                expected=f"at most {__version__}",
                hint="update homofact",
            )
    fits = tuple(map(_fit, ledger.results()))
    if not fits:
        raise BadInput(where=folder, found=f"no results of {len(asked)} fits", expected="a sweep with one or more")
    done = {fit.row.key for fit in fits}
    missing = {task.key for task in asked} - done
    aside = tuple(entry for key, entry in ledger.aside().items() if key in missing and entry.final)
    return ReadSweep(name, folder, fits, aside, len(missing) - len(aside))


def _fit(result: Result) -> ReportedFit:
    """Raises BadInput for a figure that is none."""
    fields = Fields(f"{result.folder / REPORT}: ", result.report)
    for name in ("bytes", "fetches", "textures"):
        fields.whole(name, 0, _MOST)
    fields.inner("seconds").number("fit", above=-1e-9)
    fields.text("status")
    errors = fields.inner("error").inner("held_out")
    seen = fields.inner("appearance") if fields.found.get("appearance") is not None else Fields(fields.place, {})
    for metric in REPORTED:
        for place in (errors, seen):
            if place.found.get(metric.name) is not None:
                place.number(metric.name)
    verdict = fields.inner("verdict")
    verdict.flag("trusted")
    if verdict.found.get("bars") is not None:
        for bar in verdict.inner("bars").inners("all", len(WORDS)):
            bar.text("quantity", tuple(WORDS))
            bar.text("kind", tuple(kind.value for kind in BarKind))
            # An error that the verdict does not state is null.
            if bar.found.get("error", 0) is not None:
                bar.number("error", above=-1e-9)
    records = verdict.inners("findings", _MOST) if verdict.found.get("findings") else []
    findings = tuple(
        ReportedFinding(*(record.text(name) for name in ("name", "about", "found", "remedy"))) for record in records
    )
    row = row_of(result)
    return ReportedFit(result.task, row, trust_in_words(row.trusted, verdict.text("summary")), findings, result.folder)


def _parts(version: str) -> tuple[int, ...]:
    return tuple(int(digits[:9]) for digits in re.findall(r"\d+", str(version)))
