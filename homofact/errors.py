"""Errors of the package, and the report that ends every fit and search.

`BadInput` is an error that the user can fix; it ends a command with exit code 2. `Status` describes how a computation
ended and what to do about it; `Report` contains the status and the cost.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Self


class HomofactError(Exception):
    """Base of every error that homofact raises on purpose."""


class BadInput(HomofactError, ValueError):
    """A file, argument or setting that cannot be used, with its place, what was found, what is expected, and a hint.

    Attributes
    ----------
    where
        The file, argument or setting, with the place in it: "scene.toml: camera[0].eye", "size".
    found
        The value, or a clause on what is wrong with it: "0", "no such file".
    expected
        What would be accepted.
    hint
        What to try. A setting in it is an `Advice`, so that the command line can show its option.

    Each is "" if it is not known. The message combines them: "size: found 0, expected a whole number of at least 1
    (nearest: 1)".
    """

    def __init__(
        self,
        problem: object = "",
        *,
        where: object = "",
        found: object = None,
        expected: object = "",
        hint: object = "",
    ) -> None:
        """Take `found` for a value and `problem` for a clause, before which the message does not say "found"."""
        self.where, self.expected, self.hint = str(where), str(expected), str(hint)
        self.found = str(problem) if found is None else str(found)
        self._is_value = found is not None
        super().__init__(self._message())

    def at(self, place: object, joint: str = ": ") -> Self:
        """Return this error with another place in front of its own."""
        return self.moved_to(f"{place}{joint}{self.where}" if self.where else str(place))

    def moved_to(self, where: object) -> Self:
        """Return this error with another place."""
        return self._with(where=str(where))

    def with_hint(self, hint: object) -> Self:
        """Return this error with one hint more."""
        return self._with(hint=f"{self.hint}; {hint}" if self.hint else str(hint))

    def _with(self, **attributes: str) -> Self:
        # Not by copy(): libraries that pickle tracebacks register a way of their own, which shares the attributes.
        changed = type(self).__new__(type(self))
        vars(changed).update(vars(self) | attributes)
        changed.args = (changed._message(),)
        return changed

    def _message(self) -> str:
        where = f"{self.where}: " if self.where else ""
        expected = f", expected {self.expected}" if self.expected else ""
        hint = f" ({self.hint})" if self.hint else ""
        return f"{where}{'found ' if self._is_value else ''}{self.found}{expected}{hint}"


class MissingDependency(BadInput):
    """An optional library is not installed; the message names the extra that installs it."""


class SolverFailure(HomofactError):
    """A linear system could not be solved, or its solution is not finite."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a computation that keeps its finished parts: `kept` lists them, and the same call resumes there."""

    def __init__(self, kept: str) -> None:
        super().__init__(kept)
        self.kept = kept


@dataclass(frozen=True)
class Advice:
    """A setting and the value to try for it; `of` names its function if it is not a setting of the fit.

    In a message it appears as a Python argument in backticks: "`robust=True`", "`convert(undo='cosine-o')`". The
    command line shows its option instead (`cli.flags`).
    """

    setting: str
    value: bool | float | str
    of: str = ""

    def __str__(self) -> str:
        """The words for a message."""
        given = f"{self.setting}={self.value!r}"
        return f"`{self.of}({given})`" if self.of else f"`{given}`"

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {"setting": self.setting, "value": self.value}

    @classmethod
    def of_record(cls, record: Any) -> "Advice | None":
        """Return the advice of a record; None for None. Raises KeyError or TypeError for an invalid record."""
        return None if record is None else cls(record["setting"], record["value"])


class Status(Enum):
    """How a fit, search or solve ended. The value is the word in reports; `remedy` says what to do."""

    CONVERGED = "converged"
    BUDGET = "budget"
    GUARD = "guard"
    INTERRUPTED = "interrupted"
    DIRECT = "direct"
    FALLBACK = "fallback"

    @property
    def remedy(self) -> str:
        """One line for the user: what to change if this result is not good enough."""
        return _REMEDIES[self]


_REMEDIES = {
    Status.CONVERGED: "nothing: the search stopped by its own tolerance",
    Status.BUDGET: "the effort was used up: give it more for a better fit",
    Status.GUARD: "the clock ended the search: another run may end elsewhere; give it a larger budget, or none",
    Status.INTERRUPTED: "the search was interrupted: the best so far was kept; run again for the whole search",
    Status.DIRECT: "nothing: the projections are fixed, one linear solve",
    Status.FALLBACK: "the system was singular to working precision: more smoothing, fewer textures or more samples",
}


@dataclass(frozen=True)
class Report:
    """The record of one fit, search or solve.

    `seconds` is the wall time. `residual` is the final value of the objective, whose meaning depends on the method.
    `trace` is a series of triples (seconds, evaluations, best value so far).
    """

    status: Status
    iterations: int
    evaluations: int
    seconds: float
    residual: float
    seed: int
    trace: tuple[tuple[float, int, float], ...] = ()
    notes: tuple[str, ...] = ()
    details: dict[str, Any] = field(default_factory=dict)
