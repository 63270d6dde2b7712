"""The verdict: the error bars of a fit, the warning, the findings, and all figures on which they are based."""

from dataclasses import dataclass, replace
from typing import Any

from homofact.errors import Advice, Status
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.bar.error_bar import ErrorBars
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.verdict.finding import About, Finding
from homofact.evaluation.wording import trust_in_words


@dataclass(frozen=True)
class Alarm:
    """Whether the verdict warns about a fit.

    Attributes
    ----------
    score : the probability that the fit is bad: its albedo is wrong by more than 15% at some angle in a channel, or a
        picture of a sphere by more than 10% under a sky or 25% under a lamp (`judge.is_good`). If the fit was measured
        against its source, the score is 0 or 1.
    threshold : the verdict warns if the score is above this value.
    why : text that names the main causes of a high score; "" if there are none.
    lacking : whether the only cause is a lack of measurements.
    """

    score: float
    threshold: float
    why: str = ""
    lacking: bool = False

    @property
    def given(self) -> bool:
        """Whether the score is above the threshold."""
        return self.above(None)

    def above(self, threshold: float | None) -> bool:
        """Return whether the score is above a given threshold instead of the usual one."""
        return not self.score <= (self.threshold if threshold is None else threshold)


@dataclass(frozen=True)
class Verdict:
    """The verdict on a fit: `status` of the solver or search, error bars, alarm, figures and `findings`.

    Findings about the fit come first. `look` has the artefacts in pictures of the fit; it is None if no pictures could
    be rendered.
    """

    status: Status
    bars: ErrorBars
    alarm: Alarm
    figures: Figures
    findings: tuple[Finding, ...]
    look: Look | None = None

    @property
    def trusted(self) -> bool:
        """Return whether the verdict does not warn, no picture shows an artefact, and no error bar is too wide."""
        return not self.alarm.given and not self._artefacts and not self.bars.too_wide

    def about(self, whose: About) -> tuple[Finding, ...]:
        """Return the findings about the fit, the data, or what is unknown."""
        return tuple(finding for finding in self.findings if finding.about is whose)

    def without(self, whose: About) -> "Verdict":
        """Return the verdict without the findings about one subject (the fit, the data, or what is unknown)."""
        return replace(self, findings=tuple(each for each in self.findings if each.about is not whose))

    @property
    def summary(self) -> str:
        """Return the verdict as one sentence: trusted or not, error bars, visible artefacts, and the warning if any."""
        warned = f"; warning: {self.alarm.score:.0%} likely to be bad" if self.alarm.given else ""
        shown = f"; visible artefacts: {', '.join(self._artefacts)}" if self._artefacts else ""
        return trust_in_words(self.trusted, self.bars.sentence() + shown + warned, self.bars.wide)

    @property
    def cause(self) -> str:
        """Return why the verdict warns, in words; "" without a warning."""
        return self.alarm.why if self.alarm.given else ""

    @property
    def _artefacts(self) -> list[str]:
        return [] if self.look is None else [each.kind.value for each in self.look.artefacts]

    @property
    def recommended(self) -> Advice | None:
        """Return the setting to try first for a fit that is not trusted; None if no setting is known to help."""
        if self.trusted:
            return None
        return next((finding.advice for finding in self.findings if finding.advice), None)

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary, with the figures of all groups on one level."""
        return self.figures.record() | {
            "status": self.status.value,
            "trusted": self.trusted,
            "summary": self.summary,
            "alarm": {"score": self.alarm.score, "threshold": self.alarm.threshold, "why": self.alarm.why},
            "bars": self.bars.record(),
            "recommended": None if self.recommended is None else self.recommended.record(),
            "findings": [finding.record() for finding in self.findings],
            "look": None if self.look is None else self.look.record(),
        }
