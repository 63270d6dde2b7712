"""The atlas: all methods on all stressors at all strengths, as cells and as a CSV."""

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

from homofact.evaluation.estimate import TimeEstimate, fit_seconds
from homofact.files.atomic import write_text
from homofact.files.tables import csv_text
from homofact.methods.table import METHODS, method_class, settings_of_class
from homofact.stability.cells import Cell, CellErrors, CellOutcome, Fitter, References, fit_row, run_cell
from homofact.stability.problem import Scale, Stressor, unstressed
from homofact.stability.real import MissingMeasurement
from homofact.stability.stressors import STRESSORS, stressor

# Small fits, so that hundreds of them take minutes. ε is that of measured data. A method takes what it has of these.
BASE_SETTINGS: dict[str, Any] = {
    "textures": 2, "size": 8, "epsilon": 1e-2, "restarts": 1, "effort": 10.0, "search_size": 5, "search_samples": 250,
    "copies": 2,
}  # fmt: skip
SHORT_SETTINGS = BASE_SETTINGS | {"effort": 1.0, "search_size": 4, "search_samples": 50}
FULL, SHORT = Scale(), Scale(samples=600, clean=400)


@dataclass(frozen=True)
class Plan:
    """The runs of an atlas. A `short` one has only each stressor's mildest and last strength and smaller problems."""

    methods: tuple[str, ...] = tuple(METHODS)
    stressors: tuple[str, ...] = tuple(STRESSORS)
    short: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse unknown names. Raises BadInput that lists the known ones."""
        for name in self.methods:
            method_class(name)
        for name in self.stressors:
            stressor(name)

    @property
    def scale(self) -> Scale:
        """How large the problems are."""
        return SHORT if self.short else FULL

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that all fits share, as far as their methods have them."""
        return (SHORT_SETTINGS if self.short else BASE_SETTINGS) | {"seed": self.seed}

    def strengths(self, of: Stressor) -> tuple[float, ...]:
        """Return the strengths of a stressor that are run."""
        return (of.strengths[0], of.strengths[-1]) if self.short and len(of.strengths) > 1 else of.strengths

    def places(self) -> list[tuple[Stressor, float, str]]:
        """Return (stressor, strength, method) of every cell, in the order of the atlas."""
        return [
            (stress, strength, name)
            for stress in map(stressor, self.stressors)
            for strength in self.strengths(stress)
            for name in self.methods
        ]


def estimate_atlas(plan: Plan) -> TimeEstimate:
    """Estimate the time of a plan's cells, without the unstressed fits and the linear solves, which are few."""
    samples = plan.scale.samples
    fits = {
        name: METHODS[name](
            **{key: plan.settings[key] for key in settings_of_class(METHODS[name]) if key in plan.settings}
        )
        for name in plan.methods
    }
    return TimeEstimate([(name, fit_seconds(fits[name], samples)) for _, _, name in plan.places()])


@dataclass(frozen=True)
class Atlas:
    """The cells of a plan, and every method's fit of the unstressed problem; `notes` list what was skipped."""

    plan: Plan
    cells: tuple[Cell, ...]
    unstressed: dict[str, CellErrors]
    notes: tuple[str, ...]

    def counts(self) -> dict[str, int]:
        """Return how many cells there are of every outcome."""
        counted = Counter(cell.outcome for cell in self.cells)
        return {outcome.value: counted[outcome] for outcome in CellOutcome}

    def of(self, stressor: str, method: str) -> list[Cell]:
        """Return the cells of a stressor and a method, mildest first."""
        return [cell for cell in self.cells if (cell.stressor, cell.method) == (stressor, method)]


def run_atlas(
    plan: Plan,
    started: Callable[[int, int, str], None] | None = None,
    fitter: Fitter = fit_row,
    ended: Callable[[Sequence[Cell]], object] = lambda cells: None,
) -> Atlas:
    """Run every cell; `started(done, all, name)` is called before each, `ended` with all cells so far after it.

    Only an interrupt ends it early.
    """
    places = plan.places()
    references = References(unstressed(plan.seed, plan.scale), plan.settings)
    cells: list[Cell] = []
    notes: dict[str, None] = {}
    for done, (stress, strength, name) in enumerate(places):
        label = stress.label(strength)
        if started is not None:
            started(done, len(places), f"{stress.title} ({label}): {name}")
        empty = Cell(name, stress.name, strength, label, CellOutcome.NONE)
        try:
            make = partial(stress.stress, strength, plan.seed, plan.scale)
            cells.append(run_cell(empty, make, references, fitter))
        except MissingMeasurement as error:
            notes[f"{stress.title}: {error}"] = None
            cells.append(Cell(name, stress.name, strength, label, CellOutcome.ABSENT, message=str(error)))
        ended(cells)
    return Atlas(plan, tuple(cells), {name: references.common(name, fitter) for name in plan.methods}, tuple(notes))


def write_csv(path: str | os.PathLike[str], cells: Sequence[Any]) -> None:
    """Write one line per cell (of one dataclass), floats with all digits; the file is replaced in one step."""
    names = [field.name for field in fields(cells[0])]
    write_text(path, csv_text([names, *([_plain(getattr(cell, name)) for name in names] for cell in cells)]))


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return "; ".join(value)
    if hasattr(value, "value"):
        return value.value
    return "" if value is None else value
