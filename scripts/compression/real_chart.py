"""The chart of the real measurements: error against bytes, medians over the RGL files."""

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
        for title, labels in _groups():
            colour = PUBLISHED_COLOUR if labels[0] in PUBLISHED else REST
            _line(axis, table, names, RAW, labels, name, title, colour)
        _line(axis, table, names, RAW, OURS, name, "ours, raw", OURS_COLOUR, "o--")
        _line(axis, table, names, STRAIGHT, OURS, name, "ours, straightened", OURS_COLOUR)
        axis.set_xscale("log")
        axis.set_xlabel("bytes per material")
        axis.set_ylabel(words)
        axis.margins(x=0.25, y=0.15)
        axis.spines[["top", "right"]].set_visible(False)
        if name == "MALE":
            log_y(axis, *axis.get_ylim())
    chart.suptitle(f"Median over {len(names)} RGL files", fontsize=10)
    replace_file(path, lambda made: chart.savefig(made, dpi=110, format="png"))


def _line(
    axis, table: Table, names: Sequence[str], way: str, labels: Sequence[str], name: str, title: str, colour: str,
    style: str = "o-",
) -> None:  # fmt: skip
    points = []
    for label in labels:
        values = table.values(names, way, label, name)
        if values:
            points.append((median(table.values(names, way, label, "bytes", "cost")), median(values)))
    if points:
        axis.plot(*zip(*points, strict=True), style, color=colour, linewidth=1, markersize=4)
        axis.annotate(title, points[-1], xytext=(6, 4), textcoords="offset points", fontsize=8, color=colour)
