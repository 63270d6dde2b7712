"""The picture of a plan: what was asked, error against bytes, and how much of the tolerance each choice uses.

Left all materials in one panel, so that they can be compared: a colour a material, a marker a method, filled for
floats and hollow for 8 bits, the choices ringed and joined to the others of their material by a thin line. Right a bar
for each choice, limit and lighting: the part of the limit that is used, with the margin for other views lighter.
"""

import math
import os

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from homofact.figures.log_axis import log_x, log_y
from homofact.files.atomic import replace_file
from homofact.scene.plan.ladder import WHOLE, Candidate
from homofact.scene.plan.plan import MaterialPlan, ScenePlan
from homofact.scene.plan.tolerance import MARGINS

_MARKERS = {"constant": "o", "lambert-9": "D", "mccool": "s", "search": "h", "svd": "^"}
# Okabe and Ito's, which colour-blind eyes can tell apart.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#666666")
_LIMIT = "#b03030"
# A rung without error has a place on a logarithmic axis too.
_LEAST = 1e-3
_MOST_LETTERS = 26


def plot_plan(path: str | os.PathLike[str], plan: ScenePlan) -> None:
    """Draw the two panels into `path` (PNG, SVG or PDF by its ending).

    Raises BadInput where the place cannot be written.
    """
    distinct = plan.distinct
    bars = [_bars(each) for each in distinct]
    rows = sum(map(len, bars)) + len(bars)
    with matplotlib.rc_context({"font.size": 9}):
        figure = Figure(figsize=(12.5, max(4.6, 1.7 + 0.27 * rows)), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1))
        _asked(left, distinct)
        _used(right, distinct, bars)
        where = ", ".join(each.name for each in plan.scene.lightings)
        figure.suptitle(
            f"{plan.scene.name}: {plan.scene.tolerance.describe()}, under {where}. {plan.bytes} bytes,"
            f" {plan.planning_fits} of {plan.exhaustive_fits} fits",
            fontsize=10,
        )
        replace_file(path, lambda made: figure.savefig(made, dpi=120))


def _asked(axes: Axes, distinct: tuple[MaterialPlan, ...]) -> None:
    errors, sizes, methods = [1.0], [12], {}
    for k, each in enumerate(distinct):
        places = {
            candidate: (found.bytes, max(found.error, _LEAST))
            for candidate, found in each.walk.asked.items()
            if math.isfinite(found.error)
        }
        colour = _COLOURS[k % len(_COLOURS)]
        line = sorted(places.values())
        axes.plot(*zip(*line, strict=True), color=colour, lw=0.6, alpha=0.5, zorder=1)
        for candidate, place in places.items():
            hollow = candidate.storage == WHOLE
            size = 9 if candidate.method == "constant" else 6
            face = "white" if hollow else colour
            axes.plot(*place, _MARKERS[candidate.method], color=colour, ms=size, mfc=face, zorder=3)
            methods[candidate.method] = None
        choice = each.walk.choice
        if choice in places:
            axes.plot(*places[choice], "o", ms=14, mfc="none", mec=colour, mew=1.8, zorder=4)
            axes.annotate(
                _short(choice), places[choice], xytext=(10, 4), textcoords="offset points", fontsize=8, color=colour
            )
        errors += [error for _, error in places.values()]
        sizes += [size for size, _ in places.values()]
    axes.axhline(1, color=_LIMIT, lw=1.2, ls="--", zorder=0)
    log_x(axes, min(sizes) / 1.6, max(*sizes, 200) * 3)
    log_y(axes, min(errors) / 1.8, max(errors) * 1.8, fewest=3)
    axes.set_xlabel("bytes of one material")
    axes.set_ylabel("error over tolerance, margin included")
    axes.set_title("Every representation that was asked about", fontsize=9.5)
    axes.spines[["top", "right"]].set_visible(False)
    handles = [Line2D([], [], ls="", marker=_MARKERS[name], color="#444444", ms=6, label=name) for name in methods]
    handles += [
        Line2D([], [], ls="", marker="h", color="#444444", mfc="white", ms=6, label="8 bits"),
        Line2D([], [], ls="", marker="o", mec="#444444", mfc="none", mew=1.8, ms=11, label="chosen"),
        Line2D([], [], color=_LIMIT, ls="--", lw=1.2, label="tolerance"),
    ]
    if not any(candidate.storage == WHOLE for each in distinct for candidate in each.walk.asked):
        del handles[len(methods)]
    axes.legend(handles=handles, loc="upper right", fontsize=8, framealpha=0.9, ncols=2)


def _bars(each: MaterialPlan) -> list[tuple[str, float, float]]:
    """(words, part of the limit used, and with the margin) by limit and lighting."""
    found = []
    for judge, errors in zip(each.judges, each.errors, strict=False):
        for kind, limit in each.tolerance.limits:
            words = f"{kind}, {judge.lighting.name}" if kind != "cole" else kind
            part = errors.of(kind) / limit
            found.append((words, part, part * MARGINS[kind]))
    return found


def _used(axes: Axes, distinct: tuple[MaterialPlan, ...], bars: list[list[tuple[str, float, float]]]) -> None:
    place, ticks, labels, most = 0.0, [], [], 1.0
    for k, (each, own) in enumerate(zip(distinct, bars, strict=True)):
        colour = _COLOURS[k % len(_COLOURS)]
        found, choice = each.outcome, each.walk.choice
        words = "nothing in the budget" if choice is None or found is None else f"{choice.label}, {found.bytes} bytes"
        share = "" if each.material.pixels is None else f", {each.material.pixels} pixels"
        name = each.name if len(each.name) <= _MOST_LETTERS else each.name[: _MOST_LETTERS - 1] + "…"
        behind = {"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 1}
        title = f"{name}{share}: {words}"
        axes.text(0, place, title, color=colour, va="center", fontsize=8.5, fontweight="bold", bbox=behind)
        place += 1
        for label, part, with_margin in own:
            shown = [value if math.isfinite(value) else 0.0 for value in (part, with_margin)]
            axes.barh(place, shown[1], color=colour, alpha=0.3, height=0.62)
            axes.barh(place, shown[0], color=colour, height=0.62)
            ticks.append(place)
            labels.append(label)
            most = max(most, *shown)
            place += 1
    axes.axvline(1, color=_LIMIT, lw=1.2, ls="--", zorder=0)
    axes.set_xlim(0, most * 1.06)
    axes.set_ylim(place - 0.3, -0.7)
    axes.set_yticks(ticks, labels, fontsize=8)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("part of the limit that the choice uses (lighter: with the margin for other views)")
    axes.set_title("How much of its limits each choice uses", fontsize=9.5)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _short(candidate: Candidate) -> str:
    if candidate.is_colour:
        return candidate.method
    return f"{candidate.textures}×{candidate.size}²" + (" 8 bit" if candidate.storage == WHOLE else "")
