"""The two charts of one source: error against fitting time, and against what an evaluation costs.

Held-out Cole error upwards, cost to the right, both logarithmic: down and to the left is better. Every
point is a run and says its textures and size; the filled ones are the Pareto front, which a line joins,
the open ones are beaten by another run in both. McCool's own factorization is the reference: the right
hand axis and the numbers on the front are shares of its lowest error among the runs of the chart.
"""

import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from homofact.errors import BadInput
from homofact.evaluate.chart_ledger import ChartRow
from homofact.evaluate.pareto import front
from homofact.figures.label_places import nearest_edge, place_labels
from homofact.figures.log_axis import log_x, log_y, plain_number, round_ticks, set_ticks
from homofact.files.atomic import write_bytes

# Colours that differ to colour-blind eyes too (Okabe and Ito 2008), dark enough for text; with each a shape and its
# width in points, later ones smaller, so that two runs on one spot are both seen.
_Look = tuple[str, str, float]
_KNOWN: dict[str, _Look] = {
    "mccool": ("#555555", "s", 8.0),
    "cole": ("#b35900", "^", 7.5),
    "search (gradient)": ("#0059a8", "o", 7.5),
}
_MORE: tuple[_Look, ...] = (
    ("#00785a", "D", 4.5),
    ("#a03070", "v", 5.0),
    ("#806600", "P", 5.5),
    ("#4a3fa0", "X", 5.0),
    ("#8a1c1c", "p", 4.5),
)
_FRONT_COLOUR = "#999999"
_CLEAR = 4.5  # points round a marker's middle that labels leave free


def reference(rows: Sequence[ChartRow]) -> ChartRow | None:
    """McCool's own factorization with the lowest held-out Cole error above 0, or None where the chart has none."""
    return min(
        (row for row in rows if row.is_reference and _drawn(row)), key=lambda row: row.held_out.log_mse, default=None
    )


def write_charts(folder: str | os.PathLike[str], name: str, rows: Sequence[ChartRow]) -> list[Path]:
    """Draw both charts of one source's rows into `folder`: NAME_time and NAME_cost, as PNG and SVG; their paths.

    Raises BadInput where no row can be drawn or the folder cannot be written.
    """
    if not any(_drawn(row) for row in rows):
        raise BadInput(f"{name}: none of {len(rows)} rows has an error above 0, expected one to draw")
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
    """Held-out Cole error against the seconds of the fit."""
    figure = Figure(figsize=(10, 7))
    axes = figure.subplots()
    _finish(figure, rows, "error against fitting time", [_Panel(axes, rows, _seconds)])
    return figure


def cost_chart(rows: Sequence[ChartRow]) -> Figure:
    """Held-out Cole error against the bytes of the textures, and against the fetches of an evaluation."""
    figure = Figure(figsize=(14, 7))
    left, right = figure.subplots(1, 2)
    panels = [_Panel(left, rows, _kibibytes), _Panel(right, rows, _fetches)]
    _finish(figure, rows, "error against the cost of evaluation", panels)
    return figure


@dataclass(frozen=True)
class _Cost:
    """What a chart has to the right: its words, its value, and its axis between two values."""

    words: str
    of: Callable[[ChartRow], float]
    axis: Callable[[Axes, float, float, Sequence[float]], None]


def _decimal(axes: Axes, low: float, high: float, _: Sequence[float]) -> None:
    log_x(axes, low, high)


def _doubling(axes: Axes, low: float, high: float, _: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    powers = [2.0**k for k in range(-12, 25) if low <= 2.0**k <= high]
    set_ticks(axes.xaxis, powers or round_ticks(low, high))


def _whole(axes: Axes, low: float, high: float, values: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    set_ticks(axes.xaxis, sorted(set(values)))


_seconds = _Cost("fitting time [s]", lambda row: row.seconds_fit, _decimal)
_kibibytes = _Cost("textures as float32 [KiB]", lambda row: row.bytes / 1024, _doubling)
_fetches = _Cost("texture fetches of one evaluation", lambda row: row.fetches, _whole)


@dataclass(frozen=True)
class _Panel:
    """One pair of axes with its rows and its cost."""

    axes: Axes
    rows: Sequence[ChartRow]
    cost: _Cost

    def points(self) -> tuple[list[ChartRow], list[tuple[float, float]]]:
        """The rows that are drawn and their (cost, error); runs that are one and the same point once."""
        found: dict[tuple[str, float, float], ChartRow] = {}
        for row in self.rows:
            if _drawn(row):
                found.setdefault((row.name, self.cost.of(row), row.held_out.log_mse), row)
        return list(found.values()), [(cost, error) for _, cost, error in found]


def _drawn(row: ChartRow) -> bool:
    return 0 < row.held_out.log_mse < float("inf") and row.seconds_fit > 0


def _looks(rows: Sequence[ChartRow]) -> dict[str, _Look]:
    """A colour, a shape and its width for each series; the usual ones look the same in every chart."""
    names = list(dict.fromkeys(row.series for row in rows))
    others = [name for name in names if name not in _KNOWN]
    looks = _KNOWN | {name: _MORE[place % len(_MORE)] for place, name in enumerate(others)}
    return {name: looks[name] for name in names}


def _finish(figure: Figure, rows: Sequence[ChartRow], what: str, panels: Sequence[_Panel]) -> None:
    """Points, fronts, reference and axes of all panels; title, key and caption; the labels at last."""
    looks, base = _looks(rows), reference(rows)
    panels[0].axes.set_ylabel(f"held-out Cole error (mean squared log difference, ε = {rows[0].epsilon:g})")
    errors = [row.held_out.log_mse for row in rows if _drawn(row)]
    low, high = min(errors) / 1.5, max(errors) * 1.35
    fronts = [_draw(panel, looks, base, (low, high)) for panel in panels]
    if base is not None:
        _shares(panels[-1].axes, base.held_out.log_mse, (low, high))
    _frame(figure, rows, what, looks)
    # Labels are put where there is room, which is known once the layout is.
    FigureCanvasAgg(figure).draw()
    figure.set_layout_engine("none")
    for panel, line in zip(panels, fronts, strict=True):
        _label(figure, panel, looks, base, line)


def _frame(figure: Figure, rows: Sequence[ChartRow], what: str, looks: dict[str, _Look]) -> None:
    """Title and key above the panels, caption below them, in room of their own."""
    first, height = rows[0], figure.get_figheight()
    handles = [
        Line2D([], [], color=colour, marker=shape, linestyle="", markersize=width, label=name)
        for name, (colour, shape, width) in looks.items()
    ]
    handles.append(Line2D([], [], color=_FRONT_COLOUR, linewidth=1.2, label="Pareto front (its points are filled)"))
    columns = min(len(handles), 5 if figure.get_figwidth() < 12 else 8)
    lines = -(-len(handles) // columns)
    caption = [
        "Labels: textures × texels per side².",
        f"ε = {first.epsilon:g}, {first.held_out_part:.0%} of {first.samples} samples held out, seed {first.seed},"
        f" channels {first.channels if len(first.channels) < 16 else 'of a spectrum'}.",
        first.machine,
    ]
    if any(row.textures < row.textures_asked for row in rows):
        caption[0] += " A run that was asked for more textures than it found worth having shows those it kept."
    left_out = sum(not _drawn(row) for row in rows)
    if left_out:
        caption.append(f"{left_out} of {len(rows)} runs are not drawn: their error is no number above 0.")
    top, bottom = (0.55 + 0.22 * lines) / height, (0.15 + 0.16 * len(caption)) / height
    figure.set_layout_engine("constrained", rect=(0, bottom, 1, 1 - top - bottom))
    figure.text(0.5, 1 - 0.12 / height, f"{first.source}: {what}", ha="center", va="top", fontsize=14)
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, 1 - 0.42 / height),
        borderaxespad=0,
        ncols=columns,
        frameon=False,
        fontsize=9,
    )
    figure.text(0.5, 0.08 / height, "\n".join(caption), ha="center", va="bottom", fontsize=7.5, color="#555555")


def _draw(
    panel: _Panel, looks: dict[str, _Look], base: ChartRow | None, limits: tuple[float, float]
) -> list[tuple[float, float]]:
    """Axes, points, front and reference line of one panel; the corners of the front in data coordinates."""
    axes, (rows, points) = panel.axes, panel.points()
    costs = [x for x, _ in points]
    left, right = min(costs) / 1.5, max(costs) * 1.6
    log_y(axes, *limits)
    panel.cost.axis(axes, left, right, costs)
    axes.set_xlabel(panel.cost.words)
    axes.grid(color="#eeeeee", linewidth=0.8, zorder=0)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    on = front(points)
    corners = [(points[on[0]][0], limits[1])]
    for i in on:
        corners += [(points[i][0], corners[-1][1]), points[i]]
    corners.append((right, corners[-1][1]))
    axes.plot(*zip(*corners, strict=True), color=_FRONT_COLOUR, linewidth=1.2, zorder=1)
    if base is not None:
        axes.axhline(base.held_out.log_mse, color="#555555", linewidth=0.8, linestyle=(0, (1, 3)), zorder=1)
    for i, (row, (x, y)) in enumerate(zip(rows, points, strict=True)):
        colour, shape, width = looks[row.series]
        face, edge = (colour, "white") if i in on else ("white", colour)
        # A white rim, put on from outside, parts filled points that lie on each other.
        style = {"markerfacecolor": face, "markeredgecolor": edge, "markersize": width + (1.5 if i in on else 0)}
        axes.plot(x, y, shape, zorder=3, markeredgewidth=1.0, **style)
    return corners


def _shares(axes: Axes, base: float, limits: tuple[float, float]) -> None:
    """The right hand axis: the error as a share of the reference's."""
    right = axes.twinx()
    log_y(right, limits[0] / base, limits[1] / base)
    set_ticks(
        right.yaxis, round_ticks(limits[0] / base, limits[1] / base, 5, 9), lambda value: f"×{plain_number(value)}"
    )
    right.set_ylabel("of McCool's own factorization (dotted: its lowest error here)", color="#555555", fontsize=9)
    right.tick_params(axis="y", colors="#555555", labelsize=8)
    right.spines[["top", "left"]].set_visible(False)
    right.spines["right"].set_color("#cccccc")


def _label(
    figure: Figure,
    panel: _Panel,
    looks: dict[str, _Look],
    base: ChartRow | None,
    corners: Sequence[tuple[float, float]],
) -> None:
    """Every point's label, where it covers nothing; all places in 1/72 inch, whatever the picture's pixels."""
    axes, (rows, points) = panel.axes, panel.points()
    on = set(front(points))
    scale = 72 / figure.dpi
    renderer = FigureCanvasAgg(figure).get_renderer()

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x, y = axes.transData.transform(point)
        return float(x) * scale, float(y) * scale

    texts = []
    for i, row in enumerate(rows):
        words = f"{row.textures}×{row.size}²"
        if i in on and base is not None and not row.is_reference:
            share = row.held_out.log_mse / base.held_out.log_mse
            words += f"  ×{share:.2f}" if share >= 0.1 else f"  ×{share:.2g}"
        weight, colour = "bold" if i in on else "normal", looks[row.series][0]
        texts.append(
            axes.annotate(
                words,
                points[i],
                xytext=(0, 0),
                textcoords="offset points",
                fontsize=7.5,
                fontweight=weight,
                color=colour,
                zorder=4,
            )
        )
    extents = [text.get_window_extent(renderer) for text in texts]
    frame = axes.get_window_extent(renderer)
    places = [place(point) for point in points]
    lines = _along([place(corner) for corner in corners])
    if base is not None:
        lines += _along([place((x, base.held_out.log_mse)) for x in axes.get_xlim()])
    chosen = place_labels(
        places,
        [(extent.width * scale + 1, extent.height * scale) for extent in extents],
        (frame.x0 * scale, frame.y0 * scale, frame.x1 * scale, frame.y1 * scale),
        lines=lines,
        radius=_CLEAR,
    )
    for text, point, (x, y), label in zip(texts, points, places, chosen, strict=True):
        text.set_position((label.box[0] - x + 0.5, label.box[1] - y))
        if label.leader:
            end = nearest_edge((x, y), label.box)
            arrow = {"arrowstyle": "-", "linewidth": 0.6, "color": text.get_color(), "shrinkA": 0, "shrinkB": 3}
            offset = (end[0] - x, end[1] - y)
            axes.annotate("", point, xytext=offset, textcoords="offset points", arrowprops=arrow, zorder=2)


def _along(corners: Sequence[tuple[float, float]], step: float = 3.0) -> list[tuple[float, float]]:
    """Places every `step` along the line through `corners`."""
    found = []
    for (x0, y0), (x1, y1) in pairwise(corners):
        count = round((abs(x1 - x0) + abs(y1 - y0)) / step) + 1
        found += [(x0 + (x1 - x0) * k / count, y0 + (y1 - y0) * k / count) for k in range(count + 1)]
    return found
