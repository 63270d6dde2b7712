"""One check: a possible fault, how it is measured in the samples, and how to undo it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from homofact.brdf.quality.suspicion.calibration import log_odds
from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.undo import UNDO
from homofact.errors import Advice

Figures = tuple[float, ...]


@dataclass(frozen=True)
class Suspicion:
    """A suspected fault of samples: its `odds` to 1 against samples without it, a description, and a remedy."""

    name: str
    odds: float
    words: str
    remedy: str

    def line(self) -> str:
        """Return one line: "the values hold cosθo: odds 200 to 1; `convert(undo='cosine-o')`"."""
        return f"{self.words}: odds {_figure(self.odds)} to 1; {self.remedy}"

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return asdict(self)


@dataclass(frozen=True)
class Check:
    """A fault that samples may have.

    `figures` measure it (None if these samples cannot decide), and `calibration.log_odds` makes odds of them.
    `words(figures)` describe the finding. Default: the words of `undo`. `undo` is a name of `undo.UNDO`, or empty if
    the fault cannot be undone; `remedy` then gives advice.
    """

    name: str
    figures: Callable[[Evidence], Figures | None]
    words: Callable[[Figures], str] | None = None
    undo: str = ""
    remedy: str = ""

    def suspicion(self, evidence: Evidence) -> Suspicion | None:
        """Return the suspicion with its odds, however small; None if the samples cannot decide."""
        figures = self.figures(evidence)
        return None if figures is None or not all(np.isfinite(figures)) else self.of_figures(figures)

    def of_figures(self, figures: Figures) -> Suspicion:
        """Return the suspicion of these figures with its odds, however small."""
        remedy = str(Advice("undo", self.undo, of="convert")) if self.undo else self.remedy
        words = UNDO[self.undo].words if self.words is None else self.words(figures)
        return Suspicion(self.name, float(np.exp(log_odds(self.name, figures))), words, remedy)


def _figure(odds: float) -> str:
    """The odds with two digits and no exponent: 23, 150, 12,000, over 100,000."""
    if odds > 1e5:
        return "over 100,000"
    step = 10 ** max(int(np.floor(np.log10(max(odds, 1)))) - 1, 0)
    return f"{round(odds / step) * step:,}"
