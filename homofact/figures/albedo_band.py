"""Draw the error bar of a fit's total reflected light by angle of incidence, as a small chart in whole pixels.

The vertical axis is logarithmic in the source's light divided by the fit's, so that "within a factor of 5" reaches as
far up as down, and small bars stay visible beside large ones. Its ticks are percentages, or factors if a bar exceeds
100%, as in the sentence above the chart. A bar beyond a factor of `_MOST` ends at the edge of the chart with a triangle
and its factor.
"""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from homofact.evaluation.bar.error_bar import BarKind, ErrorBars

HEIGHT = 136
_DPI, _LEFT, _RIGHT, _UNDER, _OVER = 100, 58, 8, 34, 22  # the last four in pixels
_BAND, _LINE, _WORDS = "#9db4cc", "#12385f", "#333333"
_LEAST = 0.01  # of the scale: below it any error looks large
_MOST = 20.0  # of the scale: a bar of a larger factor is cut
_ROOM = 1.15  # of the scale beside the largest bar
_APART = (10.5, 32.0)  # pixels between two ticks, and between two factors of cut bars
_ROUND = tuple(digit * 10.0**power for power in range(-4, 2) for digit in (1, 2, 5))


def albedo_band(bars: ErrorBars, width: int) -> np.ndarray | None:
    """Return the chart (HEIGHT, width, 3) uint8 of the source's albedo relative to the fit's; None without bars.

    Angles that were not measured have no band.
    """
    stated = [(bar.degrees[0], 1 + bar.error) for bar in bars.by_angle if bar.error is not None]
    if not stated:
        return None
    degrees, factors = np.array(stated).T
    figure = Figure(figsize=(width / _DPI, HEIGHT / _DPI), dpi=_DPI, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes(
        (_LEFT / width, _UNDER / HEIGHT, 1 - (_LEFT + _RIGHT) / width, 1 - (_UNDER + _OVER) / HEIGHT)
    )
    reach = _ROOM * math.log(min(max(1 + _LEAST, float(factors.max())), _MOST))
    axes.set(xlim=(0, 90), ylim=(-reach, reach), xticks=[0, 20, 40, 60, 75, 90])
    high = np.log(np.minimum(factors, 2 * _MOST**_ROOM))  # cut outside the axes, and no bar is infinite
    if len(degrees) > 1:
        axes.fill_between(degrees, -high, high, color=_BAND, linewidth=0)
    axes.vlines(degrees, -high, high, color=_LINE, linewidth=1.2)
    axes.axhline(0, color=_LINE, linewidth=1)
    _mark_cut_bars(axes, [(at, factor) for at, factor in stated if factor > _MOST], reach, width)
    ratios = albedo_ticks(float(factors.max()) - 1, reach)
    axes.set_yticks([math.log(ratio) for ratio, _ in ratios], [words for _, words in ratios])
    axes.tick_params(labelsize=7.5, colors=_WORDS, length=2, pad=2)
    axes.set_xlabel("angle of incidence, degrees", fontsize=7.5, color=_WORDS, labelpad=1)
    head = "measured error of" if bars.kind is BarKind.MEASURED else "error bar of"
    # From the picture's left edge: above the axes alone there is no room for it.
    figure.text(0, 1 - 3 / HEIGHT, f"{head} total reflected light (source / fit)", fontsize=8, color=_WORDS, va="top")
    axes.spines[["top", "right"]].set_visible(False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def albedo_ticks(most: float, reach: float) -> list[tuple[float, str]]:
    """Return ticks (ratio, label) for errors up to `most` on an axis from −`reach` to `reach` in log ratio.

    Examples
    --------
    >>> albedo_ticks(4.2, 1.9)
    [(1.0, '1'), (5.0, '×5'), (0.2, '÷5'), (2.0, '×2'), (0.5, '÷2')]
    >>> albedo_ticks(0.05, 0.06)
    [(1.0, '0'), (1.05, '+5%'), (0.95, '−5%'), (1.02, '+2%'), (0.98, '−2%')]
    """
    kept = [(1.0, "1" if most > 1 else "0")]
    pixel = 2 * reach / (HEIGHT - _UNDER - _OVER)
    # From the outside in: the ticks next to the ends of the bars are needed most.
    for size in reversed(_ROUND):
        for ratio, words in _factors(size) if most > 1 else _percentages(size):
            apart = min(abs(math.log(ratio / other)) for other, _ in kept)
            if abs(math.log(ratio)) <= reach and apart >= _APART[0] * pixel:
                kept.append((ratio, words))
    return kept


def _factors(size: float) -> list[tuple[float, str]]:
    return [(size, f"×{size:g}"), (1 / size, f"÷{size:g}")] if size > 1 else []


def _percentages(size: float) -> list[tuple[float, str]]:
    sides = [(1 + size, f"+{100 * size:g}%"), (1 - size, f"−{100 * size:g}%")]
    return [(ratio, words) for ratio, words in sides if 0 < ratio <= 2]


def _mark_cut_bars(axes: Axes, cut: Sequence[tuple[float, float]], reach: float, width: int) -> None:
    """Put triangles where bars (angle, factor) leave the chart, and their factors if there is room, largest first."""
    look = {"color": _LINE, "markersize": 5, "clip_on": False, "zorder": 3}
    degree, named = (width - _LEFT - _RIGHT) / 90, list[float]()
    for at, factor in sorted(cut, key=lambda one: -one[1]):
        axes.plot(at, reach, "^", **look)
        axes.plot(at, -reach, "v", **look)
        if all(abs(at - other) * degree >= _APART[1] for other in named):
            words = f"×{factor:.2g}" if factor < 100 else f"×{factor:.0f}" if factor < 1000 else ">×1000"
            # Right of a bar at the left end, which the labels of the axis leave no room for.
            side = 1 if at * degree < _APART[1] else -1
            axes.annotate(
                words, (at, reach), (5 * side, -2), textcoords="offset points", ha="left" if side > 0 else "right",
                va="top", fontsize=7.5, color=_LINE,
            )  # fmt: skip
            named.append(at)
