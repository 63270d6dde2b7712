"""The picture of a plan: error against bytes of the evaluated fits, and the used part of the tolerance per choice.

The left panel compares all materials: one colour per material and one marker per method, filled for floats and hollow
for 8 bits, with a name beside each point. For each material, a thin line joins the points that have a smaller error
than all points of fewer bytes. A ring marks the material's choice. The panel is left out if no material has more than
one point. The right panel has a bar for each choice, limit and lighting: the part of the limit that is used, with the
margin for other views in a lighter colour. Material and choice are named beside the bars, outside the axes.
"""

import math
import os
from collections.abc import Iterable
from textwrap import wrap
from typing import NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from homofact.figures.log_axis import log_x, log_y
from homofact.figures.point_labels import Place, PointLabel, label_points
from homofact.figures.words import in_figure
from homofact.files.atomic import replace_file
from homofact.planning.ladder import ONE_COLOUR, WHOLE, Candidate
from homofact.planning.neighbours import larger, smaller
from homofact.planning.plan import MaterialPlan, ScenePlan
from homofact.planning.search import UNTRUSTED, LadderOutcome
from homofact.planning.tolerance import MARGINS, UNLIT, WORDS

_MARKERS = {ONE_COLOUR: "o", "ggx": "D", "mccool": "s", "search": "h", "svd": "^"}
# Okabe and Ito's, which colour-blind eyes can tell apart.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#666666")
_LIMIT = "#b03030"
# A rung without error has a place on a logarithmic axis too.
_LEAST = 1e-3
# Candidates of more times the tolerance and the error of the best one are not drawn: they would hide all others.
_MOST = 1e4
# Errors whose logarithms differ by less lie on one spot of the panel.
_SAME = 0.05
_MARKER, _RING, _CROSS = 6.0, 14.0, 9.0  # across, in points
_MOST_LETTERS, _MOST_NAMES, _FEWEST_ROWS = 32, 20, 3
# Of a line of the title over two panels, and over one.
_LETTERS_WIDE, _LETTERS_NARROW = 150, 95


def plot_plan(path: str | os.PathLike[str], plan: ScenePlan) -> None:
    """Draw the panels into `path` (PNG, SVG or PDF by its ending).

    Raises BadInput where the place cannot be written.
    """
    distinct = plan.distinct
    bars = [_bars(material) for material in distinct]
    rows = sum(map(len, bars)) + 2 * len(bars)
    compared = any(len(_spots(material)) > 1 for material in distinct)
    with matplotlib.rc_context({"font.size": 9}):
        height = max(4.6 if compared else 2.0, 1.4 + 0.27 * rows)
        figure = Figure(figsize=(12.5 if compared else 8.0, height), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1)) if compared else (None, figure.subplots())
        if left is not None:
            _asked(left, distinct, any(each.tolerance.trusted for each in distinct))
        _used(right, distinct, bars)
        where = ", ".join(lighting.name for lighting in plan.scene.lightings)
        missed = sum(not each.walk.met for each in distinct)
        miss = f"; missed for {missed} of {len(distinct)}" if missed else ""
        head = f"{plan.scene.name}: {plan.tolerance_words}, under {where}{miss}."
        foot = f"{plan.bytes} bytes; {plan.fits} of {plan.exhaustive_fits} possible fits made"
        lines = wrap(f"{head} {foot}", _LETTERS_WIDE if compared else _LETTERS_NARROW)
        figure.suptitle(in_figure("\n".join(lines)), fontsize=10)
        if left is not None:
            # Labels are put where they fit, which is known once the layout is.
            figure.canvas.draw()
            figure.set_layout_engine("none")
            _name_points(figure, left, distinct)
        replace_file(path, lambda made: figure.savefig(made, dpi=120))


class _Spot(NamedTuple):
    """One or several representations of a material with equal bytes and with errors that agree within `_SAME`.

    `allowed` tells whether one of them is within the scene's budget.
    """

    candidates: tuple[Candidate, ...]
    place: tuple[float, float]
    chosen: bool
    allowed: bool

    @property
    def shown(self) -> Candidate:
        """Return the candidate whose marker represents all of them."""
        return self.candidates[0]


def _spots(plan: MaterialPlan) -> list[_Spot]:
    """Return the points (bytes, error / tolerance) of evaluated candidates that are near enough to draw.

    The choice is the first candidate of its spot.
    """
    asked = _near(plan)
    spots: list[_Spot] = []
    for candidate in sorted(asked, key=lambda key: key != plan.walk.choice):
        place = float(asked[candidate].bytes), max(asked[candidate].error, _LEAST)
        own = plan.budget.allows(asked[candidate].bytes, asked[candidate].fetches)
        for number, (candidates, known, chosen, allowed) in enumerate(spots):
            if known[0] == place[0] and abs(math.log(known[1] / place[1])) < _SAME:
                spots[number] = _Spot((*candidates, candidate), known, chosen, allowed or own)
                break
        else:
            spots.append(_Spot((candidate,), place, candidate == plan.walk.choice, own))
    return spots


def _near(plan: MaterialPlan) -> dict[Candidate, LadderOutcome]:
    """Return the evaluated candidates, except those with infinite errors or errors beyond `_MOST`."""
    most = _MOST * max(1.0, min((outcome.error for outcome in plan.walk.asked.values()), default=1.0))
    return {key: outcome for key, outcome in plan.walk.asked.items() if outcome.error <= most < math.inf}


def _undercut(spots: Iterable[_Spot]) -> list[tuple[float, float]]:
    """Return the Pareto-optimal points, sorted by bytes: no point with at most as many bytes has a smaller error."""
    kept: list[tuple[float, float]] = []
    for place in sorted(spot.place for spot in spots):
        if not kept or place[1] < kept[-1][1]:
            kept.append(place)
    return kept


def _asked(axes: Axes, distinct: tuple[MaterialPlan, ...], is_trusted: bool) -> None:
    errors, sizes, drawn, crossed = [1.0], [], dict[tuple[str, bool], None](), False
    for k, plan in enumerate(distinct):
        spots, colour = _spots(plan), _COLOURS[k % len(_COLOURS)]
        axes.plot(
            *zip(*_undercut(spot for spot in spots if spot.allowed), strict=True),
            color=colour,
            lw=0.6,
            alpha=0.5,
            zorder=1,
        )
        for spot in spots:
            hollow = spot.shown.storage == WHOLE
            face = "white" if hollow else colour
            kind = ONE_COLOUR if spot.shown.is_colour else spot.shown.family
            axes.plot(*spot.place, _MARKERS[kind], color=colour, ms=_MARKER, mfc=face, zorder=3)
            if not spot.allowed:
                axes.plot(*spot.place, "x", color=_LIMIT, ms=_CROSS, zorder=5)
                crossed = True
            drawn[kind, hollow] = None
            if spot.chosen:
                axes.plot(*spot.place, "o", ms=_RING, mfc="none", mec=colour, mew=1.8, zorder=4)
            errors.append(spot.place[1])
            sizes.append(spot.place[0])
    axes.axhline(1, color=_LIMIT, lw=1.2, ls="--", zorder=0)
    log_x(axes, min(sizes) / 2.6, max(sizes) * 2.2)
    # The key stands above the highest point.
    log_y(axes, min(errors) / 1.8, max(errors) * (max(errors) / min(errors)) ** 0.3 * 1.8, fewest=3)
    axes.set_xlabel("bytes of one material")
    trusted = f"\n(a fit that meets it but is not trusted is drawn at {UNTRUSTED:g})" if is_trusted else ""
    axes.set_ylabel(f"error divided by the tolerance, margin included{trusted}")
    far = sum(len(plan.walk.asked) - len(_near(plan)) for plan in distinct)
    beyond = f" ({far} of them, with an error above {_MOST:,.0f}, left out)" if far else ""
    axes.set_title(f"Candidates that were tried{beyond}", fontsize=9.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(handles=_key(drawn, crossed), loc="upper right", fontsize=8, framealpha=0.9, ncols=3)


def _key(drawn: Iterable[tuple[str, bool]], crossed: bool) -> list[Line2D]:
    """Return legend entries for the drawn markers (kind, hollow), the ring, the cross and the line."""
    grey = "#444444"
    return [
        *(
            Line2D(
                [], [], ls="", marker=_MARKERS[name], color=grey, ms=6, mfc="white" if hollow else grey,
                label=f"{name}, 8 bits" if hollow else name if name == ONE_COLOUR else f"{name}, floats",
            )
            for name, hollow in sorted(drawn, key=lambda entry: (list(_MARKERS).index(entry[0]), entry[1]))
        ),
        Line2D([], [], ls="", marker="o", mec=grey, mfc="none", mew=1.8, ms=11, label="chosen"),
        *([Line2D([], [], ls="", marker="x", color=_LIMIT, ms=8, label="beyond the budget")] if crossed else []),
        Line2D([], [], color=_LIMIT, ls="--", lw=1.2, label="tolerance"),
    ]  # fmt: skip


def _name_points(figure: Figure, axes: Axes, distinct: tuple[MaterialPlan, ...]) -> None:
    """Write names beside the points: always for choices, and for other points if there is room.

    If there are many points, only the choice and its neighbours in the table are named. The key explains the marker of
    the one-colour representation, so these points need no name if there are several materials.
    """
    named, paths, unnamed = list[PointLabel](), [[(x, 1.0) for x in axes.get_xlim()]], list[tuple[Place, float]]()
    few = sum(len(_spots(plan)) for plan in distinct) <= _MOST_NAMES
    for k, plan in enumerate(distinct):
        spots = _spots(plan)
        paths.append(_undercut(spots))
        beside = () if few else (smaller(plan), larger(plan))
        steps = {one.candidate for one in beside if one is not None}
        for spot in spots:
            radius = _RING / 2 + 1 if spot.chosen else _MARKER / 2
            told = spot.shown.is_colour and len(distinct) > 1
            if not spot.chosen and (told or not (few or steps & set(spot.candidates))):
                unnamed.append((spot.place, radius))
                continue
            words = ", ".join(dict.fromkeys(_short(plan.walk.kept(each)) for each in spot.candidates))
            named.append(
                PointLabel(words, spot.place, _COLOURS[k % len(_COLOURS)], spot.chosen, radius, not spot.chosen)
            )
    label_points(figure, axes, named, paths, markers=unnamed, fontsize=8)


def _bars(plan: MaterialPlan) -> list[tuple[str, float, float]]:
    """Return (words, used part of the limit, the same with its margin) for each limit and lighting."""
    bars = []
    for judge, errors in zip(plan.judges, plan.errors, strict=False):
        for kind, limit in plan.tolerance.limits:
            words = WORDS[kind] if kind in UNLIT else f"{WORDS[kind]}, {judge.lighting.name}"
            part = errors.of(kind) / limit
            bars.append((words, part, part * MARGINS[kind]))
    return bars


def _used(axes: Axes, distinct: tuple[MaterialPlan, ...], bars: list[list[tuple[str, float, float]]]) -> None:
    place, ticks, labels, most = 0.0, list[float](), list[tuple[str, str]](), 1.0
    for k, (plan, own) in enumerate(zip(distinct, bars, strict=True)):
        colour = _COLOURS[k % len(_COLOURS)]
        outcome, choice = plan.outcome, plan.walk.choice
        words = "nothing in the budget"
        if choice is not None and outcome is not None:
            words = f"{plan.walk.kept(choice).words}, {outcome.bytes} bytes"
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
    axes.axvline(1, color=_LIMIT, lw=1.2, ls="--", zorder=0)
    axes.set_xlim(0, most * 1.06)
    axes.set_ylim(max(place, _FEWEST_ROWS) - 0.3, -0.7)
    axes.set_yticks(ticks, [in_figure(words) for words, _ in labels], fontsize=8)
    for tick, (_, colour) in zip(axes.get_yticklabels(), labels, strict=True):
        if colour:
            tick.set(color=colour, fontweight="bold")
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("part of the limit that the choice uses\n(lighter: with the margin for other views)")
    axes.set_title("How much of its limits each choice uses", fontsize=9.5)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _short(candidate: Candidate) -> str:
    if candidate.is_colour:
        return ONE_COLOUR
    if candidate.lobes:
        return candidate.method
    return f"{candidate.textures}×{candidate.size}²" + (" 8 bit" if candidate.storage == WHOLE else "")
