"""The picture of a plan: per material the rungs that were asked about, error against bytes, with the choice."""

import math
import os

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from homofact.figures.log_axis import log_x, log_y
from homofact.files.atomic import replace_file
from homofact.scene.plan.plan import MaterialPlan, ScenePlan

_STYLES = {
    "constant": ("o", "#666666"),
    "lambert-9": ("D", "#999999"),
    "mccool": ("s", "#c77c2e"),
    "search": ("o", "#1f4e79"),
    "svd": ("^", "#8a4f9e"),
}
_WORDS = {"cole": "Cole error", "delta_e": "mean CIEDE2000 of the sphere", "reflected": "error of the reflected light"}
# A rung without error has a place on a logarithmic axis too.
_LEAST = 1e-5


def plot_plan(path: str | os.PathLike[str], plan: ScenePlan) -> None:
    """Draw a panel a material into `path` (PNG, SVG or PDF by its ending); error and bytes on logarithmic axes.

    Raises BadInput where the place cannot be written.
    """
    distinct = list({each.material.source: each for each in plan.materials}.values())
    columns = min(3, len(distinct))
    rows = -(-len(distinct) // columns)
    with matplotlib.rc_context({"font.size": 9}):
        figure = Figure(figsize=(4.3 * columns + 0.4, 3.5 * rows + 1.0), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, each in zip(panels, distinct, strict=False):
            _panel(axes, each)
        for axes in panels[len(distinct) :]:
            axes.set_axis_off()
        handles = {}
        for axes in panels[: len(distinct)]:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles), frameon=False)
        tolerance, lighting = plan.scene.tolerance, plan.scene.lighting
        figure.suptitle(
            f"{_WORDS[tolerance.kind]} at most {tolerance.value:g} under {lighting.name}: {plan.bytes} bytes,"
            f" {plan.planning_fits} fits of {plan.exhaustive_fits}"
        )
        replace_file(path, lambda made: figure.savefig(made, dpi=120))


def _panel(axes: Axes, each: MaterialPlan) -> None:
    asked = each.walk.asked
    places = {
        candidate: (found.bytes, max(found.error, _LEAST))
        for candidate, found in asked.items()
        if math.isfinite(found.error)
    }
    for method, (marker, colour) in _STYLES.items():
        own = [places[candidate] for candidate in places if candidate.method == method]
        if own:
            axes.plot(*zip(*own, strict=True), marker, color=colour, ms=6, label=method, zorder=3)
    labelled: list[tuple[float, float]] = []
    for candidate, place in places.items():
        # Fits that came out alike share the label of the first.
        alike = any(
            max(place[0] / other[0], other[0] / place[0]) < 2.5 and max(place[1] / other[1], other[1] / place[1]) < 1.12
            for other in labelled
        )
        if not candidate.is_colour and not alike:
            labelled.append(place)
            axes.annotate(
                f"{candidate.textures}×{candidate.size}²",
                place,
                xytext=(6, 3),
                textcoords="offset points",
                fontsize=7.5,
                color="#444444",
            )
    axes.axhline(each.tolerance.value, color="#b03030", lw=1.2, ls="--", label="tolerance", zorder=1)
    choice = each.walk.choice
    if choice in places:
        axes.plot(*places[choice], "o", ms=15, mfc="none", mec="#2e8b57", mew=2, label="chosen", zorder=4)
    errors = [error for _, error in places.values()] + [each.tolerance.value]
    sizes = [size for size, _ in places.values()]
    log_x(axes, min(sizes) / 2, max(*sizes, 200) * 4)
    log_y(axes, min(errors) / 1.8, max(errors) * 1.8, fewest=3)
    axes.set_xlabel("bytes")
    axes.set_ylabel("error")
    found = each.outcome
    words = "nothing in the budget" if choice is None or found is None else f"{choice.label}, {found.bytes} bytes"
    axes.set_title(f"{each.bench.source.name}: {words}", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
