"""What a verdict is made of: one finding, what it is about, and how much of the light it concerns.

A finding is about the *fit*, which other settings can mend; about the *data*, which only another measurement or another
reading of the file can; or about what is *unknown*, since nobody measured it. Its size is the share of the reflected
light that is wrong or in doubt, so that findings of different checks can be compared, and graded by what a picture
shows of them.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Any

from homofact.errors import Advice

NAMES = (
    "status", "condition", "artefact", "light", "highlight", "narrow", "explained", "positivity", "energy", "step",
    "reciprocity", "scatter", "epsilon", "zeros", "gamut", "clipped", "outliers", "repeated", "ring", "coverage",
    "sampling", "determined", "azimuth",
)  # fmt: skip
VISIBLE, SEVERE = 0.1, 0.15  # of the light: from here on a picture shows it, or is another material's


class About(Enum):
    """Whose fault a finding is. The value is the word in records."""

    FIT = "fit"
    DATA = "data"
    UNKNOWN = "unknown"

    @property
    def title(self) -> str:
        """The heading of such findings."""
        return {About.FIT: "Wrong in the fit", About.DATA: "Odd in the data", About.UNKNOWN: "Not measured"}[self]


class Grade(Enum):
    """What a finding does to a picture. The value is the word in tables."""

    SLIGHT = "slight"
    VISIBLE = "visible"
    SEVERE = "severe"


_ORDER = tuple(Grade)


@dataclass(frozen=True)
class Finding:
    """Something off.

    Attributes
    ----------
    name : of the check.
    about : whose fault it is.
    light : the share of the reflected light that is wrong or in doubt; None where that cannot be told.
    found : what was found, with what is expected.
    remedy : what to do, in one line.
    advice : the setting to try, None where no setting helps.
    least : the grade where the light alone would make it a lesser one.
    """

    name: str
    about: About
    light: float | None
    found: str
    remedy: str
    advice: Advice | None = None
    least: Grade = Grade.SLIGHT

    @property
    def grade(self) -> Grade:
        """By the light that it concerns."""
        light = self.light or 0.0
        by_light = Grade.SEVERE if light >= SEVERE else Grade.VISIBLE if light >= VISIBLE else Grade.SLIGHT
        return max(by_light, self.least, key=_ORDER.index)

    @property
    def matters(self) -> bool:
        """Whether a picture shows it."""
        return self.grade is not Grade.SLIGHT

    def line(self) -> str:
        """The finding in one line."""
        return f"{self.found}: {self.remedy}"

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary."""
        return {
            "name": self.name,
            "about": self.about.value,
            "grade": self.grade.value,
            "light": self.light,
            "found": self.found,
            "remedy": self.remedy,
            "advice": None if self.advice is None else self.advice.record(),
        }


def ordered(findings: list[Finding]) -> tuple[Finding, ...]:
    """By what they do to the picture, the worst first; of one grade the fit's before the data's, then by light."""
    return tuple(
        sorted(
            findings,
            key=lambda finding: (
                -_ORDER.index(finding.grade),
                tuple(About).index(finding.about),
                -(finding.light or 0.0),
            ),
        )
    )


# NOIMPORT
