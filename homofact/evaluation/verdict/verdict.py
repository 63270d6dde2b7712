"""The verdict itself: the possible error of a fit, the warning, the notes, and all figures behind them."""

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
    score : the probability that it is bad: its albedo off by over 15% at some angle in a channel, or less than 90% of
        the logarithms explained. 0 or 1 if it was measured against the source.
    threshold : the score from which on the verdict warns.
    why : what raises the score most, in words; "" where nothing does.
    lacking : whether this is only a lack of measurements.
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
        """Return whether the score is above another threshold than the usual one."""
        return not self.score <= (self.threshold if threshold is None else threshold)


@dataclass(frozen=True)
class Verdict:
    """What a fit ends with: `status` is how it ended, `findings` those of the fit first.

    `look` is what pictures of the fit show beside those of its source, None where nothing could be drawn.
    """

    status: Status
    bars: ErrorBars
    alarm: Alarm
    figures: Figures
    findings: tuple[Finding, ...]
    look: Look | None = None

    @property
    def trusted(self) -> bool:
        """Return whether the verdict does not warn, no picture shows an artefact, and no limit is too wide."""
        return not self.alarm.given and not self._artefacts and not self.bars.too_wide

    def about(self, whose: About) -> tuple[Finding, ...]:
        """Return the findings about the fit, the data, or what is unknown."""
        return tuple(finding for finding in self.findings if finding.about is whose)

    def without(self, whose: About) -> "Verdict":
        """Return the verdict with no findings about one of the three."""
        return replace(self, findings=tuple(each for each in self.findings if each.about is not whose))

    @property
    def summary(self) -> str:
        """Return whether the fit is trusted, its possible error, and the warning if there is one, in one sentence."""
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
        """Return the setting to try first after a warning; None if no setting is known to help."""
        if self.trusted:
            return None
        return next((finding.advice for finding in self.findings if finding.advice), None)

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary, the figures of all groups side by side."""
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
