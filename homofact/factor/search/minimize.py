"""Minimise an objective by any search: count evaluations, enforce the time limit, return the result.

A search (`gradient`, `nlopt`, `powell` …) only proposes vectors and receives their values. `minimize` handles the rest:
the best vector so far, the trace of improvements, the time limit, Ctrl-C and the status.
"""

import time
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from homofact.errors import BadInput, Report, Status
from homofact.factor.objective import JointObjective, Objective


class DeadlineReached(Exception):
    """Raised inside an evaluation to leave a library's loop at the time limit; `minimize` catches it."""


@dataclass(frozen=True)
class SearchEnding:
    """How a search ended: whether it met its tolerance, and its number of iterations."""

    converged: bool
    iterations: int


class Minimizer(Protocol):
    """A minimisation method, as a frozen dataclass of its settings."""

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        ...

    @property
    def independent(self) -> bool:
        """Whether several searches may run in parallel with equal results."""
        ...

    def limited(self, steps: int) -> "Minimizer":
        """Return the same search with at most `steps` iterations, or evaluations if it counts these."""
        ...

    def descend(self, measured: "MeasuredObjective", start: Tensor, seed: int) -> SearchEnding:
        """Evaluate `measured` at vectors, starting from `start`, until the search ends."""
        ...


class MeasuredObjective:
    """An objective that records the best vector so far and the trace of improvements."""

    def __init__(self, objective: Objective | JointObjective, deadline: float) -> None:
        """Wrap an objective; `deadline` is on the clock of time.perf_counter."""
        self.objective = objective
        self._deadline = deadline
        self._began = time.perf_counter()
        self.vector: Tensor | None = None
        self.best = float("inf")
        self.evaluations = 0
        self.trace: list[tuple[float, int, float]] = []

    def value(self, vector: Tensor) -> float:
        """Return R at a vector (V,). Raises DeadlineReached once the time is up."""
        return self._noted(self.objective.error(vector), vector)

    def slope(self, vector: Tensor) -> tuple[float, Tensor]:
        """Return R and its gradient (V,). Raises DeadlineReached once the time is up."""
        evaluation = self.objective.evaluate(vector)
        return self._noted(evaluation.value, vector), evaluation.gradient

    def _noted(self, value: float, vector: Tensor) -> float:
        self.evaluations += 1
        now = time.perf_counter()
        if value < self.best:
            self.best, self.vector = value, vector.clone()
            self.trace.append((now - self._began, self.evaluations, value))
        if now > self._deadline:
            raise DeadlineReached
        return value


def minimize(
    search: Minimizer,
    objective: Objective | JointObjective,
    start: Tensor,
    *,
    seconds: float = float("inf"),
    seed: int = 0,
) -> tuple[Tensor, Report]:
    """Return the best vector (V,) that `search` found, and a report whose residual is the R of this vector.

    `seconds` is a time limit. A search that reaches it has the status GUARD; at least one evaluation is always made.
    Ctrl-C ends the search with the status INTERRUPTED and the best vector so far, or is re-raised if there is none.
    """
    if not seconds > 0:
        raise BadInput(where="budget", found=f"{seconds} seconds", expected="more than 0")
    began = time.perf_counter()
    measured = MeasuredObjective(objective, began + seconds)
    iterations = 0
    try:
        ending = search.descend(measured, start.to(torch.float64), seed)
        status = Status.CONVERGED if ending.converged else Status.BUDGET
        iterations = ending.iterations
    except DeadlineReached:
        status = Status.GUARD
    except KeyboardInterrupt:
        if measured.vector is None:
            raise
        status = Status.INTERRUPTED
    if measured.vector is None:
        raise BadInput("no evaluation gave a finite value", where="search", expected="finite samples")
    elapsed = time.perf_counter() - began
    trace = tuple(measured.trace)
    return measured.vector, Report(status, iterations, measured.evaluations, elapsed, measured.best, seed, trace)
