"""The picture of a plan: error against bytes of the evaluated fits, and the used part of the tolerance per choice.

The left panel compares all materials (`planning.figure_points`). It is left out if no material has more than one point.
The right panel has a bar for each choice, limit and lighting: the part of the limit that is used, with the margin for
other views in a lighter colour. Material and choice are named beside the bars, outside the axes.
"""

import math
import os
from collections.abc import Sequence
from textwrap import wrap

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from homofact.evaluation.wording import counted
from homofact.figures.words import in_figure
from homofact.files.atomic import replace_file
from homofact.planning.figure_points import COLOURS, LIMIT, draw_points, frame_points, name_of_choice, spots_of
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.tolerance import MARGINS, UNLIT, WORDS

_MOST_LETTERS = 32
# Room for so many rows at least, beside the left panel and alone.
_FEWEST_BESIDE, _FEWEST_ROWS = 7, 3
# Of a line of the title over two panels, and over one.
_LETTERS_WIDE, _LETTERS_NARROW = 150, 95


def plot_plan(path: str | os.PathLike[str], plan: ScenePlan) -> None:
    """Draw the panels into `path` (PNG, SVG or PDF by its ending).

    Raises BadInput where the place cannot be written.
    """
    distinct = plan.distinct
    bars = [_bars(material) for material in distinct]
    rows = sum(map(len, bars)) + 2 * len(bars)
    spots = [spots_of(material) for material in distinct]
    compared = any(len(own) > 1 for own in spots)
    with matplotlib.rc_context({"font.size": 9}):
        height = max(4.6 if compared else 2.0, 1.4 + 0.27 * rows)
        figure = Figure(figsize=(12.5 if compared else 8.0, height), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1)) if compared else (None, figure.subplots())
        if left is not None:
            frame_points(left, distinct, spots, any(each.tolerance.trusted for each in distinct))
        names = [name_of_choice(*pair) for pair in zip(distinct, spots, strict=True)]
        _used(right, distinct, names, bars, _FEWEST_BESIDE if compared else _FEWEST_ROWS)
        lines = _title(plan, _LETTERS_WIDE if compared else _LETTERS_NARROW)
        figure.suptitle(in_figure("\n".join(lines)), fontsize=10)
        if left is not None:
            # Markers and names are put where there is room, which is known once the layout is.
            figure.canvas.draw()
            figure.set_layout_engine("none")
            draw_points(figure, left, distinct, spots)
        replace_file(path, lambda made: figure.savefig(made, dpi=120))


def _title(plan: ScenePlan, letters: int) -> list[str]:
    """Return the lines of the title: the tolerance, in lines of about equal length, and the result."""
    where = ", ".join(lighting.name for lighting in plan.scene.lightings)
    asked = f"{plan.scene.name}: {plan.tolerance_words}, under {where}"
    lines = wrap(asked, letters)
    while len(wrap(asked, letters - 1)) == len(lines) and letters > len(max(asked.split(), key=len)) + 1:
        letters -= 1
    missed = sum(not each.walk.met for each in plan.distinct)
    miss = f"tolerance missed for {missed} of {counted(len(plan.distinct), 'material')}; " if missed else ""
    return [
        *wrap(asked, letters),
        f"{miss}{plan.bytes} bytes; {plan.fits} of {plan.exhaustive_fits} possible fits made",
    ]


def _bars(plan: MaterialPlan) -> list[tuple[str, float, float]]:
    """Return (words, used part of the limit, the same with its margin) for each limit and lighting."""
    bars = []
    for judge, errors in zip(plan.judges, plan.errors, strict=False):
        for kind, limit in plan.tolerance.limits:
            words = WORDS[kind] if kind in UNLIT else f"{WORDS[kind]}, {judge.lighting.name}"
            part = errors.of(kind) / limit
            bars.append((words, part, part * MARGINS[kind]))
    return bars


def _used(
    axes: Axes,
    distinct: tuple[MaterialPlan, ...],
    names: Sequence[str],
    bars: list[list[tuple[str, float, float]]],
    fewest: int,
) -> None:
    place, ticks, labels, most = 0.0, list[float](), list[tuple[str, str]](), 1.0
    for k, (plan, choice, own) in enumerate(zip(distinct, names, bars, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        outcome = plan.outcome
        words = choice + ("" if outcome is None else f", {outcome.bytes} bytes")
        share = "" if plan.material.pixels is None else f", {plan.material.pixels} pixels"
        name = plan.name if len(plan.name) <= _MOST_LETTERS else plan.name[: _MOST_LETTERS - 1] + "…"
        # Beside the axes: inside they would run across the limit's line and, long as they are, beyond the panel.
        for line, height in ((f"{name}{share}", 0.6), (words, 0.9)):
            ticks.append(place)
            labels.append((line, colour))
            place += height
        for label, part, with_margin in own:
            shown = [value if math.isfinite(value) else 0.0 for value in (part, with_margin)]
            axes.barh(place, shown[1], color=colour, alpha=0.3, height=0.62)
            axes.barh(place, shown[0], color=colour, height=0.62)
            ticks.append(place)
            labels.append((label, ""))
            most = max(most, *shown)
            place += 1
        place += 0.2
    axes.axvline(1, color=LIMIT, lw=1.2, ls="--", zorder=0)
    axes.set_xlim(0, most * 1.06)
    axes.set_ylim(max(place, fewest) - 0.3, -0.7)
    axes.set_yticks(ticks, [in_figure(words) for words, _ in labels], fontsize=8)
    for tick, (_, colour) in zip(axes.get_yticklabels(), labels, strict=True):
        if colour:
            tick.set(color=colour, fontweight="bold")
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("part of the limit that the choice uses\n(lighter: with the margin for other views)")
    axes.set_title("How much of its limits each choice uses", fontsize=9.5)
    axes.spines[["top", "right", "left"]].set_visible(False)
