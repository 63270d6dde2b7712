"""A finding: one observation on a fit or its samples, and the factor by which it widens the error bars.

A finding is about one of three subjects. A finding about the fit can be solved with other settings. A finding about the
data needs another measurement or another import of the file. A finding about something unknown means that measurements
are missing. A finding alone triggers no warning: a score computed from all figures decides whether the verdict warns
(`verdict.Alarm`).
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
    """The subject of a finding. The value is the string in JSON records."""

    FIT = "fit"
    DATA = "data"
    UNKNOWN = "unknown"

    @property
    def title(self) -> str:
        """The heading above findings about this subject."""
        return {About.FIT: "Of the fit", About.DATA: "Of the data", About.UNKNOWN: "Not measured"}[self]


@dataclass(frozen=True)
class Finding:
    """One result of a check in the verdict.

    Attributes
    ----------
    name : name of the check.
    about : the subject: the fit, the data, or missing measurements.
    found : text that states the result and the expected value.
    remedy : what to do, in one line.
    advice : the setting to try; None if no setting helps.
    feature : the feature of the error bars (`bar.features`) that this finding affects; "" for none.
    cost : the factor by which the finding widens the most affected error bar, compared with a typical case; None if
        unknown.
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
        """Text that states by what factor the finding widens the error bars; "" if the factor is negligible."""
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

    @classmethod
    def of_record(cls, record: Any) -> "Finding | None":
        """Return the finding of a JSON record; None if the record is invalid."""
        try:
            words = (str(record["name"]), About(record["about"]), str(record["found"]), str(record["remedy"]))
            cost = None if record["cost"] is None else float(record["cost"])
            return cls(*words, Advice.of_record(record["advice"]), cost=cost)
        except (KeyError, TypeError, ValueError):
            return None


def ordered(findings: list[Finding]) -> tuple[Finding, ...]:
    """Return the findings on the fit, then the data, then missing measurements, each sorted by falling cost."""
    return tuple(sorted(findings, key=lambda finding: (tuple(About).index(finding.about), -(finding.cost or 0.0))))
