"""What a fit reports while it runs, and its result."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from homofact.errors import Report
from homofact.factor.fitted import Fitted


@dataclass(frozen=True)
class FitProgress:
    """Where a running fit is: counted from 1, `best` the lowest error of this term so far."""

    term: int
    terms: int
    restart: int
    restarts: int
    evaluations: int
    best: float


ProgressCallback = Callable[[FitProgress], None]


@dataclass(frozen=True)
class MethodFit:
    """What a method returns: what it fitted, and the report of how it was reached; `homofact.Fit` is made of it."""

    factorization: Fitted
    report: Report

    def __repr__(self) -> str:
        """In a line: what was fitted and how the search ended."""
        return f"<MethodFit of {self.factorization}, {self.report.status.value}>"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels."""
        return self.factorization.channels

    @property
    def nbytes(self) -> int:
        """Bytes of all texels as float32."""
        return self.factorization.nbytes

    @property
    def fetches(self) -> int:
        """Texture lookups of one evaluation."""
        return self.factorization.fetches

    def evaluate(self, wi: Any, wo: Any) -> Any:
        """Return BRDF values (N, C) in sr⁻¹ without the cosine."""
        return self.factorization.evaluate(wi, wo)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the one .npz file. Raises BadInput for an unwritable place."""
        self.factorization.save(path)
