"""Draw the figures of the study of small textures as PDF files of column width."""

import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from homofact.files.atomic import replace_file

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.real_fits import BOUND, OURS, PUBLISHED, RAW, RGL, STRAIGHT
from scripts.papers.small_results import FACTORED_TERMS, GLOSSY, SLICE_DEGREES, Results
from scripts.papers.small_tables import named
from scripts.speed.error_against_time import WAYS

COLUMN = 3.33  # inches
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#777777"
STYLE: Any = {
    "font.size": 7.5, "axes.titlesize": 7.5, "legend.fontsize": 6.8, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "axes.linewidth": 0.6, "lines.linewidth": 1.0, "axes.spines.top": False, "axes.spines.right": False,
    "pdf.fonttype": 42, "font.family": "DejaVu Sans",
}  # fmt: skip


def tilted(results: Results) -> Figure:
    """A highlight in the plane of incidence, as measured and swapped, before and after the tilt is undone."""
    drawn = Figure(figsize=(COLUMN, 2.9), layout="constrained")
    panels = drawn.subplots(2, len(SLICE_DEGREES), sharex=True)
    for column, degrees in enumerate(SLICE_DEGREES):
        for row, kind in enumerate(("raw", "straightened")):
            axes, found = panels[row][column], results.slices[f"{kind} {degrees:g}"]
            axes.plot(found["offset"], found["measured"], color=BLUE, label=r"$f(\omega_i,\omega_o)$")
            axes.plot(found["offset"], found["swapped"], "--", color=ORANGE, label=r"$f(\omega_o,\omega_i)$")
            axes.set_title(rf"{kind}, $\theta_i = {degrees:g}^\circ$")
            axes.set_ylim(bottom=0)
    for row in range(2):
        panels[row][0].set_ylabel(r"f [sr$^{-1}$]")
    drawn.supxlabel("viewer's angle from the mirror direction [°]", fontsize=7.5)
    drawn.legend(*panels[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    return drawn


def floors(results: Results) -> Figure:
    """The floor of a reciprocal fit before and after straightening, a file a line, and the error of the larger fit."""
    drawn = Figure(figsize=(COLUMN, 2.5), layout="constrained")
    axes = drawn.subplots()
    rows = [(name, row) for name, row in results.straightening.items() if row["tilt"]["undone"]]
    for height, (_, row) in enumerate(rows):
        found = row["fits"]["3 × 32²"]
        before, after = found["straight"]["raw floor"], found["straight"]["floor"]
        axes.plot((before, after), (height, height), color=GREY, linewidth=0.8)
        first = height == 0
        axes.plot(before, height, "o", color=ORANGE, markersize=4.5, label="floor, raw" if first else None)
        axes.plot(after, height, "o", color=BLUE, markersize=4.5, label="floor, straightened" if first else None)
        for kind, colour in (("raw", ORANGE), ("straight", BLUE)):
            label = f"fit to {'raw' if kind == 'raw' else 'straightened'}"
            error = found[kind]["straight"]
            axes.plot(error, height, "x", color=colour, markersize=5, label=label if first else None)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.invert_yaxis()
    axes.set(xlim=(0, None), xlabel=r"relative RMS of $f\cos\theta_i\cos\theta_o$")
    axes.grid(axis="x", linewidth=0.3)
    drawn.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return drawn


def against_bytes(results: Results) -> Figure:
    """MALE and PSNR against bytes: medians over the RGL files."""
    drawn = Figure(figsize=(COLUMN, 4.4), layout="constrained")
    table, names = results.search, results.search.materials(RGL)
    singles = {
        "NBRDF, published": "v", "NBRDF, trained here": "^", "hybrid, published": "P", "NPF, fitted here": "X",
        "GGX × 1": "s", "GGX × 2": "D",
    }  # fmt: skip

    def point(label: str, way: str, name: str) -> tuple[float, float]:
        places = (("bytes", "cost"), (name, "own"))
        bytes_, value = (statistics.median(table.values(names, way, label, key, of)) for key, of in places)
        return bytes_, value

    panels = drawn.subplots(2, 1, sharex=True)
    for axes, name, title in zip(
        panels, ("MALE", "PSNR, St Peter's"), ("MALE", "PSNR under St Peter's [dB]"), strict=True
    ):
        for label, shape in singles.items():
            inside, width = ("none", 8) if label in PUBLISHED else ("full", 4.5)
            axes.plot(*point(label, RAW, name), shape, color=GREY, markersize=width, fillstyle=inside, label=label)
        axes.plot(*zip(*(point(f"McCool {size}", RAW, name) for size in ("3 KiB", "12 KiB")), strict=True),
                  "<-", color=GREEN, markersize=4, label="McCool")  # fmt: skip
        for way, colour, style in ((RAW, ORANGE, "o--"), (STRAIGHT, BLUE, "o-")):
            line = zip(*(point(label, way, name) for label in OURS), strict=True)
            axes.plot(*line, style, color=colour, markersize=4, label=f"homofact, {way}")
        bound = statistics.median(table.values(names, RAW, BOUND, name))
        axes.axhline(bound, color=GREY, linewidth=0.7, linestyle=":", label=BOUND)
        axes.set(xscale="log", ylabel=title)
        axes.grid(linewidth=0.3)
    panels[0].set_yscale("log")
    _plain(panels[0], (0.002, 0.003, 0.005, 0.01))
    panels[1].set_xlabel("bytes per material")
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return drawn


def against_time(results: Results) -> Figure:
    """Cole error and RMS against processor seconds: a small point a material, their median large."""
    drawn = Figure(figsize=(COLUMN, 4.4), layout="constrained")
    panels = drawn.subplots(2, 1, sharex=True)
    titles = {"error": "Cole error, held out", "rms": r"RMS of $f\cos\theta_i\cos\theta_o$"}
    for axes, (key, title) in zip(panels, titles.items(), strict=True):
        for way, (_, _, colour, shape) in WAYS.items():
            figures = [each[way] for each in results.time.values()]
            times, errors = [each["seconds"] for each in figures], [each[key] for each in figures]
            axes.plot(times, errors, shape, color=colour, markersize=2.5, alpha=0.4)
            middle = statistics.median(times), statistics.median(errors)
            axes.plot(*middle, shape, color=colour, markersize=6.5, markeredgecolor="black", markeredgewidth=0.6,
                      label=named(way))  # fmt: skip
        axes.set(xscale="log", yscale="log", ylabel=title)
        axes.grid(linewidth=0.3)
        _plain(axes, (0.03, 0.1, 0.2, 0.3, 0.5, 1, 2, 5))
    _plain(panels[1], (0.1, 0.3, 1, 3, 10, 30, 100), axis="x")
    panels[1].set_xlabel("processor time of a fit [s]")
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return drawn


def relit(results: Results) -> Figure:
    """The picture's error under each sky, with a separate lobe and with in-out factors alone."""
    drawn = Figure(figsize=(COLUMN, 1.4 + 0.62 * len(GLOSSY)), layout="constrained")
    panels = drawn.subplots(len(GLOSSY), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, GLOSSY, strict=True):
        for terms, colour, shape in ((FACTORED_TERMS, ORANGE, "s"), (None, BLUE, "o")):
            row = results.relit(name, terms)
            way = f"{row['terms']:.0f} in-out terms" if terms else "separate lobe"
            errors = row["errors"]
            axes.plot([100 * each for each in errors.values()], list(errors), shape, color=colour, markersize=4,
                      label=way)  # fmt: skip
        axes.set_title(name)
        axes.set_xscale("log")
        axes.grid(axis="x", linewidth=0.3)
        axes.margins(y=0.15)
        axes.tick_params(axis="y", labelsize=6)
    _plain(panels[-1], (1, 3, 10, 30, 100, 1000), axis="x")
    panels[-1].set_xlabel(r"relative RMS of the picture [%]")
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return drawn


def _plain(axes: Axes, ticks: tuple[float, ...], axis: str = "y") -> None:
    """Ticks with plain numbers on a logarithmic axis."""
    chosen = axes.yaxis if axis == "y" else axes.xaxis
    chosen.set_major_locator(FixedLocator(ticks))
    chosen.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    chosen.set_minor_locator(NullLocator())


FIGURES: dict[str, Callable[[Results], Figure]] = {
    "tilted": tilted,
    "floors": floors,
    "against_bytes": against_bytes,
    "against_time": against_time,
    "relit": relit,
}


def save(name: str, results: Results, path: Path) -> None:
    """Draw a figure and write it as PDF or PNG by the name of the file; the same results give the same bytes."""
    metadata = {"CreationDate": None} if path.suffix == ".pdf" else {}
    with matplotlib.rc_context(STYLE):
        drawn = FIGURES[name](results)
        replace_file(path, lambda made: drawn.savefig(made, dpi=220, metadata=metadata))
