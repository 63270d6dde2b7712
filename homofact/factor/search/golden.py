"""Line minimization by golden section (thesis 3.1.2, after Numerical Recipes)."""

from collections.abc import Callable

GOLDEN = 0.6180339887498949


def golden_section(
    function: Callable[[float], float], at_zero: float, step: float, tolerance: float, period: float
) -> tuple[float, float]:
    """Return (t, value) of a local minimum of a periodic function; the search starts at t = 0 with value `at_zero`.

    First, the search steps downhill from 0 to find a bracket a < b < c with g(b) below both ends; the steps grow from
    `step` by the golden ratio, up to half a period. Then the bracket shrinks by the same ratio to `tolerance`.
    """
    best_t, best = 0.0, at_zero
    ahead = function(step)
    if ahead < best:
        direction, behind_t, best_t, best = 1.0, 0.0, step, ahead
    else:
        back = function(-step)
        if back >= best:
            return _shrink(function, -step, 0.0, step, best, tolerance)
        direction, behind_t, best_t, best = -1.0, 0.0, -step, back
    stride = step
    while abs(best_t) < period / 2:
        stride /= GOLDEN
        next_t = best_t + direction * stride
        value = function(next_t)
        if value >= best:
            low, high = sorted((behind_t, next_t))
            return _shrink(function, low, best_t, high, best, tolerance)
        behind_t, best_t, best = best_t, next_t, value
    return best_t, best


def _shrink(
    function: Callable[[float], float], low: float, middle: float, high: float, best: float, tolerance: float
) -> tuple[float, float]:
    while high - low > tolerance:
        # The probe goes into the larger part, at the golden section counted from the middle.
        if high - middle > middle - low:
            probe = middle + (1 - GOLDEN) * (high - middle)
            value = function(probe)
            if value < best:
                low, middle, best = middle, probe, value
            else:
                high = probe
        else:
            probe = middle - (1 - GOLDEN) * (middle - low)
            value = function(probe)
            if value < best:
                high, middle, best = middle, probe, value
            else:
                low = probe
    return middle, best
