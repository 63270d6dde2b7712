"""Plot a comparison: every metric of every method, training beside held-out, with the spread over fits."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from homofact.evaluation.compare import ComparisonRow
from homofact.evaluation.metric_table import METRICS, SIX
from homofact.evaluation.repeats import RepeatedRows
from homofact.evaluation.spread import Spread
from homofact.evaluation.wording import of_repeats, shapes
from homofact.figures.log_axis import log_x
from homofact.figures.words import in_figure
from homofact.files.atomic import replace_file

_TRAINING, _HELD_OUT = "#6a8db3", "#12385f"
# Points from the panel's right edge to the right ends of the two columns of numbers, however wide the panel is.
_FIRST, _SECOND = 56, 110
_COLUMN: dict[str, Any] = {
    "xycoords": "axes fraction", "textcoords": "offset points", "ha": "right", "va": "bottom", "fontsize": 8,
    "annotation_clip": False,
}  # fmt: skip
_BESIDE: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center"}


def plot_rows(path: str | os.PathLike[str], rows: Mapping[str, ComparisonRow | RepeatedRows]) -> None:
    """Draw the six metrics of `rows`, a mapping from method labels, as dots on logarithmic axes.

    The extension of `path` chooses PNG, SVG or PDF.

    Each line of a panel is a method: a ring for the training error joined to a dot for the held-out error, with both
    numbers at the right. For several seeds or splits, rings, dots and numbers are means, and separate lines go from the
    least to the greatest value. An error of 0 is shown only as a number.

    Raises BadInput if the file cannot be written.
    """
    several = [row if isinstance(row, RepeatedRows) else RepeatedRows((row,)) for row in rows.values()]
    names = [_name(label, row) for label, row in zip(rows, several, strict=True)]
    figure = Figure(figsize=(13, 1.6 + 2 * (0.5 + 0.3 * len(rows))))
    figure.set_layout_engine("constrained", wspace=0.04, hspace=0.08)
    axes = figure.subplots(2, 3, sharey=True)
    for number, (axis, name) in enumerate(zip(axes.ravel(), SIX, strict=True)):
        metric = METRICS[name]
        title = f"{metric.label} [{metric.unit}]" if metric.unit else metric.label
        spreads = [(row.train[name], row.held_out[name]) for row in several]
        _dots(axis, spreads)
        axis.set_title(title, fontsize=10, loc="left", pad=18)
        for place, colour, words in ((_FIRST, _TRAINING, "○ training"), (_SECOND, _HELD_OUT, "● held out")):
            axis.annotate(words, (1.0, 1.0), (place, 5), color=colour, **_COLUMN)
        axis.tick_params(axis="y", length=0, labelsize=9, labelleft=number % 3 == 0)
    axes[0, 0].set_ylim(len(rows) - 0.4, -0.6)
    axes[0, 0].set_yticks(range(len(rows)), names)
    first, widest = several[0].first, max(several, key=lambda row: len(row.rows))
    means = f"; means of {of_repeats(len(widest.seeds), len(widest.splits))}, lines from least to greatest"
    seeds = means if len(widest.rows) > 1 else ""
    epsilon = first.factorization.transform.epsilon
    figure.suptitle(f"{in_figure(first.source)}: lower is better (ε = {epsilon:g}, {first.samples} samples{seeds})")
    replace_file(path, lambda made: figure.savefig(made, dpi=110))


def _dots(axis: Axes, spreads: Sequence[tuple[Spread, Spread]]) -> None:
    """Draw one panel: a line for each (training, held-out) pair, and both numbers in columns beside the panel."""
    ends = [end for pair in spreads for part in pair for end in (part.low, part.mean, part.high) if 0 < end < math.inf]
    low, high = (min(ends), max(ends)) if ends else (0.1, 1.0)
    room = max(high / low, 10.0) ** 0.06
    log_x(axis, low / room, high * room, fewest=2, most=3)
    axis.grid(axis="x", color="#e4e4e4", linewidth=0.8)
    axis.set_axisbelow(True)
    axis.spines[["top", "right", "left"]].set_visible(False)
    for place, (train, held_out) in enumerate(spreads):
        spread = train.low < train.high or held_out.low < held_out.high
        axis.axhline(place, color="#f1f1f1", linewidth=0.8, zorder=0)
        if not spread:
            axis.plot((train.mean, held_out.mean), (place, place), color="#9db4cc", linewidth=2, zorder=2)
        for part, shift, colour, look in (
            (train, -0.14, _TRAINING, {"ms": 9, "mfc": "none", "mew": 1.6, "zorder": 3}),
            (held_out, 0.14, _HELD_OUT, {"ms": 5.5, "zorder": 4}),
        ):
            at = place + (shift if spread else 0)
            axis.plot((part.low, part.high), (at, at), color=colour, linewidth=1.2)
            axis.plot(part.mean, at, "o", color=colour, **look)
        for column, colour, part in ((_FIRST, _TRAINING, train), (_SECOND, _HELD_OUT, held_out)):
            axis.annotate(f"{part.mean:.3g}", (1.0, place), (column, 0), color=colour, **_COLUMN | _BESIDE)


def _name(label: str, several: RepeatedRows) -> str:
    sizes = dict.fromkeys(shapes([texture.size for texture in row.factorization.textures]) for row in several.rows)
    settings = several.first.settings
    if not several.first.factorization.textures:
        lobes = getattr(settings, "lobes", 0)
        return f"{settings.name}, {lobes} lobe{'' if lobes == 1 else 's'}" if lobes else settings.name
    if len(sizes) == 1:
        return f"{label}, {next(iter(sizes))}"
    # The table of costs has what each fit came out with.
    most = max(row.factorization.nbytes for row in several.rows)
    return f"{label}, up to {most:,} bytes"
