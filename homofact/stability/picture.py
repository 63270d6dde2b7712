"""The atlas as two pictures: methods × stressors × strengths, and solvers × systems.

The colours differ in lightness, so people with any colour vision can tell them apart: light blue (ok), yellow to brown
(degraded, by the factor) and black (silently wrong). A cell without a factor has a letter or sign on grey, white or
hatching.
"""

import math
import os
from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle

from homofact.files.atomic import replace_file
from homofact.stability.atlas import Atlas
from homofact.stability.cells import DEGRADED, WRONG, Cell, CellOutcome
from homofact.stability.solver_atlas import AGREES, WELL_POSED, SolverCell, SolverOutcome
from homofact.stability.stressors import stressor

# Of a factor's logarithm, from 1 to the last that the scale tells apart.
_SCALE = LinearSegmentedColormap.from_list("factor", ["#ffffff", "#fff2b3", "#f6c35c", "#c97b1c", "#8a4513"])
_TOP = 1000.0
_LEGEND_WIDTH = 4.1  # inches that its longest entry takes
_OK, _GREY, _BLACK = "#dcebf7", "#b9bcc2", "#000000"
_OUTSIDE, _WITHDRAWN = "#d1495b", "#8d99ae"
_SHOWN = {CellOutcome.REFUSED: "R", CellOutcome.NONE: "–", CellOutcome.ABSENT: "?", CellOutcome.CRASHED: "×"}


def short_number(value: float) -> str:
    """Return a factor in at most four characters: 0.4, 2.3, 31, 1e5."""
    if value < 0.095:
        return "<.1"
    if value < 9.95:
        return f"{value:.1f}"
    return f"{value:.0f}" if value < 999.5 else f"1e{round(math.log10(value))}"


def draw_atlas(path: str | os.PathLike[str], atlas: Atlas, base: Mapping[str, Any]) -> None:
    """Draw the heat map of the fits to `path` (PNG, SVG or PDF, by its extension)."""
    methods, names = atlas.plan.methods, atlas.plan.stressors
    widest = max(len(atlas.of(name, methods[0])) for name in names)
    wide = len(methods) * (widest + 0.5)
    across = 5.6 + 0.41 * wide
    figure = Figure(figsize=(across, 2.6 + 0.3 * len(names)), layout="constrained")
    axes = figure.subplots()
    for row, name in enumerate(names):
        for column, method in enumerate(methods):
            for place, cell in enumerate(atlas.of(name, method)):
                _cell(axes, column * (widest + 0.5) + place, row, cell)
    axes.set_xlim(-0.1, wide - 0.4)
    axes.set_ylim(len(names) + 0.05, -0.1)
    middles = [column * (widest + 0.5) + widest / 2 for column in range(len(methods))]
    axes.set_xticks(middles, methods, fontsize=12, fontweight="bold")
    axes.xaxis.tick_top()
    axes.set_yticks([row + 0.5 for row in range(len(names))], [_row_name(atlas, name) for name in names], fontsize=9)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    columns = max(1, int(across / _LEGEND_WIDTH))
    figure.legend(
        handles=_legend(), loc="outside lower center", ncols=columns, frameon=False, fontsize=9, handlelength=1.6
    )
    figure.suptitle(
        "Where fits fail: error on clean samples, as a factor of the same method's without stress"
        f" ({base['textures']} textures of {base['size']}²,"
        f" {atlas.plan.scale.samples} samples)",
        fontsize=12,
    )
    replace_file(path, lambda made: figure.savefig(made, dpi=110))


def _row_name(atlas: Atlas, name: str) -> str:
    stress = stressor(name)
    labels = [stress.label(strength) for strength in atlas.plan.strengths(stress)]
    span = labels[0] if len(labels) == 1 else f"{labels[0]} … {labels[-1]}"
    return f"{stress.title}  [{span}]"


def _cell(axes: Axes, x: float, y: float, cell: Cell) -> None:
    fill, ink, text = _look(cell)
    hatch = "////" if cell.outcome is CellOutcome.CRASHED else None
    edge = "#777777" if hatch else "white"
    axes.add_patch(Rectangle((x, y), 0.96, 0.92, facecolor=fill, edgecolor=edge, hatch=hatch, linewidth=0.4))
    weight = "bold" if cell.new or cell.outcome in (CellOutcome.SILENT, CellOutcome.CRASHED) else "normal"
    axes.text(x + 0.48, y + 0.46, text, ha="center", va="center", fontsize=7.5, color=ink, fontweight=weight)
    if cell.new:
        axes.add_patch(Rectangle((x, y + 0.78), 0.96, 0.14, facecolor="#1f4e79", linewidth=0))
    if cell.factor is not None and cell.held is not True and cell.outcome is not CellOutcome.CRASHED:
        colour = _OUTSIDE if cell.held is False else _WITHDRAWN
        axes.add_patch(Polygon([(x + 0.68, y), (x + 0.96, y), (x + 0.96, y + 0.34)], facecolor=colour, linewidth=0))


def _look(cell: Cell) -> tuple[str, str, str]:
    """(fill, ink, text) of a cell."""
    if cell.factor is None or cell.outcome in (CellOutcome.CRASHED, CellOutcome.REFUSED):
        empty = cell.outcome in (CellOutcome.NONE, CellOutcome.ABSENT)
        fill = "white" if empty or cell.outcome is CellOutcome.CRASHED else _GREY
        return fill, "#9a9a9a" if empty else "black", _SHOWN[cell.outcome]
    text = short_number(cell.factor)
    if cell.outcome is CellOutcome.SILENT:
        return _BLACK, "white", text
    if cell.factor <= DEGRADED:
        return _OK, "black", text
    share = min(math.log(cell.factor / 1.2) / math.log(_TOP / 1.2), 1.0)
    red, green, blue, _ = _SCALE(share)
    light = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    fill = "#" + "".join(f"{round(255 * part):02x}" for part in (red, green, blue))
    return fill, "white" if light < 0.5 else "black", text


def _legend() -> list[Patch]:
    def shade(factor: float) -> str:
        return _look(Cell("", "", 0.0, "", CellOutcome.DEGRADED, factor=factor))[0]

    edge = {"edgecolor": "#888888", "linewidth": 0.5}
    return [
        Patch(facecolor=_OK, label=f"at most {DEGRADED:g} times the unstressed error", **edge),
        Patch(facecolor=shade(3), label="degraded: 3 times", **edge),
        Patch(facecolor=shade(30), label="degraded: 30 times", **edge),
        Patch(facecolor=shade(_TOP), label=f"degraded: {_TOP:g} times and more", **edge),
        Patch(facecolor="#1f4e79", label="blue foot, bold: the fit's verdict warns", **edge),
        Patch(facecolor=_OUTSIDE, label="red corner: true albedo error outside the error bar", **edge),
        Patch(facecolor=_WITHDRAWN, label="grey corner: no error bar stated", **edge),
        Patch(facecolor=_GREY, label="R: refused, with a named error", **edge),
        Patch(facecolor=_BLACK, label=f"black: silently wrong (over {WRONG:g} times, no warning)", **edge),
        Patch(facecolor="white", hatch="////", label="×: crashed      – : not for this method", **edge),
    ]


def draw_solvers(path: str | os.PathLike[str], cells: list[SolverCell]) -> None:
    """Draw the solvers' differences to the minimum-norm solutions; the colour shows agreement or a warning."""
    systems = list(dict.fromkeys(cell.system for cell in cells))
    systems.sort(key=lambda name: next(cell.condition for cell in cells if cell.system == name))
    solvers = list(dict.fromkeys(cell.solver for cell in cells))
    figure = Figure(figsize=(9.5, 2.2 + 0.34 * len(systems)), layout="constrained")
    axes = figure.subplots()
    for cell in cells:
        x, y = solvers.index(cell.solver), systems.index(cell.system)
        fill, ink = _solver_look(cell)
        axes.add_patch(Rectangle((x, y), 0.97, 0.93, facecolor=fill, edgecolor="white"))
        text = "none" if cell.difference is None else f"{cell.difference:.0e}"
        words = {SolverOutcome.SAYS_SO: f"{text} ({cell.status})", SolverOutcome.CRASHED: "crashed"}
        axes.text(x + 0.48, y + 0.47, words.get(cell.answer, text), ha="center", va="center", fontsize=9, color=ink)
    conditions = {cell.system: cell.condition for cell in cells}
    axes.set_xlim(0, len(solvers))
    axes.set_ylim(len(systems), -0.05)
    axes.set_xticks([x + 0.5 for x in range(len(solvers))], solvers, fontsize=11, fontweight="bold")
    axes.xaxis.tick_top()
    axes.set_yticks(
        [y + 0.5 for y in range(len(systems))], [f"{name}  [{conditions[name]:.0e}]" for name in systems], fontsize=9
    )
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    well = sum(conditions[name] <= WELL_POSED for name in systems)
    axes.axhline(well - 0.03, color="#444444", linewidth=1, linestyle="--")
    handles = [
        Patch(facecolor=_OK, edgecolor="#888888", label="agrees with the minimum-norm answer"),
        Patch(facecolor="#f6c35c", edgecolor="#888888", label="differs, and its status warns"),
        Patch(facecolor=_BLACK, edgecolor="#888888", label="silently differs"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.suptitle(
        "Linear solvers: relative difference to the minimum-norm answer\n"
        f"[condition number of the normal matrix]; above the line well posed, to agree to {AGREES:.0e}",
        fontsize=11,
    )
    replace_file(path, lambda made: figure.savefig(made, dpi=110))


def _solver_look(cell: SolverCell) -> tuple[str, str]:
    if cell.answer is SolverOutcome.AGREES:
        return _OK, "black"
    return ("#f6c35c", "black") if cell.answer is SolverOutcome.SAYS_SO else (_BLACK, "white")
