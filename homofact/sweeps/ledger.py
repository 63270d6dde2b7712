"""A sweep's folder: the requested tasks, the finished results, and the failed tasks.

    sweep.json              the name, and the tasks as last requested
    results/KEY/            a result, written whole or not at all; report.json names its task
    aside/KEY.json          a fit that homofact rejected, or whose worker died: the reason and the count

The results are the ledger: a task is done if and only if its folder exists. The digest of a folder reveals later
changes.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from homofact.errors import BadInput
from homofact.exporting.manifest import write_json
from homofact.exporting.result import REPORT
from homofact.files.fields import Fields
from homofact.files.kinds import FACTORIZATION
from homofact.files.reading import read_bytes
from homofact.sweeps.task import Task, task_of
from homofact.version import __version__

SWEEP, RESULTS, ASIDE = "sweep.json", "results", "aside"
FORMAT, FORMAT_VERSION = "homofact sweep", 1
MOST_DEATHS = 2
_EXPECTED = "it as homofact wrote it"
_AGAIN = "delete the folder to have it fitted again"


@dataclass(frozen=True)
class Aside:
    """A failed task: the reason, and how many workers died of it; if `final`, it is not retried."""

    task: Task
    reason: str
    deaths: int
    final: bool


@dataclass(frozen=True)
class Result:
    """A finished task: its folder, and its report, as `evaluation.compare.ComparisonRow.record` returns it."""

    task: Task
    folder: Path
    report: dict[str, Any]


class SweepLedger:
    """The folder of a sweep."""

    def __init__(self, folder: Path) -> None:
        """Nothing is read yet."""
        self.folder = folder

    def begin(self, name: str, tasks: Iterable[Task]) -> None:
        """Record the requested tasks. Results of other tasks of the same sweep stay.

        Raises BadInput if the folder contains something else, another sweep, or a sweep of a newer format.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise BadInput(where=self.folder, found="a file", expected="a folder for the sweep")
        if (self.folder / SWEEP).exists():
            there = self._header().text("name")
            if there != name:
                raise BadInput(where=self.folder, found=f"the sweep {there!r}", expected=f"a new folder for {name!r}")
        elif self.folder.exists() and any(path.name[:1] != "." for path in self.folder.iterdir()):
            wanted = "a sweep's folder or an empty one"
            raise BadInput(where=self.folder, found=f"files and no {SWEEP}", expected=wanted)
        self.folder.mkdir(parents=True, exist_ok=True)
        record = {"format": FORMAT, "format_version": FORMAT_VERSION, "version": __version__, "name": name}
        write_json(self.folder / SWEEP, record | {"tasks": [task.record() for task in tasks]})

    @property
    def name(self) -> str:
        """The sweep's name. Raises BadInput if the folder is not a sweep's."""
        return self._header().text("name")

    def asked(self) -> list[Task]:
        """Return the tasks of the last request. Raises BadInput if the folder is not a sweep's, or was changed."""
        fields = self._header()
        records = fields.found.get("tasks")
        if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
            raise BadInput(where=self.folder / SWEEP, found="no tasks", expected=_EXPECTED, hint=_AGAIN)
        try:
            return [task_of(record) for record in records]
        except BadInput as error:
            raise error.at(self.folder / SWEEP) from error

    def place(self, task: Task) -> Path:
        """Return the folder of a task's result, whether or not it exists yet."""
        return self.folder / RESULTS / task.key

    def is_done(self, task: Task) -> bool:
        """Return whether a task's result exists."""
        return (self.place(task) / FACTORIZATION).is_file()

    def result(self, task: Task) -> Result:
        """Return a task's result. Raises BadInput if it was changed, or belongs to another task."""
        place = self.place(task)
        fields = Fields.read(place / REPORT, "a sweep's result")
        try:
            recorded = task_of(fields.inner("task").found)
            digest = fields.text("sha256")
        except BadInput as error:
            raise error.at(place / REPORT).with_hint(_AGAIN) from error
        if recorded.key != task.key:
            raise BadInput(where=place / REPORT, found=f"the task {recorded.key}", expected=_EXPECTED, hint=_AGAIN)
        if digest != result_digest(fields.found, place / FACTORIZATION):
            what = "its fit or its figures were changed since they were written"
            raise BadInput(what, where=place, expected=_EXPECTED, hint=_AGAIN)
        return Result(task, place, fields.found)

    def results(self) -> Iterator[Result]:
        """Yield the results of the tasks of the last request, in their order. Raises BadInput as `result`."""
        for task in self.asked():
            if self.is_done(task):
                yield self.result(task)

    def aside(self) -> dict[str, Aside]:
        """Return, by key, the tasks set aside or whose worker died once. Raises BadInput for a changed file."""
        aside = {}
        for file in sorted((self.folder / ASIDE).glob("*.json")):
            fields = Fields.read(file, "what a sweep set aside")
            try:
                task = task_of(fields.inner("task").found)
            except BadInput as error:
                raise error.at(file).with_hint("or delete the file") from error
            deaths = fields.whole("deaths", 0, 10**6)
            aside[task.key] = Aside(task, fields.text("reason"), deaths, fields.flag("final"))
        return aside

    def set_aside(self, task: Task, reason: str, deaths: int = 0) -> Aside:
        """Record that a task was rejected (0 deaths) or that `deaths` workers died of it."""
        entry = Aside(task, reason, deaths, deaths == 0 or deaths >= MOST_DEATHS)
        place = self.folder / ASIDE
        place.mkdir(exist_ok=True)
        record = {"task": task.record(), "reason": reason, "deaths": deaths, "final": entry.final}
        write_json(place / f"{task.key}.json", record)
        return entry

    def forgive(self, keys: Iterable[str]) -> None:
        """Delete the records of tasks that were set aside."""
        for key in keys:
            (self.folder / ASIDE / f"{key}.json").unlink(missing_ok=True)

    def _header(self) -> Fields:
        file = self.folder / SWEEP
        if not file.is_file():
            raise BadInput(where=self.folder, found=f"no {SWEEP} in it", expected="the folder of a sweep")
        fields = Fields.read(file, "a sweep")
        fields.text("format", (FORMAT,))
        fields.version("format_version", FORMAT_VERSION)
        return fields


def result_digest(report: Mapping[str, Any], fit: Path) -> str:
    """Return the SHA-256 of a report without its "sha256" and of a fit's file. Raises BadInput for unreadable files."""
    text = json.dumps({name: value for name, value in report.items() if name != "sha256"}, sort_keys=True)
    return hashlib.sha256(text.encode() + read_bytes(fit, "a saved fit")).hexdigest()


def sealed(report: Mapping[str, Any], fit: Path) -> dict[str, Any]:
    """Return the report with its "sha256", as `SweepLedger.result` reads it."""
    return {**report, "sha256": result_digest(report, fit)}
