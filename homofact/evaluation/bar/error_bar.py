"""Error bars of a fit: one bar per quantity, with its kind and the range of angles for which it is valid.

A bar states that the source reflects between `low` and `high` times the light of the fit. If the source can be
evaluated everywhere, the bar is a measured error. For samples, the bar is an estimate. In the calibration, nine of ten
errors were within their bars (docs/verdict.md). The calibration uses fits to correct samples or, if the verdict
suspects a fault, fits to faulty samples. A bar wider than a factor of ten carries no information and is withdrawn.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import groupby
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.bar.table import RATE
from homofact.evaluation.wording import listed

MOST = 9.0  # an error of nine times the value: a factor of ten
TOO_WIDE = f"it may be off by more than a factor of {1 + MOST:g}"
WORDS = {
    "albedo": "total reflected light",
    "highlight": "highlight",
    "sky": "under a sky",
    "lamp": "under a lamp",
}
_PICTURES = ("sky", "lamp")  # their errors are sums of differences, which no ratio of light bounds
_EDGE = 75.0  # θ in degrees up to which albedos are stated
_WORTH_SAYING = 0.05  # of the light at an angle: from here on it is said that it leaves where nothing was measured
_WORTH_A_DIRECTION = 0.01  # an error from here on is said to be too dark or too bright, where that was measured
# A fit that is off by more in one of these is a bad one.
GOOD = {"albedo": 0.15, "sky": 0.10, "lamp": 0.25}


class BarKind(Enum):
    """How a bar was obtained. The value is the string in JSON records."""

    MEASURED = "measured"
    RIGHT = "if the data are right"
    FAULT = "whatever is wrong with the data"
    WITHDRAWN = "withdrawn"


@dataclass(frozen=True)
class ErrorBar:
    """The bound of a fit's error in one quantity.

    Attributes
    ----------
    quantity : "albedo" (total reflected light, of the worst channel and angle), "highlight" (light in the brightest
        1%), "sky" or "lamp" (the picture of a sphere under this light, Σ|difference|/Σ).
    kind : how the bar was obtained.
    error : the bound of the relative error, 0.09 for 9%; None if the bar is withdrawn.
    rate : the share of calibration fits whose error is within the bound, 0.9; 1 for a measured error. It is slightly
        lower on fits that the calibration had not seen (docs/verdict.md).
    degrees : the range of measured θ in degrees. The bar of the albedo holds for incidences in this range.
    reason : why the bar is withdrawn or wide, as a clause for a sentence such as "…, so these limits are wider"; ""
        otherwise.
    unmeasured : for the albedo at one angle, the share of the fit's light that leaves in directions without
        measurements, NaN beyond the measured range; else 0.
    ratio : the fit's light divided by the source's, if the error was measured; None for an estimate and for pictures.
    """

    quantity: str
    kind: BarKind
    error: float | None
    rate: float
    degrees: tuple[float, float]
    reason: str = ""
    unmeasured: float = 0.0
    ratio: float | None = None

    @classmethod
    def stated(
        cls,
        quantity: str,
        kind: BarKind,
        bound: float,
        rate: float,
        degrees: tuple[float, float],
        reason: str = "",
        unmeasured: float = 0.0,
    ) -> "ErrorBar":
        """Return the bar for a bound; the bar is withdrawn if the bound exceeds `MOST`."""
        if not bound <= MOST:
            why = reason or TOO_WIDE
            return cls(quantity, BarKind.WITHDRAWN, None, rate, degrees, why, unmeasured)
        return cls(quantity, kind, bound, rate, degrees, reason, unmeasured)

    @property
    def rests_on_extrapolation(self) -> bool:
        """Whether the share of light in unmeasured directions is larger than the error bound."""
        return self.error is not None and self.unmeasured > max(self.error, _WORTH_SAYING)

    @property
    def direction(self) -> str:
        """Return "too dark" or "too bright" for a measured error; "" if it was not measured or is below 1%."""
        if self.ratio is None or self.error is None or self.error < _WORTH_A_DIRECTION:
            return ""
        return "too dark" if self.ratio < 1 else "too bright"

    @property
    def low(self) -> float | None:
        """The smallest possible ratio of the source's light to the fit's; None for pictures, and if withdrawn."""
        return None if self.error is None or self.quantity in _PICTURES else 1 / (1 + self.error)

    @property
    def high(self) -> float | None:
        """The largest possible ratio of the source's light to the fit's; None for pictures, and if withdrawn."""
        return None if self.error is None or self.quantity in _PICTURES else 1 + self.error

    def words(self) -> str:
        """Return the bar as text: "highlight within 9% (too dark)", or "highlight unknown" if it is withdrawn.

        For the albedo, the text includes the range of angles: "total reflected light within 9% (0–75°, too dark)".
        """
        name = WORDS[self.quantity]
        within = "unknown" if self.error is None else f"within {percent(self.error)}"
        angles = "{:.0f}–{:.0f}°".format(*self.degrees) if self.quantity == "albedo" else ""
        about = ", ".join(filter(None, (angles, self.direction)))
        return f"{name} {within}" + (f" ({about})" if about else "")

    def between(self) -> str:
        """Return the range of source/fit as text: "0.95 to 1.05", or "unknown" if the bar is withdrawn."""
        if self.low is None or self.high is None:
            return "unknown"
        near = self.high < 1.1

        def step(value: float) -> float:
            return 0.001 if near else 10.0 ** (math.floor(math.log10(value)) - 2)

        # Rounded outwards, as `percent` rounds up.
        low, high = -_up(-self.low, step(self.low)), _up(self.high, step(self.high))
        form = ".3f" if near else ".3g"
        return f"{low:{form}} to {high:{form}}"

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {
            "quantity": self.quantity,
            "kind": self.kind.value,
            "error": self.error,
            "low": self.low,
            "high": self.high,
            "rate": self.rate,
            "degrees": list(self.degrees),
            "reason": self.reason,
            "unmeasured": self.unmeasured,
            "ratio": self.ratio,
        }

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "ErrorBar":
        """Return the bar of a JSON record. Raises KeyError, TypeError or ValueError if the record is invalid."""
        low, high = map(float, record["degrees"])
        error, ratio = record["error"], record.get("ratio")
        if error is not None and not 0 <= float(error) < math.inf:
            raise ValueError(f"an error of {error}")
        return cls(
            str(record["quantity"]),
            BarKind(record["kind"]),
            None if error is None else float(error),
            float(record["rate"]),
            (low, high),
            str(record["reason"]),
            float(record.get("unmeasured", 0.0)),
            None if ratio is None else float(ratio),
        )


@dataclass(frozen=True)
class ErrorBars:
    """The bars of a fit: `bars` for each quantity, and `by_angle` for the albedo at single angles, sorted by θ."""

    bars: tuple[ErrorBar, ...]
    by_angle: tuple[ErrorBar, ...] = ()

    def of(self, quantity: str) -> ErrorBar:
        """Return the bar of a quantity. Raises BadInput that lists the valid names for an unknown quantity."""
        for bar in self.bars:
            if bar.quantity == quantity:
                return bar
        raise BadInput(
            where="quantity", found=repr(quantity), expected=f"one of {', '.join(bar.quantity for bar in self.bars)}"
        )

    def interval(self, quantity: str, theta: float | None = None) -> ErrorBar:
        """Return the bar of a quantity or, with `theta`, of the albedo at this angle of incidence in degrees.

        Between the angles of `by_angle`, the error is interpolated linearly. Below the first and above the last, the
        nearest angle's error is used. Beyond the measured range the bar is withdrawn. Raises BadInput for an unknown
        quantity, for `theta` with a quantity other than the albedo, and for an angle outside 0 to 90.
        """
        bar = self.of(quantity)
        if theta is None:
            return bar
        if quantity != "albedo" or not self.by_angle:
            raise BadInput(where="theta", found=f"{theta:g} of {quantity}", expected="an angle of the albedo alone")
        if not 0 <= theta <= 90:
            raise BadInput(where="theta", found=f"{theta:g}", expected="from 0 to 90 degrees")
        if not bar.degrees[0] <= theta <= bar.degrees[1]:
            reason = f"the error bars are for incidence angles of {bar.degrees[0]:.0f}–{bar.degrees[1]:.0f}°"
            return ErrorBar(quantity, BarKind.WITHDRAWN, None, bar.rate, (theta, theta), reason, unmeasured=math.nan)
        below = [each for each in self.by_angle if each.degrees[0] <= theta] or [self.by_angle[0]]
        above = [each for each in self.by_angle if each.degrees[0] >= theta] or [self.by_angle[-1]]
        one, two = below[-1], above[0]
        if one.error is None or two.error is None:
            worse = one if one.error is None else two
            unmeasured = worse.unmeasured
            return ErrorBar(quantity, worse.kind, None, worse.rate, (theta, theta), worse.reason, unmeasured)
        apart = two.degrees[0] - one.degrees[0]
        share = (theta - one.degrees[0]) / apart if apart > 0 else 0.0
        error = (1 - share) * one.error + share * two.error
        unmeasured = (1 - share) * one.unmeasured + share * two.unmeasured
        return ErrorBar(quantity, one.kind, error, one.rate, (theta, theta), one.reason, unmeasured)

    @property
    def kind(self) -> BarKind:
        """How the bars were obtained; `BarKind.WITHDRAWN` if all bars are withdrawn."""
        return next((bar.kind for bar in self.bars if bar.error is not None), BarKind.WITHDRAWN)

    @property
    def too_wide(self) -> bool:
        """Whether a bar was withdrawn because the error may exceed a factor of ten."""
        return any(bar.error is None and bar.reason == TOO_WIDE for bar in self.bars)

    @property
    def wide(self) -> bool:
        """Whether an estimated bar exceeds the largest error of a good fit, so the fit may not be good."""
        estimated = (bar for bar in self.bars if bar.kind is not BarKind.MEASURED and bar.quantity in GOOD)
        return any(bar.error is not None and bar.error > GOOD[bar.quantity] for bar in estimated)

    def sentence(self) -> str:
        """Return all bars in one sentence."""
        stated = [bar for bar in self.bars if bar.error is not None]
        albedo = self.bars[0]
        if not stated:
            return f"how far it may be off is unknown: {albedo.reason}"
        low, high = albedo.degrees
        said = ", ".join(self._albedo_words() if bar is albedo else bar.words() for bar in self.bars)
        if self.kind is BarKind.MEASURED:
            return f"measured against the source: {said}"
        beyond = f"; measured {low:.0f}–{high:.0f}°, beyond is extrapolation" if high < _EDGE else ""
        given = "if the samples are right"
        if self.kind is BarKind.FAULT:
            given = f"{stated[0].reason}, so these limits are wider"
        return f"{given}: {said}; true for {_often(self.kind, stated[0].rate)} such fits{beyond}"

    def _albedo_words(self) -> str:
        """The albedo's bar in words: where some angles rest on extrapolation, the limit of the others and of each."""
        albedo = self.bars[0]
        extrapolated = [bar for bar in self.by_angle if bar.rests_on_extrapolation]
        relied_on = [bar for bar in self.by_angle if bar not in extrapolated]
        if not extrapolated or not relied_on or albedo.error is None or any(bar.error is None for bar in relied_on):
            return albedo.words()
        worst = max(bar.error or 0.0 for bar in relied_on)
        limits = [f"{percent(worst)} at {listed([self._reach(run) for run in _runs(relied_on, self.by_angle)])}"]
        limits += [f"{percent(bar.error or 0.0)} at {self._reach([bar])}" for bar in extrapolated]
        angles = listed([self._reach([bar]) for bar in extrapolated])
        return f"{WORDS[albedo.quantity]} within {listed(limits)} ({angles} partly extrapolated)"

    def _reach(self, run: Sequence[ErrorBar]) -> str:
        """Return the angles of a run; the first and the last of all angles include what is measured beyond them."""
        low, high = self.bars[0].degrees
        first = low if run[0] is self.by_angle[0] else run[0].degrees[0]
        last = high if run[-1] is self.by_angle[-1] else run[-1].degrees[1]
        return f"{first:.0f}°" if round(first) == round(last) else f"{first:.0f}–{last:.0f}°"

    def by_angle_sentence(self) -> str:
        """Return a sentence that lists the angles of incidence at which the fit is good or bad.

        Returns "" if the fit is equally good at all angles, since `sentence` covers this case.

        Examples
        --------
        >>> errors = {0: 0.03, 45: 0.1, 75: 0.4}
        >>> bars = [ErrorBar("albedo", BarKind.MEASURED, e, 1.0, (at, at)) for at, e in errors.items()]
        >>> whole = ErrorBar("albedo", BarKind.MEASURED, 0.4, 1.0, (0, 75))
        >>> ErrorBars((whole,), tuple(bars)).by_angle_sentence()
        'by angle of incidence, total reflected light is good at 0–45° (within 10%) and bad at 75° (within 40%)'
        """
        runs = [list(run) for _, run in groupby(self.by_angle, key=_grade)]
        if len(runs) < 2:
            return ""
        parts = [f"{_grade(run[0])} at {self._reach(run)}{_within(run)}" for run in runs]
        joined = " and ".join(filter(None, (", ".join(parts[:-1]), parts[-1])))
        return f"by angle of incidence, total reflected light is {joined}"

    def extrapolated_sentence(self) -> str:
        """Return a sentence that lists the angles where the fit extrapolates, and their share of light; "" if none.

        Examples
        --------
        >>> bar = ErrorBar("albedo", BarKind.RIGHT, 0.06, 0.9, (75.0, 75.0), unmeasured=0.22)
        >>> ErrorBars((), (bar,)).extrapolated_sentence().partition(": ")[2]
        'the limit of total reflected light there (6%) rests on extrapolation'
        """
        found = [bar for bar in self.by_angle if bar.rests_on_extrapolation]
        if not found:
            return ""
        angles = listed([f"{bar.degrees[0]:.0f}°" for bar in found])
        shares = listed([f"{bar.unmeasured:.0%}" for bar in found])
        limits = listed([percent(bar.error) for bar in found if bar.error is not None])
        limit, rest = ("limit", "rests") if len(found) == 1 else ("limits", "rest")
        return (
            f"at {angles} incidence, {shares} of the light leaves in directions without measurements: the {limit} of"
            f" total reflected light there ({limits}) {rest} on extrapolation"
        )

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {"all": [bar.record() for bar in self.bars], "by_angle": [bar.record() for bar in self.by_angle]}

    @classmethod
    def of_record(cls, record: Any) -> "ErrorBars | None":
        """Return the bars of a JSON record; None if the record is invalid."""
        try:
            bars, by_angle = (tuple(map(ErrorBar.of, record[part])) for part in ("all", "by_angle"))
        except (KeyError, TypeError, ValueError):
            return None
        return cls(bars, by_angle) if bars else None


def _grade(bar: ErrorBar) -> str:
    return "unknown" if bar.error is None else "good" if bar.error <= GOOD["albedo"] else "bad"


def _runs(some: Sequence[ErrorBar], every: Sequence[ErrorBar]) -> list[list[ErrorBar]]:
    """Return the bars of `some` in runs of neighbours in `every`."""
    neighbours = groupby(every, key=lambda bar: bar in some)
    return [list(run) for own, run in neighbours if own]


def _within(run: list[ErrorBar]) -> str:
    worst = max((bar for bar in run if bar.error is not None), key=lambda bar: bar.error or 0.0, default=None)
    if worst is None or worst.error is None:
        return ""
    return f" (within {percent(worst.error)}{f', {worst.direction}' * bool(worst.direction)})"


def percent(error: float, factor: str = "a factor of ") -> str:
    """Return a limit as text, rounded up: 0.4%, 2.1%, 5%, 12%; above 100%, a `factor` with two digits.

    The smallest result is 0.1%. From 5% on, percentages are whole numbers.
    """
    if math.isinf(error):
        return "an infinite factor"
    if error > 1:
        return f"{factor}{_up(1 + error, 10 ** (math.floor(math.log10(1 + error)) - 1)):.2g}"
    return f"{_up(100 * max(error, 0.001), 0.1 if error < 0.05 else 1):.3g}%"


def _up(value: float, step: float) -> float:
    """The next multiple of a step, without the last digits of floats."""
    return math.ceil(round(value / step, 6)) * step


# As often as they held on cases that the calibration had not seen (docs/verdict.md).
_OFTEN = {
    BarKind.RIGHT: "eight to nine of ten",
    BarKind.FAULT: "about eight of ten",
}


def _often(kind: BarKind, rate: float) -> str:
    return _OFTEN[kind] if rate == RATE else f"{rate:.0%} of"
