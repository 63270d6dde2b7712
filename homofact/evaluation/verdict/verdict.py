"""The verdict itself: how far a fit may be off, whether it is warned of, what was noted, and all figures behind it."""

from dataclasses import dataclass, replace
from typing import Any

from homofact.errors import Advice, Status
from homofact.evaluation.artefacts.look import Look
from homofact.evaluation.bar.error_bar import ErrorBars
from homofact.evaluation.verdict.figures import Figures
from homofact.evaluation.verdict.finding import About, Finding


@dataclass(frozen=True)
class Alarm:
    """Whether a fit is warned of.

    Attributes
    ----------
    score : the probability that it is bad: its albedo off by over 15% at some angle in a channel, or less than 90% of
        the logarithms explained. 0 or 1 where the source was asked.
    threshold : from where on it is warned of.
    """

    score: float
    threshold: float

    @property
    def given(self) -> bool:
        """Whether the score is above the threshold."""
        return self.above(None)

    def above(self, threshold: float | None) -> bool:
        """Whether the score is above another threshold than the usual one."""
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
        """Whether the fit is not warned of and no picture of it shows an artefact."""
        return not self.alarm.given and not self._artefacts

    def about(self, whose: About) -> tuple[Finding, ...]:
        """The findings about the fit, the data, or what is unknown."""
        return tuple(finding for finding in self.findings if finding.about is whose)

    def without(self, whose: About) -> "Verdict":
        """The verdict with no findings about one of the three."""
        return replace(self, findings=tuple(each for each in self.findings if each.about is not whose))

    @property
    def summary(self) -> str:
        """How far the fit may be off, and whether it is warned of, in one sentence."""
        warned = f"; warning: {self.alarm.score:.0%} that it is bad" if self.alarm.given else ""
        shown = f"; visible artefacts: {', '.join(self._artefacts)}" if self._artefacts else ""
        return self.bars.sentence() + shown + warned

    @property
    def _artefacts(self) -> list[str]:
        return [] if self.look is None else [each.kind.value for each in self.look.artefacts]

    @property
    def recommended(self) -> Advice | None:
        """The setting to try first where the fit is warned of; None where no setting is known to help."""
        if self.trusted:
            return None
        return next((finding.advice for finding in self.findings if finding.advice), None)

    def record(self) -> dict[str, Any]:
        """A JSON-able dictionary, the figures of all groups side by side."""
        return self.figures.record() | {
            "status": self.status.value,
            "trusted": self.trusted,
            "summary": self.summary,
            "alarm": {"score": self.alarm.score, "threshold": self.alarm.threshold},
            "bars": self.bars.record(),
            "recommended": None if self.recommended is None else self.recommended.record(),
            "findings": [finding.record() for finding in self.findings],
            "look": None if self.look is None else self.look.record(),
        }
