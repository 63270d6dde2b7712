"""Run one task: open and fit the source, measure the errors, and write the result, whole or not at all."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from homofact.brdf.channels import display_of
from homofact.brdf.source import Source, with_tilt_looked_at
from homofact.errors import BadInput, SolverFailure
from homofact.evaluation.compare import fit_and_measure
from homofact.exporting.manifest import write_json
from homofact.exporting.result import REPORT
from homofact.figures.compare_picture import FitPanel, compare_picture
from homofact.files.folder import write_folder
from homofact.files.kinds import FACTORIZATION, RESULT
from homofact.files.plain import plain
from homofact.sections import SourceSettings
from homofact.sweeps.ledger import SweepLedger, sealed
from homofact.sweeps.task import Task, source_digest
from homofact.version import __version__

PICTURE = "compare.png"


def do(task: Task, folder: Path, words: str | None = None) -> dict[str, Any]:
    """Run a task and write its result; return the "seconds" that this took, or the reason why it was "refused".

    `words` is the path of the source on this machine, if it differs. An existing result stays. Raises OSError if the
    folder cannot be written, for example because the disk is full.
    """
    began = time.monotonic()
    ledger = SweepLedger(folder)
    if ledger.is_done(task):
        return {"seconds": 0.0}
    try:
        if task.version != __version__:
            raise BadInput(where="task", found=f"one of homofact {task.version}", expected=__version__)
        source = _opened(
            words or task.source, task.source, task.digest, task.source_settings(), int(task.settings["seed"])
        )
        method = task.fit_method()
        row = fit_and_measure(source, method, task.held_out, subset=task.source_settings().subset)
    except (BadInput, SolverFailure) as error:
        return {"refused": " ".join(str(error).split())}
    report = plain(row.record())

    def fill(place: Path) -> None:
        row.factorization.save(place / FACTORIZATION)
        write_json(place / REPORT, sealed(report | {"task": task.record()}, place / FACTORIZATION))
        panels = [FitPanel(task.label, row.factorization, (), None if row.verdict is None else row.verdict.bars)]
        shown = display_of(source.samples.channels)
        compare_picture(place / PICTURE, (source.name, source.reflectance), panels, to_rgb=shown)

    put(ledger, task, fill)
    return {"seconds": time.monotonic() - began}


def put(ledger: SweepLedger, task: Task, fill: Callable[[Path], None]) -> None:
    """Let `fill` write a task's result, whole or not at all; an existing result stays.

    Raises OSError if the result cannot be written. The folder is then at fault, so the task is not set aside.
    """
    try:
        write_folder(ledger.place(task), RESULT, fill)
    except BadInput as error:
        # Another worker may have been at the same task: one whose client had died.
        if ledger.is_done(task):
            return
        if isinstance(error.__cause__, OSError):
            raise error.__cause__ from error
        raise


@lru_cache(maxsize=1)
def _opened(words: str, known_as: str, digest: str, settings: SourceSettings, seed: int) -> Source:
    """A source, kept for the next task, which most often has the same. Raises BadInput where it was changed."""
    if source_digest(words) != digest:
        raise BadInput("was changed since the sweep began", where=words, expected="it as it was")
    source = with_tilt_looked_at(settings.opening(seed, words).open())
    # A result says where its owner has the source, not where a worker was sent it.
    opening = None if source.opening is None else replace(source.opening, path=known_as)
    return replace(source, opening=opening)
