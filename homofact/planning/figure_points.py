"""The left panel of a plan's picture: error against bytes of the candidates that were tried, for all materials.

Every material has a colour and every kind of representation a marker, filled for floats and hollow for 8 bits, with the
name that the terminal prints. Markers that would cover each other are drawn side by side. A ring marks the choice of a
material. A stepped line is its Pareto front: the smallest error that a number of bytes buys.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from homofact.evaluation.pareto import front
from homofact.figures.log_axis import log_x, log_y
from homofact.figures.point_labels import Place, PointLabel, label_points
from homofact.figures.side_by_side import side_by_side
from homofact.planning.ladder import CONSTANT, LAMBERT, ONE_COLOUR, WHOLE, Candidate
from homofact.planning.neighbours import larger, smaller
from homofact.planning.plan import MaterialPlan
from homofact.planning.search import UNTRUSTED, LadderOutcome

# Of one colour under 9 numbers of light per channel (planning.ladder), where its error is another.
NINE = f"{ONE_COLOUR}, light as 9 numbers"
_MODEL = "GGX model"
_MARKERS = {ONE_COLOUR: "o", NINE: "v", _MODEL: "D", "mccool": "s", "search": "h", "svd": "^"}
# Okabe and Ito's, which colour-blind eyes can tell apart.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#666666")
LIMIT = "#b03030"
# A rung without error has a place on a logarithmic axis too.
_LEAST = 1e-3
# Candidates of more times the tolerance and the error of the best one are not drawn: they would hide all others.
_MOST = 1e4
# Errors whose logarithms differ by less lie on one spot of the panel.
_SAME = 0.05
_MARKER, _RING, _CROSS = 6.5, 14.0, 9.0  # across, in points
_FRONT, _FAINT = 1.0, 0.5
_MOST_NAMES = 20


@dataclass(frozen=True)
class Spot:
    """One or several representations of a material with equal bytes and with errors that agree within `_SAME`.

    `names` are those of the candidates, without repetition. `allowed` tells whether one of them is within the scene's
    budget. `place` is (bytes, error / tolerance).
    """

    candidates: tuple[Candidate, ...]
    place: Place
    chosen: bool
    allowed: bool
    names: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """The kind of the candidate whose marker represents all of them, as the key names it."""
        shown = self.candidates[0]
        if shown.is_colour:
            return NINE if NINE in self.names else ONE_COLOUR
        return _MODEL if shown.lobes else shown.method

    @property
    def hollow(self) -> bool:
        """Whether the marker is hollow, for 8 bits."""
        return self.candidates[0].storage == WHOLE

    @property
    def radius(self) -> float:
        """The radius of the marker and its ring in points."""
        return (_RING + 2 if self.chosen else _MARKER + 1) / 2


def spots_of(plan: MaterialPlan) -> list[Spot]:
    """Return the spots of the evaluated candidates that are near enough to draw.

    The choice is the first candidate of its spot.
    """
    asked = _near(plan)
    spots: list[Spot] = []
    for candidate in sorted(asked, key=lambda key: key != plan.walk.choice):
        outcome = asked[candidate]
        place = float(outcome.bytes), max(outcome.error, _LEAST)
        own = plan.budget.allows(outcome.bytes, outcome.fetches)
        for number, spot in enumerate(spots):
            if spot.place[0] == place[0] and abs(math.log(spot.place[1] / place[1])) < _SAME:
                candidates = (*spot.candidates, candidate)
                spots[number] = replace(spot, candidates=candidates, allowed=spot.allowed or own)
                break
        else:
            spots.append(Spot((candidate,), place, candidate == plan.walk.choice, own))
    return [replace(spot, names=_names(plan, spot, spots)) for spot in spots]


def name_of_choice(plan: MaterialPlan, spots: Sequence[Spot]) -> str:
    """Return the name of the choice, as beside its marker, or "nothing in the budget"."""
    choice = plan.walk.choice
    if choice is None:
        return "nothing in the budget"
    chosen = (spot.names[0] for spot in spots if spot.chosen)
    return next(chosen, plan.walk.kept(choice).words)


def _names(plan: MaterialPlan, spot: Spot, spots: Sequence[Spot]) -> tuple[str, ...]:
    """Return the terminal's names; for one colour, also the way to light it if the other way is another spot."""
    here = {candidate.method for candidate in spot.candidates}
    every = {candidate.method for each in spots for candidate in each.candidates}
    apart = LAMBERT in here and CONSTANT in every - here
    words = (NINE if apart and each.method == LAMBERT else plan.walk.kept(each).words for each in spot.candidates)
    return tuple(dict.fromkeys(words))


def _near(plan: MaterialPlan) -> dict[Candidate, LadderOutcome]:
    """Return the evaluated candidates, except those with infinite errors or errors beyond `_MOST`."""
    most = _MOST * max(1.0, min((outcome.error for outcome in plan.walk.asked.values()), default=1.0))
    return {key: outcome for key, outcome in plan.walk.asked.items() if outcome.error <= most < math.inf}


def frame_points(
    axes: Axes, distinct: Sequence[MaterialPlan], groups: Sequence[Sequence[Spot]], is_trusted: bool
) -> None:
    """Set up axes, title and key for the spots of all materials, a group per material."""
    spots = list(chain.from_iterable(groups))
    sizes, errors = [spot.place[0] for spot in spots], [1.0, *(spot.place[1] for spot in spots)]
    axes.axhline(1, color=LIMIT, lw=1.2, ls="--", zorder=0)
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
    tight = {"columnspacing": 1.2, "handletextpad": 0.5, "handlelength": 1.6}
    axes.legend(handles=_key(spots), loc="upper right", fontsize=8, framealpha=0.9, ncols=3, **tight)


def _key(spots: Iterable[Spot]) -> list[Line2D]:
    """Return legend entries for the markers of the spots, the ring, the cross and the lines."""
    grey, kinds = "#444444", list(_MARKERS)
    drawn = sorted({(kinds.index(spot.kind), spot.hollow) for spot in spots})
    entries = [_marker(kinds[number], hollow, grey, _kind_words(kinds[number], hollow)) for number, hollow in drawn]
    entries.append(Line2D([], [], ls="", marker="o", mec=grey, mfc="none", mew=1.8, ms=11, label="chosen"))
    if not all(spot.allowed for spot in spots):
        entries.append(Line2D([], [], ls="", marker="x", color=LIMIT, ms=8, label="beyond the budget"))
    return [
        *entries,
        Line2D([], [], color=grey, lw=_FRONT, alpha=_FAINT, label="smallest error for the bytes"),
        Line2D([], [], color=LIMIT, ls="--", lw=1.2, label="tolerance"),
    ]


def _kind_words(kind: str, hollow: bool) -> str:
    textures = kind not in (ONE_COLOUR, NINE, _MODEL)
    return f"{kind}, {'8 bits' if hollow else 'floats'}" if textures else kind


def _marker(kind: str, hollow: bool, colour: str, label: str = "") -> Line2D:
    # A white rim, put on from outside, parts filled markers that touch.
    face, edge, size = ("white", colour, _MARKER) if hollow else (colour, "white", _MARKER + 1.5)
    return Line2D([], [], ls="", marker=_MARKERS[kind], ms=size, mfc=face, mec=edge, mew=1, label=label)


def draw_points(figure: Figure, axes: Axes, distinct: Sequence[MaterialPlan], spots: Sequence[Sequence[Spot]]) -> None:
    """Draw lines, markers and names. The layout of the figure has to be final, since markers make room by its points.

    Names are always written for choices, and for other spots if there is room. If there are many spots, only the
    choice and its neighbours in the table are named, without the method, which the marker shows. Then one colour has no
    name if there are several materials, since the key explains its marker.
    """
    groups = _drawn(axes, figure.dpi / 72, spots)
    few = sum(map(len, groups)) <= _MOST_NAMES
    named, others, paths = list[PointLabel](), list[tuple[Place, float]](), [[(x, 1.0) for x in axes.get_xlim()]]
    for k, (plan, placed) in enumerate(zip(distinct, groups, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        paths.append(_front_line(axes, placed, colour))
        beside = () if few else (smaller(plan), larger(plan))
        steps = {one.candidate for one in beside if one is not None}
        for spot, at in placed:
            _draw(axes, spot, at, colour)
            told = spot.candidates[0].is_colour and len(distinct) > 1
            if spot.chosen or few or (not told and steps & set(spot.candidates)):
                names = spot.names if few else [name.partition(" (")[0] for name in spot.names]
                words = " or\n".join(dict.fromkeys(names))
                named.append(PointLabel(words, at, colour, spot.chosen, spot.radius, not spot.chosen))
            else:
                others.append((at, spot.radius))
    label_points(figure, axes, named, paths, markers=others, fontsize=8)


def _drawn(axes: Axes, scale: float, groups: Sequence[Sequence[Spot]]) -> list[list[tuple[Spot, Place]]]:
    """Return the spots of every material with the places of their markers, choices at their own."""
    order = sorted((not spot.chosen, *spot.place, k, n) for k, own in enumerate(groups) for n, spot in enumerate(own))
    spots = [groups[k][n] for *_, k, n in order]
    pixels = axes.transData.transform([spot.place for spot in spots])
    moves = side_by_side([(x / scale, y / scale) for x, y in pixels.tolist()], [spot.radius for spot in spots])
    back = axes.transData.inverted()
    places = {}
    for (*_, k, n), (x, y), move in zip(order, pixels.tolist(), moves, strict=True):
        left, error = back.transform((x + move * scale, y))
        places[k, n] = (float(left), float(error)) if move else groups[k][n].place
    if any(moves):
        axes.set_xlabel("bytes of one material (markers that would overlap are drawn side by side)")
    return [[(spot, places[k, n]) for n, spot in enumerate(own)] for k, own in enumerate(groups)]


def _front_line(axes: Axes, spots: Sequence[tuple[Spot, Place]], colour: str) -> list[Place]:
    """Draw the Pareto front of the spots within the budget, and return its corners."""
    allowed = [(spot, at) for spot, at in spots if spot.allowed]
    on = [allowed[i][1] for i in front([spot.place for spot, _ in allowed])]
    corners = on[:1]
    for x, y in on[1:]:
        corners += [(x, corners[-1][1]), (x, y)]
    axes.plot(*zip(*corners, strict=True), color=colour, lw=_FRONT, alpha=_FAINT, zorder=1)
    return corners


def _draw(axes: Axes, spot: Spot, at: Place, colour: str) -> None:
    marker = _marker(spot.kind, spot.hollow, colour)
    marker.set_data([at[0]], [at[1]])
    marker.set_zorder(3)
    axes.add_line(marker)
    if not spot.allowed:
        axes.plot(*at, "x", color=LIMIT, ms=_CROSS, zorder=5)
    if spot.chosen:
        axes.plot(*at, "o", ms=_RING, mfc="none", mec=colour, mew=1.8, zorder=4)
