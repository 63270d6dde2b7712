"""Draw the two charts of one source: error against fitting time, and error against evaluation cost.

The y axis is the held-out Cole error, the x axis the cost. Both are logarithmic, except for fetches; lower left is
better. Each point is a run, labelled with the number and size of its textures. Runs that differ only in seed or split
share one point at their mean, with bars from the least to the greatest value. Filled points form the Pareto front,
drawn as a line. For each open point, another point has no larger error and no larger cost. The reference is McCool's
own factorization: the right axis and the numbers on the front are ratios to its lowest error in the chart.
"""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from homofact.errors import BadInput
from homofact.evaluation.chart_ledger import ChartRow
from homofact.evaluation.chart_points import ChartPoint, points_of, reference
from homofact.evaluation.wording import listed_seeds, of_repeats
from homofact.figures.chart_panel import BYTES, FETCHES, FRONT_COLOUR, SECONDS, Look, Panel, share_axis
from homofact.figures.words import in_figure
from homofact.files.atomic import write_bytes

# Colours that differ to colour-blind eyes too (Okabe and Ito 2008), dark enough for text; with each a shape and its
# width in points, later ones smaller, so that two runs on one spot are both seen.
_KNOWN: dict[str, Look] = {
    "mccool": ("#555555", "s", 8.0),
    "cole": ("#b35900", "^", 7.5),
    "search": ("#0059a8", "o", 7.5),
}
_MORE: tuple[Look, ...] = (
    ("#00785a", "D", 4.5),
    ("#a03070", "v", 5.0),
    ("#806600", "P", 5.5),
    ("#4a3fa0", "X", 5.0),
    ("#8a1c1c", "p", 4.5),
)


def write_charts(folder: str | os.PathLike[str], name: str, rows: Sequence[ChartRow]) -> list[Path]:
    """Draw both charts into `folder` as NAME_time and NAME_cost, each as PNG and SVG, and return their paths.

    Raises BadInput where no row can be drawn or the folder cannot be written.
    """
    if not any(_drawn(row) for row in rows):
        raise BadInput(f"none of {len(rows)} rows has an error above 0", where=name, expected="one to draw")
    written = []
    # The ids in an SVG are random unless salted: the same rows give the same file.
    with matplotlib.rc_context({"svg.hashsalt": "homofact"}):
        for ending, figure in (("time", time_chart(rows)), ("cost", cost_chart(rows))):
            for suffix in ("png", "svg"):
                buffer = io.BytesIO()
                figure.savefig(buffer, format=suffix, dpi=160, metadata={"Date": None} if suffix == "svg" else None)
                path = Path(folder) / f"{name}_{ending}.{suffix}"
                write_bytes(path, buffer.getvalue())
                written.append(path)
    return written


def time_chart(rows: Sequence[ChartRow]) -> Figure:
    """Return the chart of held-out Cole error against the seconds of the fit."""
    figure = Figure(figsize=(10, 7))
    axes = figure.subplots()
    _finish(figure, rows, "error against fitting time", [Panel(axes, _points(rows), SECONDS)])
    return figure


def cost_chart(rows: Sequence[ChartRow]) -> Figure:
    """Return the chart of held-out Cole error against the textures' bytes and against fetches per evaluation."""
    figure = Figure(figsize=(14, 7))
    left, right = figure.subplots(1, 2)
    panels = [Panel(left, _points(rows), BYTES), Panel(right, _points(rows), FETCHES)]
    _finish(figure, rows, "error against the cost of evaluation", panels)
    return figure


def _drawn(row: ChartRow) -> bool:
    return 0 < row.held_out.log_mse < float("inf") and row.seconds_fit > 0


def _points(rows: Sequence[ChartRow]) -> list[ChartPoint]:
    return points_of(row for row in rows if _drawn(row))


def _looks(rows: Sequence[ChartRow]) -> dict[str, Look]:
    """Return each series' colour, marker and marker width; the usual series look the same in every chart."""
    names = list(dict.fromkeys(row.series for row in rows))
    others = [name for name in names if name not in _KNOWN]
    looks = _KNOWN | {name: _MORE[place % len(_MORE)] for place, name in enumerate(others)}
    return {name: looks[name] for name in names}


# Points of the caption, and the mean width of its letters in them.
_CAPTION, _LETTER = 7.5, 0.6


def _finish(figure: Figure, rows: Sequence[ChartRow], what: str, panels: Sequence[Panel]) -> None:
    """Draw the points, fronts, reference and axes of all panels, then title, key and caption, then the labels."""
    looks, points = _looks(rows), panels[0].all_points
    base = reference(points)
    panels[0].axes.set_ylabel(f"held-out Cole error (mean squared log difference, ε = {rows[0].epsilon:g})")
    low, high = min(point.error.low for point in points) / 1.5, max(point.error.high for point in points) * 1.35
    fronts = [panel.draw(looks, base, (low, high)) for panel in panels]
    if base is not None:
        share_axis(panels[-1].axes, base.error.mean, (low, high))
    _frame(figure, rows, what, looks)
    # Labels are put where they fit, which is known once the layout is.
    FigureCanvasAgg(figure).draw()
    figure.set_layout_engine("none")
    for panel, line in zip(panels, fronts, strict=True):
        panel.label(figure, looks, base, line)


def _frame(figure: Figure, rows: Sequence[ChartRow], what: str, looks: dict[str, Look]) -> None:
    """Write title and key above the panels and the caption below them, without overlap."""
    height = figure.get_figheight()
    handles = [
        Line2D([], [], color=colour, marker=shape, linestyle="", markersize=width, label=in_figure(name))
        for name, (colour, shape, width) in looks.items()
    ]
    handles.append(Line2D([], [], color=FRONT_COLOUR, linewidth=1.2, label="Pareto front (its points are filled)"))
    columns = min(len(handles), 5 if figure.get_figwidth() < 12 else 8)
    lines = -(-len(handles) // columns)
    caption = _caption(rows, figure.get_figwidth())
    top, bottom = (0.55 + 0.22 * lines) / height, (0.15 + 0.16 * len(caption)) / height
    figure.set_layout_engine("constrained", rect=(0, bottom, 1, 1 - top - bottom))
    figure.text(0.5, 1 - 0.12 / height, f"{in_figure(rows[0].source)}: {what}", ha="center", va="top", fontsize=14)
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, 1 - 0.42 / height),
        borderaxespad=0,
        ncols=columns,
        frameon=False,
        fontsize=9,
    )
    figure.text(
        0.5, 0.08 / height, in_figure("\n".join(caption)), ha="center", va="bottom", fontsize=_CAPTION, color="#555555"
    )


def _caption(rows: Sequence[ChartRow], width: float) -> list[str]:
    """Return the explanation of labels and numbers, in lines that fit into `width` inches."""
    first = rows[0]
    bare = ", or bytes of a model without textures" if any(row.size == 0 for row in rows) else ""
    caption = [f"Labels: number of textures × the side in texels of a square texture of that size{bare}."]
    widest = max(points_of(rows), key=lambda point: len(point.rows))
    if len(widest.rows) > 1:
        mean = f"the mean of up to {of_repeats(len(widest.seeds), len(widest.splits))}"
        caption[0] += f" A point is {mean}, at the most bytes and fetches of them; its bars go from least to greatest."
    if any(row.textures < row.textures_asked for row in rows):
        caption[0] += " A run may keep fewer textures than requested, where more were not worth it."
    split = "split by " * (len(widest.splits) > 1) + listed_seeds(widest.splits)
    caption += [
        f"ε = {first.epsilon:g}, {first.held_out_part:.0%} of {first.samples} samples held out,"
        f" {split}, channels {first.channels if len(first.channels) < 16 else 'of a spectrum'}.",
        first.machine,
    ]
    left_out = sum(not _drawn(row) for row in rows)
    if left_out:
        caption.append(f"{left_out} of {len(rows)} runs are left out: their error is not a number above 0.")
    letters = int(width * 72 / (_CAPTION * _LETTER))
    return [line for words in caption for line in wrap(words, letters)]
