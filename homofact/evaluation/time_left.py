"""The time that is left as a range of seconds that follows the clock, and in words.

A range is one number in words only if it is known within a factor of 2. A range wider than a factor of 8 is not shown.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

# Seconds that count beside those measured, so that a first part, which also loads libraries, changes little.
BESIDE = 1.0
# The ratio of a range's ends up to which one number is named, and up to which both ends are. Seconds up to which the
# upper end is named alone.
_CERTAIN, _WIDE, _SOON = 2.0, 8.0, 60.0


@dataclass(frozen=True)
class TimeLeft:
    """The time that is left when a part begins: about `seconds`, at least `least` and at most `most`.

    `running` are the most seconds of this part, which has taken `passed` so far; 0 if what runs is no part of the
    estimate. `known` are the seconds of the finished parts behind the expectation: the fewer they are, the more a part
    that takes longer delays the rest. `whole` is true for the time of the whole call, and false for the time of one
    step of it.
    """

    seconds: float
    least: float
    most: float
    running: float
    known: float = BESIDE
    whole: bool = False
    passed: float = 0.0

    @classmethod
    def within(cls, seconds: float, factor: float = _CERTAIN) -> "TimeLeft":
        """Return the time of a step of one part, known within a factor."""
        return cls(seconds, seconds / factor, seconds * factor, seconds * factor)

    @classmethod
    def at_rate(cls, done: float, left: float, passed: float) -> "TimeLeft":
        """Return the time of `left` parts of a step, of which `done` parts took `passed` seconds."""
        each, factor = passed / done, spread(done)
        return cls(each * left, each * left / factor, each * left * factor, each * factor, passed)

    def after(self, seconds: float) -> "TimeLeft":
        """Return what is left so many seconds later, if the part still runs."""
        return replace(self, passed=self.passed + seconds)

    @property
    def now(self) -> tuple[float, float, float]:
        """The expected seconds, the least and the most of them; all are 0 if the part takes longer than expected."""
        if self.running == 0:
            return self.seconds, self.least, self.most
        slower = max(1.0, (self.known + self.passed) / (self.known + self.running))
        expected, least, most = (
            max(slower * each - self.passed, 0.0) for each in (self.seconds, self.least, self.most)
        )
        return (0.0, 0.0, 0.0) if least == 0 and self.passed >= self.most else (expected, least, most)

    def words(self) -> str:
        """Return the time as text; empty if it is unknown.

        Examples
        --------
        >>> left = TimeLeft.within(40)
        >>> left.words(), left.after(30).words(), left.after(90).words()
        ('about 20 to 80 s left in this step', 'up to 50 s left in this step', 'takes longer than expected')
        """
        expected, least, most = self.now
        if most == 0:
            return "takes longer than expected" if self.most > 0 else ""
        words = between(expected, least, most)
        return f"{words} left{'' if self.whole else ' in this step'}" if words else ""


def spread(done: float) -> float:
    """Return the factor by which the time of a part may differ from that of `done` finished ones of its kind."""
    return 1 + 1 / math.sqrt(1 + done)


def between(expected: float, least: float, most: float) -> str:
    """Return a range of seconds as text, or one number if the range is known within a factor of 2.

    The text is empty for a range that is wider than a factor of 8.

    Examples
    --------
    >>> between(40, 30, 50), between(60, 30, 120), between(20, 2, 40), between(60, 5, 300)
    ('about 40 s', 'about 30 s to 2 min', 'up to 40 s', '')
    """
    if most < 10:
        return "under 10 s"
    if most <= _CERTAIN * least:
        return about(expected)
    last = _amount(most, math.ceil)
    if least < max(most / _WIDE, 10):
        return f"up to {last}" if most <= _SOON else ""
    # A tenth of a unit below is as good.
    first = _amount(least, lambda units: math.floor(units + 0.1))
    same_unit = first.split()[-1] == last.split()[-1]
    return f"about {first.split()[0] if same_unit else first} to {last}" if first != last else f"about {last}"


def about(seconds: float) -> str:
    """Return an approximate time as text: "about 40 s", "about 4 min", "about 2.5 h", "about 3 days"."""
    return "under 10 s" if seconds < 10 else f"about {_amount(seconds)}"


def _amount(seconds: float, rounded: Callable[[float], int] = round) -> str:
    if seconds < 90:
        return f"{10 * rounded(seconds / 10)} s"
    if seconds < 90 * 60:
        return f"{rounded(seconds / 60)} min"
    if seconds < 36 * 3600:
        return f"{rounded(seconds / 1800) / 2:g} h"
    days = rounded(seconds / 86400)
    return f"{days} days" if days < 100 else "many months"
