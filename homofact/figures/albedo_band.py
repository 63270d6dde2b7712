"""Draw the error bar of a fit's total reflected light by angle of incidence, as a small chart in whole pixels."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from homofact.evaluation.bar.error_bar import BarKind, ErrorBars

HEIGHT = 120
_DPI, _LEFT, _RIGHT, _UNDER, _OVER = 100, 58, 8, 34, 22  # the last four in pixels
_BAND, _LINE, _WORDS = "#9db4cc", "#12385f", "#333333"
_LEAST = 0.01  # of the scale: below it any error looks large
_MOST = 3.0  # of the scale: a wider bar runs out of the chart


def albedo_band(bars: ErrorBars, width: int) -> np.ndarray | None:
    """Return the chart (HEIGHT, width, 3) uint8 of the source's albedo relative to the fit's; None without bars.

    Angles that were not measured have no band.
    """
    stated = [(bar.degrees[0], bar.low - 1, bar.high - 1) for bar in bars.by_angle if bar.low and bar.high]
    if not stated:
        return None
    degrees, low, high = np.array(stated).T
    figure = Figure(figsize=(width / _DPI, HEIGHT / _DPI), dpi=_DPI, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes(
        (_LEFT / width, _UNDER / HEIGHT, 1 - (_LEFT + _RIGHT) / width, 1 - (_UNDER + _OVER) / HEIGHT)
    )
    if len(degrees) > 1:
        axes.fill_between(degrees, low, high, color=_BAND, linewidth=0)
    axes.vlines(degrees, low, high, color=_LINE, linewidth=1.2)
    axes.axhline(0, color=_LINE, linewidth=1)
    reach = 1.15 * min(max(_LEAST, float(np.max(high))), _MOST)
    axes.set(xlim=(0, 90), ylim=(max(-reach, -1.0), reach), xticks=[0, 20, 40, 60, 75, 90])
    axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _share(value)))
    axes.tick_params(labelsize=7.5, colors=_WORDS, length=2, pad=2)
    axes.set_xlabel("angle of incidence, degrees", fontsize=7.5, color=_WORDS, labelpad=1)
    measured = bars.kind is BarKind.MEASURED
    head = "measured error of" if measured else "error bar of"
    axes.set_title(f"{head} total reflected light", fontsize=8, color=_WORDS, loc="left", pad=4)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _share(value: float) -> str:
    """A tick's label: "0", "+5%", "−0.5%"."""
    return "0" if abs(value) < 1e-12 else f"{100 * value:+.3g}%".replace("-", "−")
