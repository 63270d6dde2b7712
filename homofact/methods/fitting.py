"""What a fit reports while it runs, and its result."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from homofact.errors import Report
from homofact.factor.fitted import Fitted


@dataclass(frozen=True)
class FitProgress:
    """The progress of a running fit; terms and restarts count from 1, and `best` is the term's lowest error so far."""

    term: int
    terms: int
    restart: int
    restarts: int
    evaluations: int
    best: float


ProgressCallback = Callable[[FitProgress], None]


@dataclass(frozen=True)
class MethodFit:
    """The result of a method: the factorization and its report, from which a `homofact.Fit` is made."""

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
