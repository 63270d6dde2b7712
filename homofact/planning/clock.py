"""Report the progress of a plan and the estimated remaining time before every fit.

The number of fits of a plan is not known in advance, so its time is a wide range at first. The clock expects `MODELS`
and `TEXTURED` fits for each material that has not begun, also for those of a following plan under another lighting, and
`LARGER` fits for each larger step. For a material without a fit that meets its tolerance, it expects at most as many
fits as the search may still make. The seconds per fit come from the model of `evaluation.estimate`, corrected by the
time of the fits so far. The time of the verdicts is added: one per choice, or one per fit if choices must be trusted.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import fmean

from homofact.evaluation.estimate import TimeEstimate, fit_seconds, solved_samples, verdict_seconds
from homofact.evaluation.time_left import TimeLeft
from homofact.evaluation.wording import counted
from homofact.methods.models import Ggx
from homofact.methods.search import Search
from homofact.planning import ladder
from homofact.planning.ladder import Candidate, method_of
from homofact.planning.material_fits import MaterialFits

# Fits per material with textures, and those of a larger step: the usual number, the least and the most
# (scripts/planning/planner_blind.py).
TEXTURED, LARGER = (2, 0, 16), (1, 0, 3)
# Seconds of a fit of a material that has not been read, and of a model.
_UNREAD, _MODEL = 2.0, 0.5
_Further = tuple[str, float, float, float]


@dataclass
class PlanClock:
    """Tells where a plan is: `tell` is called with words, and with the time that is left of the plan."""

    tell: Callable[[str, TimeLeft], object]
    materials: int = 0
    words: str = ""
    following: int = 0
    _estimate: TimeEstimate = field(default_factory=TimeEstimate)
    _fits: MaterialFits | None = None
    _usual: float = _UNREAD
    _made: int = 0
    _textured: int = 0
    _steps: int = 0
    _judged: int = 0
    _verdict: float = 0.0
    _trusted: bool = False

    def expect(self, materials: int, steps: int, trusted: bool = False) -> None:
        """Set how many materials are still to be planned, and how many larger steps are to be fitted after them.

        The attribute `following` is the number of materials of a plan that begins after this one. If some choice must
        be `trusted`, fits are judged as soon as they are made.
        """
        self.materials, self._steps, self._trusted = materials, steps, trusted
        self._judged = self._judged or materials

    def material(self, fits: MaterialFits, words: str) -> None:
        """Begin the material of `fits`, which has been read."""
        self._estimate.end()
        self.materials = max(self.materials - 1, 0)
        self._fits, self._made, self._textured, self.words = fits, 0, 0, words
        textured = [rung for rung in fits.rungs if rung.textures and rung == rung.fit]
        self._verdict = verdict_seconds(len(fits.source.samples), first=True)
        self._usual = fmean(self._seconds(rung) for rung in textured)
        self._say(words, *_of_materials(1, self._usual))

    def asking(self, candidate: Candidate, most: int | None) -> None:
        """Report that a candidate is to be fitted next; if none meets the tolerance, `most` fits may remain."""
        self._estimate.end()
        if candidate.is_colour or self._fits is None:
            return
        if candidate.fit not in self._fits.made:
            self._made += 1
            self._textured += candidate.textures > 0
            self._estimate.begin(self._estimate.add(candidate.family, self._seconds(candidate)))
        usual, _, largest = TEXTURED
        further = (max(usual - self._textured, 1), 0, max(largest - self._textured, 2))
        if most is not None:
            further = (most - 1, (most - 1) / 2, most - 1)
        state = "" if most is None else f"; none meets the tolerance so far, at most {counted(most, 'fit')} left"
        self._say(f"{self.words}: fit {self._made}, {candidate.words}{state}", _fits(further, self._usual))

    def larger(self, words: str) -> None:
        """Begin the larger step of a material."""
        self._estimate.end()
        self._steps = max(self._steps - 1, 0)
        self.materials = 0
        self._say(words, _fits(LARGER, self._usual))

    def stage(self, words: str) -> None:
        """Begin a step that is not a fit."""
        self._estimate.end()
        self._fits = None
        self._say(words)

    def _seconds(self, candidate: Candidate) -> float:
        """Return the modelled seconds of a fit of the current material, including a verdict if one follows."""
        fits = self._fits
        if fits is None:
            return _UNREAD
        method = method_of(candidate, fits.options, fits.source.default_epsilon)
        judging = self._verdict if self._trusted else 0.0
        return fit_seconds(method, solved_samples(fits.source, method, fits.options.held_out)) + judging

    def _say(self, words: str, *further: _Further) -> None:
        others = (*_of_materials(self.materials + self.following, self._usual), _fits(LARGER, self._usual, self._steps))
        judged = 0.0 if self._trusted else self._judged * self._verdict
        verdicts = ("verdict", judged, judged, judged)
        self.tell(words, self._estimate.time_left(further=(*further, *others, verdicts)))


def _of_materials(count: int, seconds: float) -> tuple[_Further, _Further]:
    """Return the modelled seconds of the fits of so many materials."""
    models = count * len(ladder.MODELS) * _MODEL
    return (Ggx.name, models, models, models), _fits(TEXTURED, seconds, count)


def _fits(numbers: tuple[float, float, float], seconds: float, count: int = 1) -> _Further:
    usual, least, most = (count * number * seconds for number in numbers)
    return Search.name, usual, least, most
