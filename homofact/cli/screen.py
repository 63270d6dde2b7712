"""What a command shows: tables and one JSON object on stdout, notes and the progress bar on stderr.

With --json stdout carries exactly one JSON object and nothing else. With -q there are no notes and no bar,
and a command whose product is a file prints nothing. The bar runs on a terminal only.
"""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.segment import Segment

from homofact.errors import Report, Status
from homofact.files.plain import plain
from homofact.files.words import harmless

if TYPE_CHECKING:
    from homofact.evaluate.estimate import TimeEstimate

WORTH_SAYING = 5.0  # seconds that a command may take without saying so


class FitProgress(Protocol):
    """What a fit says of itself on the way: `homofact.methods.fitting.Progress`."""

    @property
    def term(self) -> int:
        """The term in work, from 1."""
        ...

    @property
    def terms(self) -> int:
        """How many there will be."""
        ...

    @property
    def restart(self) -> int:
        """The random start in work, from 1."""
        ...

    @property
    def restarts(self) -> int:
        """How many there will be for a term."""
        ...

    @property
    def evaluations(self) -> int:
        """Inner problems solved so far."""
        ...

    @property
    def best(self) -> float:
        """The smallest error so far, of the search's own objective."""
        ...


class _Console(Console):
    """Rich's console, as names from elsewhere need it, and which lets a broken pipe through to the entry point.

    All that is printed is `harmless`, and nothing in it is taken for markup or the name of an emoji.
    """

    def __init__(self, *, stderr: bool = False) -> None:
        """On stdout, or on stderr."""
        super().__init__(stderr=stderr, highlight=False, markup=False, emoji=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """The segments of what is printed; only rich's own control what the terminal does."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(harmless(segment.text, keep="\n"), segment.style)

    def on_broken_pipe(self) -> None:
        """The reader has gone."""
        raise BrokenPipeError


class Bar:
    """The progress bar: `stage` names what is being done, a call with a `FitProgress` moves it."""

    def __init__(self, progress: Progress | None = None, task: TaskID | None = None) -> None:
        """A silent bar, unless it is given one of rich's to move."""
        self._progress, self._task, self._stage = progress, task, ""
        self._done, self._runs = 0, 1

    def stage(self, name: str) -> None:
        """A new stage of unknown length: the bar pulses until a fit reports."""
        self._stage, self._done, self._runs = name, 0, 1
        self._update(name, "", None, 0)

    def run(self, name: str, done: int, runs: int) -> None:
        """One fit of several, of which `done` are behind it: the bar is over all of them."""
        self._stage, self._done, self._runs = f"{done + 1}/{runs} {name}", done, runs
        self._update(self._stage, "", float(runs), done)

    def __call__(self, at: FitProgress) -> None:
        """Show a fit's term, restart, evaluations and best error."""
        done = at.term - 1 + (at.restart - 1) / max(at.restarts, 1)
        best = f"best {at.best:.4g}" if math.isfinite(at.best) else ""
        what = f"{self._stage}: term {at.term}/{at.terms}, restart {at.restart}/{at.restarts}"
        figures = f"{at.evaluations} evaluations {best}"
        if self._runs == 1:
            self._update(what, figures, float(at.terms), done)
        else:
            self._update(what, figures, float(self._runs), self._done + done / max(at.terms, 1))

    def _update(self, what: str, figures: str, total: float | None, completed: float) -> None:
        if self._progress is not None and self._task is not None:
            self._progress.update(self._task, description=what, figures=figures, total=total, completed=completed)


class Screen:
    """The two streams of one command, bound when it starts."""

    def __init__(self, as_json: bool, quiet: bool) -> None:
        """Take stdout and stderr as they are now."""
        self.as_json, self.quiet = as_json, quiet
        self._out = _Console()
        self._err = _Console(stderr=True)

    @property
    def on_terminal(self) -> bool:
        """Whether a person reads the notes as they come; a pipe is not told what passes."""
        return self._err.is_terminal

    def note(self, text: str) -> None:
        """A line on stderr, unless quiet; never wrapped."""
        if not self.quiet:
            self._err.print(text, soft_wrap=True)

    def show(self, *parts: RenderableType) -> None:
        """Tables and lines on stdout, unless --json is; lines are never wrapped."""
        if self.as_json:
            return
        for part in parts:
            self._out.print(part, soft_wrap=isinstance(part, str))

    def answer(self, record: dict[str, Any]) -> None:
        """With --json, the one object on stdout; a number that is not finite becomes null."""
        if self.as_json:
            wide = self._out.encoding.startswith("utf")
            text = json.dumps(plain(record), ensure_ascii=not wide, allow_nan=False, indent=2)
            self._out.print(text, soft_wrap=True)

    @contextmanager
    def bar(self) -> Iterator[Bar]:
        """A bar on stderr while the block runs; a silent one in a pipe or with -q."""
        if self.quiet or not self._err.is_terminal:
            yield Bar()
            return
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
        )
        # transient: a finished bar says nothing that the table does not.
        with Progress(*columns, console=self._err, transient=True, expand=True) as progress:
            yield Bar(progress, progress.add_task("", total=None, figures=""))


def say_estimate(screen: Screen, estimate: "TimeEstimate") -> None:
    """How many fits there are to do and for how long, where that is long enough to be worth knowing."""
    if estimate.seconds_left >= WORTH_SAYING:
        screen.note(f"homofact: {estimate.words()}")


def say_ending(screen: Screen, report: Report, label: str = "") -> None:
    """What the user should know of how a fit ended: its notes, and the remedy where it was cut short or fell back."""
    about = f"{label}: " if label else ""
    if report.status in (Status.INTERRUPTED, Status.FALLBACK):
        screen.note(f"homofact: {about}{report.status.remedy}")
    for note in report.notes:
        screen.note(f"homofact: {about}{note}")


def say_subset(screen: Screen, record: dict[str, Any]) -> None:
    """How many of the training samples a fit was given, where it was not all."""
    drawn = record["subset"]
    if drawn is not None:
        screen.note(f"homofact: fitted to {drawn['samples']} of {drawn['of']} samples, from {drawn['cells']} cells")
