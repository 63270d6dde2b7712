"""One thing that is noted of a fit or of its samples: a true statement, and what it costs in the error bar.

A finding is about the *fit*, which other settings can improve; about the *data*, which need another measurement or
another import of the file; or about something *unknown*, since nobody measured it. No finding is an alarm by itself:
one score of all figures decides whether the verdict warns (`verdict.Alarm`).
"""

from dataclasses import dataclass
from enum import Enum
from typing import Any

from homofact.errors import Advice

NAMES = (
    "status", "condition", "light", "highlight", "narrow", "explained", "positivity", "energy", "step", "reciprocity",
    "artefact", "held-out", "scatter", "epsilon", "zeros", "gamut", "clipped", "outliers", "repeated", "ring", "tilt",
    "coverage", "sampling", "determined", "azimuth",
)  # fmt: skip
WORTH_SAYING = 1.1  # of a cost: less is not said


class About(Enum):
    """Whose fault a finding is. The value is the word in records."""

    FIT = "fit"
    DATA = "data"
    UNKNOWN = "unknown"

    @property
    def title(self) -> str:
        """The heading of such findings."""
        return {About.FIT: "Of the fit", About.DATA: "Of the data", About.UNKNOWN: "Not measured"}[self]


@dataclass(frozen=True)
class Finding:
    """Something noted.

    Attributes
    ----------
    name : of the check.
    about : whose fault it is.
    found : what was found, with what is expected.
    remedy : what to do, in one line.
    advice : the setting to try, None where no setting helps.
    feature : the feature of the error bars (`bar.features`) that it shows in; "" where none does.
    cost : by what factor the widest of the bars is wider for it than in a usual case; None where that is not known.
    """

    name: str
    about: About
    found: str
    remedy: str
    advice: Advice | None = None
    feature: str = ""
    cost: float | None = None

    def line(self) -> str:
        """Return the finding in one line."""
        return f"{self.found}: {self.remedy}"

    @property
    def costs(self) -> str:
        """What it costs, in words; "" where that is next to nothing."""
        if self.cost is None or self.cost < WORTH_SAYING:
            return ""
        return f"the limits of the verdict include this: they are up to {self.cost:.2g} times wider than usual"

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {
            "name": self.name,
            "about": self.about.value,
            "cost": self.cost,
            "found": self.found,
            "remedy": self.remedy,
            "advice": None if self.advice is None else self.advice.record(),
        }


def ordered(findings: list[Finding]) -> tuple[Finding, ...]:
    """Return the findings on the fit, then on the data, then on what is unknown; of one kind by what they cost."""
    return tuple(sorted(findings, key=lambda finding: (tuple(About).index(finding.about), -(finding.cost or 0.0))))
