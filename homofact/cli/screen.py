"""What a command shows: tables and one JSON object on stdout, notes and the progress bar on stderr.

With --json stdout carries exactly one JSON object and nothing else. With -q there are no notes and no bar,
and a command whose product is a file prints nothing. The bar runs on a terminal. Elsewhere, a long command
prints its progress in lines, except with --json or if HOMOFACT_PROGRESS is 0 in the environment.
"""

import copy
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.progress import Progress as ProgressBar
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from homofact.api.progress import Progress, ProgressStep, ProgressSteps
from homofact.cli.flags import with_options
from homofact.cli.interrupts import told
from homofact.cli.progress_lines import ProgressLines, StageClock
from homofact.errors import Report, Status
from homofact.files.plain import plain
from homofact.files.words import harmless

# Of the environment: "0" for no lines on a stderr that is no terminal.
PROGRESS = "HOMOFACT_PROGRESS"


class _Console(Console):
    """Rich's console, as names from elsewhere need it, and which lets a broken pipe through to the entry point.

    All that is printed is `harmless`, and nothing in it is taken for markup or the name of an emoji.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        """On stdout, or on stderr."""
        super().__init__(stderr=stderr, highlight=False, markup=False, emoji=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Yield the segments of what is printed; only rich's own control what the terminal does."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(harmless(segment.text, keep="\n"), segment.style)

    def on_broken_pipe(self) -> None:
        """The reader has gone."""
        raise BrokenPipeError


class _TimeLeft(ProgressColumn):
    """The time that is left by the clock of the stage."""

    def __init__(self, clock: StageClock) -> None:
        """Show the time by this clock."""
        super().__init__()
        self._clock = clock

    def render(self, task: Task) -> Text:
        """Return the remaining time as text; empty if it is unknown."""
        return Text(self._clock.left())


class Screen:
    """The two streams of one command, bound when it starts."""

    def __init__(self, as_json: bool, quiet: bool) -> None:
        """Take stdout and stderr as they are now."""
        self.as_json, self.quiet = as_json, quiet
        self._out = _Console()
        self._err = _Console(stderr=True)

    def note(self, text: str) -> None:
        """Print a line to stderr, unless quiet; the line is never wrapped."""
        if not self.quiet:
            self._err.print(with_options(text), soft_wrap=True)

    def show(self, *parts: RenderableType) -> None:
        """Print tables and lines to stdout, unless --json is given.

        Lines are never wrapped. A table's title wraps at the width of the terminal, where rich would wrap it at the
        width of the table.
        """
        if self.as_json:
            return
        for part in parts:
            if isinstance(part, str):
                self._out.print(with_options(part), soft_wrap=True)
            elif isinstance(part, Table) and part.title:
                untitled = copy.copy(part)
                untitled.title = None
                self._out.print(Text(str(part.title), "table.title"), untitled)
            else:
                self._out.print(part)

    def answer(self, record: dict[str, Any]) -> None:
        """With --json, print the record as one JSON object to stdout; non-finite numbers become null."""
        if self.as_json:
            wide = self._out.encoding.startswith("utf")
            text = json.dumps(plain(record), ensure_ascii=not wide, allow_nan=False, indent=2)
            self._out.print(text, soft_wrap=True)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Yield a callback that shows the steps of a call on stderr during the block: notes, and a bar or lines."""
        terminal = self._err.is_terminal
        if self.quiet or (not terminal and (self.as_json or os.environ.get(PROGRESS) == "0")):
            yield self._say
            return
        if not terminal:
            with ProgressLines(lambda line: self.note(f"homofact: {line}")).running() as take:

                def show_lines(step: ProgressStep) -> None:
                    self._say(step)
                    take(step)

                yield show_lines
            return
        clock = StageClock()
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            _TimeLeft(clock),
        )
        # transient: a finished bar says nothing that the table does not.
        with ProgressBar(*columns, console=self._err, transient=True, expand=True) as bar:
            task = bar.add_task("", total=None, figures="")

            def show(step: ProgressStep) -> None:
                self._say(step)
                if not step.note:
                    clock.take(step)
                    bar.update(
                        task, description=step.stage, figures=step.figures, total=step.total, completed=step.done
                    )

            yield show

    @contextmanager
    def bar(self) -> Iterator[ProgressSteps]:
        """Return the stages of a command, shown as `progress` shows them."""
        with self.progress() as show:
            yield ProgressSteps(show)

    def _say(self, step: ProgressStep) -> None:
        if step.note and (self._err.is_terminal or not step.passing):
            self.note(f"homofact: {step.note}")


def say_ending(screen: Screen, report: Report, label: str = "") -> None:
    """Print the notes of a fit, and the remedy if it was interrupted or used a fallback."""
    about = f"{label}: " if label else ""
    if report.status in (Status.INTERRUPTED, Status.FALLBACK):
        screen.note(f"homofact: {about}{report.status.remedy}")
        told()
    for note in report.notes:
        screen.note(f"homofact: {about}{note}")


def say_subset(screen: Screen, record: dict[str, Any]) -> None:
    """Print how many of the training samples the fit used, if not all."""
    drawn = record["subset"]
    if drawn is not None:
        screen.note(f"homofact: fitted to {drawn['samples']} of {drawn['of']} samples, from {drawn['cells']} cells")
