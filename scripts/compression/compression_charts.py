"""Draw the comparison's error against bytes and speed, judged by proxies that a method was not fitted to.

    python scripts/compression/compression_charts.py [--page docs/compression.md] [--plot docs/pictures/compression.png]

Methods that homofact fits are shown as fitted to one proxy, nbrdf. The program draws the picture again from the tables
of the page, which have its medians in three digits; `compression_table.py --plot` draws it from the fits.
"""

import re
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from homofact.errors import BadInput
from homofact.figures.log_axis import log_y
from homofact.files.atomic import replace_file

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import METHODS, READINGS, Entry
from scripts.compression.compression_speed import median_of
from scripts.data.published_fits import PUBLISHED
from scripts.shared.harness import parser_of

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
    "McCool, PSNR": (7, -13),
    "McCool, MALE": (7, 5),
    "sgd": (6, 5),
}
_DOCS = Path(__file__).resolve().parents[2] / "docs"
_PAGE, _PICTURE = _DOCS / "compression.md", _DOCS / "pictures" / "compression.png"


@dataclass(frozen=True)
class Point:
    """Medians over the materials of one method: bytes, millions of evaluations per second (None: not timed), errors."""

    label: str
    nbytes: float
    speed: float | None
    psnr: float
    male: float


def points_of(found: Sequence[Entry], speeds: list[dict[str, str]]) -> list[Point]:
    """The medians of what was fitted, judged by what a method was not fitted to."""
    judged = [e for e in found if e.by not in e.readings and e.readings == ((e.label,) if e.label in PUBLISHED else OF)]
    points = []
    for label in (*PUBLISHED, *METHODS):
        own = [e for e in judged if e.label == label]
        if own:
            psnr, male = (statistics.median(e.scores[name] for e in own) for name in ("PSNR", "MALE"))
            nbytes = statistics.median(e.shown.nbytes for e in own)
            points.append(Point(label, nbytes, median_of(speeds, label), psnr, male))
    return points


def points_of_page(text: str) -> list[Point]:
    """The medians in the tables of the page. Raises BadInput where a table or one of its numbers is missing."""
    errors = _table(text, ("method", "bytes", "MALE", "PSNR"), "nbrdf")
    fitted = _table(text, ("", "MALE", "PSNR"), f"{OF[0]} itself")
    speeds = _table(text, ("method", "M/s"), "nbrdf")
    points = []
    for label in (*PUBLISHED, *METHODS):
        row = errors.get(label) if label in PUBLISHED else fitted.get(f"{label} of {OF[0]}")
        if row is not None and (label in PUBLISHED or label.split()[0] in ("GGX", "McCool", "ours")):
            speed = speeds.get(label, {}).get("M/s")
            points.append(Point(label, errors[label]["bytes"], speed, row["PSNR"], row["MALE"]))
    return points


def _table(text: str, columns: Sequence[str], first: str) -> dict[str, dict[str, float]]:
    """The numbers of these columns by the first one, of the first table with a row `first`. Raises BadInput."""
    for head, rows in _tables(text):
        if set(columns) <= set(head) and any(row[0] == first for row in rows):
            places = {name: head.index(name) for name in columns[1:]}
            return {row[0]: {name: float(row[place].split()[0]) for name, place in places.items()} for row in rows}
    raise BadInput(where="page", found=f"no table with {', '.join(filter(None, columns))}", expected=f"a row {first!r}")


def _tables(text: str) -> Iterator[tuple[list[str], list[list[str]]]]:
    """(head, rows) of every table in Markdown."""
    for block in re.findall(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE):
        head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()]
        yield head, rows


def draw(path: Path, points: Sequence[Point]) -> None:
    """Draw PSNR and MALE against bytes and, where methods were timed, against speed."""
    columns: list[tuple[str, Callable[[Point], float | None]]] = [("bytes per material", lambda point: point.nbytes)]
    if any(point.speed is not None for point in points):
        columns.append(("millions of evaluations per second, one thread", lambda point: point.speed))
    chart = Figure(figsize=(5.2 * len(columns), 8.2), layout="constrained")
    panels = chart.subplots(2, len(columns), squeeze=False, sharey="row")
    for row, name in zip(panels, ("PSNR", "MALE"), strict=True):
        for axis, (words, place) in zip(row, columns, strict=True):
            _panel(axis, points, name, place)
            axis.set_xscale("log")
            axis.set_xlabel(words)
            axis.margins(x=0.2, y=0.15)
            axis.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel("PSNR of the spheres [dB], more is better" if name == "PSNR" else "MALE, less is better")
    low, high = panels[1, 0].get_ylim()
    for axis in panels[1]:
        log_y(axis, low, high)
    words = (
        "Medians over the materials, judged by proxies that a method was not fitted to\n"
        f"(ours, GGX and McCool are fitted to the proxy {OF[0]})"
    )
    chart.suptitle(words, fontsize=10)
    replace_file(path, lambda made: chart.savefig(made, dpi=110, format="png"))


def _panel(axis, points: Sequence[Point], name: str, place: Callable[[Point], float | None]) -> None:
    groups = [[label] for label in PUBLISHED]
    groups += [[label for label in METHODS if label.split()[0] == first] for first in ("GGX", "McCool", "ours")]
    for labels in groups:
        own = [
            (x, point.psnr if name == "PSNR" else point.male)
            for label in labels
            for point in points
            if point.label == label and (x := place(point)) is not None
        ]
        if not own:
            continue
        first = labels[0].split()[0]
        colour = OURS if first == "ours" else PUBLISHED_COLOUR if first in PUBLISHED else REST
        axis.plot(*zip(*own, strict=True), "o-", color=colour, linewidth=1)
        words = "nps (+ 4 MB decoder)" if first == "nps" else first
        beside = _PLACES.get(f"{first}, {name}", _PLACES.get(first, (6, 5)))
        axis.annotate(words, own[0], xytext=beside, textcoords="offset points", fontsize=9, color=colour)


def main(arguments: list[str] | None = None) -> int:
    """Draw the picture from the tables of the page."""
    parser = parser_of(__doc__)
    parser.add_argument("--page", type=Path, default=_PAGE, help="the page with the tables")
    parser.add_argument("--plot", type=Path, default=_PICTURE, help="the picture to write")
    options = parser.parse_args(arguments)
    draw(options.plot, points_of_page(options.page.read_text(encoding="utf-8")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
