"""Draw the comparison's error against bytes and speed, judged by proxies that a method was not fitted to.

Methods that homofact fits are shown as fitted to one proxy, nbrdf.
"""

import statistics
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from homofact.figures.log_axis import log_y
from homofact.files.atomic import replace_file

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import METHODS, READINGS, Entry
from scripts.compression.compression_speed import median_of
from scripts.data.published_fits import PUBLISHED

OF = READINGS[:1]
OURS, PUBLISHED_COLOUR, REST = "#1f4e79", "#b2521b", "#777777"
# Where a label stands beside its point, in points, for those that would lie over another.
_PLACES = {
    "nbrdf": (-16, -16),
    "npf": (-25, -4),
    "nps": (6, 7),
    "ours": (8, 6),
    "abc": (7, 3),
    "GGX": (7, -11),
    "McCool": (-6, 8),
    "sgd": (6, 5),
}


def draw(path: Path, found: Sequence[Entry], speeds: list[dict[str, str]]) -> None:
    """PSNR and MALE, judged by what a method was not fitted to, against bytes and (where timed) against speed."""
    judged = [e for e in found if e.by not in e.readings and e.readings == ((e.label,) if e.label in PUBLISHED else OF)]

    def nbytes(label: str) -> float | None:
        return statistics.median(e.shown.nbytes for e in judged if e.label == label)

    columns: list[tuple[str, Callable[[str], float | None]]] = [("bytes per material", nbytes)]
    if speeds:
        columns.append(("millions of evaluations a second, one thread", lambda label: median_of(speeds, label)))
    chart = Figure(figsize=(5.2 * len(columns), 8.2), layout="constrained")
    panels = chart.subplots(2, len(columns), squeeze=False, sharey="row")
    for row, name in zip(panels, ("PSNR", "MALE"), strict=True):
        for axis, (words, place) in zip(row, columns, strict=True):
            _panel(axis, judged, name, place)
            axis.set_xscale("log")
            axis.set_xlabel(words)
            axis.margins(x=0.2, y=0.15)
            axis.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel("PSNR of the spheres [dB], more is better" if name == "PSNR" else "MALE, less is better")
    low, high = panels[1, 0].get_ylim()
    for axis in panels[1]:
        log_y(axis, low, high)
    words = f"Median over materials, judged by proxies that a method was not fitted to\n(ours, GGX, McCool: to {OF[0]})"
    chart.suptitle(words, fontsize=10)
    replace_file(path, lambda made: chart.savefig(made, dpi=110, format="png"))


def _panel(axis, judged: Sequence[Entry], name: str, place: Callable[[str], float | None]) -> None:
    groups = [[label] for label in PUBLISHED]
    groups += [[label for label in METHODS if label.split()[0] == first] for first in ("GGX", "McCool", "ours")]
    for labels in groups:
        points = []
        for label in labels:
            values = [e.scores[name] for e in judged if e.label == label]
            x = place(label) if values else None
            if x is not None:
                points.append((x, statistics.median(values)))
        if not points:
            continue
        first = labels[0].split()[0]
        colour = OURS if first == "ours" else PUBLISHED_COLOUR if first in PUBLISHED else REST
        axis.plot(*zip(*points, strict=True), "o-", color=colour, linewidth=1)
        words = "nps (decoder of 4 MB)" if first == "nps" else first
        axis.annotate(
            words, points[0], xytext=_PLACES.get(first, (6, 5)), textcoords="offset points", fontsize=9, color=colour
        )
