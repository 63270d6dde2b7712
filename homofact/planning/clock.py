"""Report the progress of a plan and the estimated remaining time before every fit.

The number of fits of a plan is not known in advance. The clock expects `USUAL` fits for each material that has not
begun, also for those of a following plan under another lighting, and `LARGER` fits for each larger step. For a material
without a fit that meets its tolerance, it expects as many fits as the search may still make. The seconds per fit come
from the model of `evaluation.estimate`, corrected by the time of the fits so far. The time of the verdicts is added:
one per choice, or one per fit if choices must be trusted.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import fmean

from homofact.evaluation.estimate import fit_seconds, training_count, verdict_seconds
from homofact.evaluation.wording import counted
from homofact.planning.ladder import Candidate, method_of
from homofact.planning.material_fits import MaterialFits

# Fits per material that plans make in the median (scripts/planning/planner_blind.py), and those of a larger step.
USUAL, LARGER = 4, 1
# Seconds of a fit of a material that has not been read, and by so many the model counts beside what was measured.
_UNREAD = 2.0


@dataclass
class PlanClock:
    """Tells where a plan is: `tell` is called with words, seconds that have passed, and seconds that may be left."""

    tell: Callable[[str, float, float], object]
    materials: int = 0
    words: str = ""
    following: int = 0
    _begun: float = field(default_factory=time.monotonic)
    _fits: MaterialFits | None = None
    _usual: float = _UNREAD
    _modelled: float = 0.0
    _asked: tuple[float, float] | None = None
    _spent: float = 0.0
    _made: int = 0
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
        self._settle()
        self.materials = max(self.materials - 1, 0)
        self._fits, self._made, self.words = fits, 0, words
        textured = [rung for rung in fits.rungs if not rung.is_colour and rung == rung.fit]
        self._verdict = verdict_seconds(len(fits.source.samples))
        self._usual = fmean(self._seconds(rung) for rung in textured)
        self._say(words, USUAL)

    def asking(self, candidate: Candidate, most: int | None) -> None:
        """Report that a candidate is to be fitted next; if none meets the tolerance, `most` fits may remain."""
        self._settle()
        if candidate.is_colour or self._fits is None:
            return
        if candidate.fit not in self._fits.made:
            self._asked = self._seconds(candidate), time.monotonic()
            self._made += 1
        further = max(USUAL - self._made, 1) if most is None else most - 1
        state = "" if most is None else f"; none meets the tolerance so far, at most {counted(most, 'fit')} left"
        self._say(f"{self.words}: fit {self._made}, {candidate.words}{state}", further)

    def larger(self, words: str) -> None:
        """Begin the larger step of a material."""
        self._settle()
        self._steps = max(self._steps - 1, 0)
        self.materials = 0
        self._say(words, LARGER)

    def stage(self, words: str) -> None:
        """Begin a step that is not a fit."""
        self._settle()
        self._fits = None
        self._say(words, 0)

    def _settle(self) -> None:
        """Record how long the previous fit took."""
        if self._asked is not None:
            modelled, begun = self._asked
            self._modelled, self._spent = self._modelled + modelled, self._spent + time.monotonic() - begun
            self._asked = None

    def _seconds(self, candidate: Candidate) -> float:
        """Return the modelled seconds of a fit of the current material, including a verdict if one follows."""
        fits = self._fits
        if fits is None:
            return _UNREAD
        method = method_of(candidate, fits.options, fits.source.default_epsilon)
        judging = self._verdict if self._trusted else 0.0
        return fit_seconds(method, training_count(fits.source, method, fits.options.held_out)) + judging

    def _say(self, words: str, further: float) -> None:
        factor = (self._spent + _UNREAD) / (self._modelled + _UNREAD)
        now = self._asked[0] if self._asked is not None else 0.0
        others = (self.materials + self.following) * USUAL + self._steps * LARGER
        fitting = factor * (now + (further + others) * self._usual)
        at_the_end = 0.0 if self._trusted else self._judged * self._verdict
        self.tell(words, time.monotonic() - self._begun, fitting + at_the_end)
