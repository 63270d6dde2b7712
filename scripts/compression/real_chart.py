"""Draw error against bytes for the real measurements, as medians over the RGL files."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median

from matplotlib.figure import Figure

from homofact.figures.log_axis import log_y
from homofact.files.atomic import replace_file

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_charts import OURS as OURS_COLOUR
from scripts.compression.compression_charts import PUBLISHED_COLOUR, REST
from scripts.compression.real_fits import BOUND, LABELS, OURS, PUBLISHED, RAW, RGL, STRAIGHT
from scripts.compression.real_tables import Row, Table

_APART, _WIDE = 10.0, 100.0  # points: how far labels keep from each other, and how long they are at most
_PANELS = (("MALE", "MALE, less is better"), ("PSNR, St Peter's", "PSNR under St Peter's [dB], more is better"))


def _groups() -> list[tuple[str, list[str]]]:
    """Methods that a line joins, by what they are called."""
    rest = [label for label in LABELS if label not in (*OURS, BOUND) and not label.startswith("SVD")]
    joined: dict[str, list[str]] = {}
    for label in rest:
        name = label if "," in label else label.split()[0]
        joined.setdefault(name, []).append(label)
    return list(joined.items())


def draw(path: Path, rows: Iterable[Row]) -> None:
    """Draw MALE and PSNR against bytes: rivals of the raw files, ours raw and straightened."""
    table = Table(rows)
    names = table.materials(RGL)
    chart = Figure(figsize=(10.4, 4.2), layout="constrained")
    for axis, (name, words) in zip(chart.subplots(1, len(_PANELS)), _PANELS, strict=True):
        ends = []
        for title, labels in _groups():
            colour = PUBLISHED_COLOUR if labels[0] in PUBLISHED else REST
            ends += _line(axis, table, names, RAW, labels, name, title, colour)
        ends += _line(axis, table, names, RAW, OURS, name, "ours, raw", OURS_COLOUR, "o--")
        ends += _line(axis, table, names, STRAIGHT, OURS, name, "ours, straightened", OURS_COLOUR)
        bound = table.values(names, RAW, BOUND, name)
        if bound:
            axis.axhline(median(bound), color=REST, linewidth=0.8, linestyle=(0, (1, 3)))
            axis.annotate(
                "bound: measurement made reciprocal", (0.01, median(bound)), xycoords=axis.get_yaxis_transform(),
                xytext=(0, 3), textcoords="offset points", fontsize=8, color=REST,
            )  # fmt: skip
        axis.set_xscale("log")
        axis.set_xlabel("bytes per material")
        axis.set_ylabel(words)
        axis.margins(x=0.25, y=0.15)
        axis.spines[["top", "right"]].set_visible(False)
        if name == "MALE":
            log_y(axis, *axis.get_ylim())
        _label(axis, ends)
    chart.suptitle(
        f"Medians over {len(names)} RGL files; ours fitted to raw and to straightened measurements, all others to raw",
        fontsize=10,
    )
    replace_file(path, lambda made: chart.savefig(made, dpi=110, format="png"))


def _line(
    axis, table: Table, names: Sequence[str], way: str, labels: Sequence[str], name: str, title: str, colour: str,
    style: str = "o-",
) -> list[tuple[float, float, str, str]]:  # fmt: skip
    """Draw a line; where it ends, its title and its colour, for a label."""
    points = []
    for label in labels:
        values = table.values(names, way, label, name)
        if values:
            points.append((median(table.values(names, way, label, "bytes", "cost")), median(values)))
    if not points:
        return []
    axis.plot(*zip(*points, strict=True), style, color=colour, linewidth=1, markersize=4)
    return [(*points[-1], title, colour)]


def _label(axis, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Write the titles beside their ends, one above the other where they would touch."""
    taken: list[tuple[float, float]] = []
    points = 72 / axis.figure.dpi
    axis.figure.draw_without_rendering()
    for x, y, title, colour in sorted(ends, key=lambda end: axis.transData.transform(end[:2])[1]):
        across, up = axis.transData.transform((x, y)) * points
        shift = 0.0
        while any(abs(across - other) < _WIDE and abs(up + shift - height) < _APART for other, height in taken):
            shift += 1.0
        taken.append((across, up + shift))
        axis.annotate(
            title, (x, y), xytext=(6, shift), textcoords="offset points", fontsize=8, color=colour, va="center"
        )
