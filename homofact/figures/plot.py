"""The picture of a comparison: every metric of every method, training beside held out."""

import os
from collections.abc import Sequence

from matplotlib.figure import Figure

from homofact.evaluate.compare import Row
from homofact.figures.log_axis import log_x
from homofact.files.atomic import replace_file

_METRICS = (
    ("log_mse", "log space, mean squared (Cole error)"),
    ("log_mae", "log space, mean absolute"),
    ("log_max", "log space, maximum"),
    ("mse", "linear, mean squared [sr⁻²]"),
    ("mae", "linear, mean absolute [sr⁻¹]"),
    ("max", "linear, maximum [sr⁻¹]"),
)


def plot_rows(path: str | os.PathLike[str], rows: Sequence[Row]) -> None:
    """Draw the six metrics of `rows` as bars on logarithmic axes into `path` (PNG, SVG or PDF by its ending).

    Raises BadInput where the place cannot be written.
    """
    names = [f"{row.settings.name}, {len(row.factorization.terms)} × {row.settings.size}²" for row in rows]
    figure = Figure(figsize=(12, 3 + 0.5 * len(rows)), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    places = range(len(rows))
    for axis, (metric, title) in zip(axes, _METRICS, strict=True):
        for errors, shift, colour, label in (
            ([getattr(row.train, metric) for row in rows], -0.2, "#7f9fbf", "training"),
            ([getattr(row.held_out, metric) for row in rows], 0.2, "#1f4e79", "held out"),
        ):
            bars = axis.barh([place + shift for place in places], errors, 0.38, color=colour, label=label)
            axis.bar_label(bars, fmt="%.3g", padding=3, fontsize=8)
        axis.set_xscale("log")
        low, high = axis.get_xlim()
        log_x(axis, low / 2, high * 6, most=5)  # room for the numbers
        axis.set_yticks(list(places), names, fontsize=9)
        axis.invert_yaxis()
        axis.set_title(title, fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    epsilon = rows[0].factorization.transform.epsilon
    figure.suptitle(f"{rows[0].source}: lower is better (ε = {epsilon:g}, {rows[0].samples} samples)")
    replace_file(path, lambda made: figure.savefig(made, dpi=110))
