"""Draw readable logarithmic axes: a few round ticks, each with its number, and no minor ticks."""

import math
from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

# Leading digits of the ticks in a decade, from sparse to dense.
_DIGITS = ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))


def round_ticks(low: float, high: float, fewest: int = 3, most: int = 7) -> list[float]:
    """Return at most `most` round numbers in [`low`, `high`], `low` > 0, and if possible at least `fewest`.

    The ticks of a decade are 1; 1 and 3; 1, 2 and 5; or denser. A range of many decades has a tick only at every
    second, third, … decade.
    """
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    ticks: list[float] = []
    for digits in _DIGITS:
        stride = 1
        while True:
            decades = [decade for decade in range(first, last + 1) if decade % stride == 0]
            inside = [digit * 10.0**decade for decade in decades for digit in digits]
            inside = [tick for tick in inside if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]
            if len(inside) <= most:
                break
            if len(digits) > 1:  # too dense: the sparser ones before stand
                return ticks
            stride += 1
        ticks = inside
        if len(ticks) >= fewest:
            break
    return ticks


def plain_number(value: float) -> str:
    """Return a tick's label for a number of at least 0: 0, 0.02, 500, or a power of ten outside 1e-4 to 1e6."""
    if value == 0 or 1e-4 <= value < 1e6:
        return f"{value:.10f}".rstrip("0").rstrip(".")
    exponent = math.floor(math.log10(value) + 1e-9)
    digit = value / 10.0**exponent
    return f"$10^{{{exponent}}}$" if abs(digit - 1) < 1e-6 else f"${digit:g}\\cdot10^{{{exponent}}}$"


def set_ticks(axis: Axis, ticks: list[float], words: Callable[[float], str] = plain_number) -> None:
    """Put these ticks on an axis (an Axes' xaxis or yaxis) and no others."""
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda value, _: words(value)))
    axis.set_minor_locator(NullLocator())


def log_x(axes: Axes, low: float, high: float, fewest: int = 3, most: int = 7) -> None:
    """Set up a logarithmic x axis from `low` to `high` with round ticks."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    set_ticks(axes.xaxis, round_ticks(low, high, fewest, most))


def log_y(axes: Axes, low: float, high: float, fewest: int = 5, most: int = 9) -> None:
    """Set up a logarithmic y axis from `low` to `high` with round ticks."""
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    set_ticks(axes.yaxis, round_ticks(low, high, fewest, most))
