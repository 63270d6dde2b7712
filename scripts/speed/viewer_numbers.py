"""Measure the viewer's file in a software renderer: its size, and the time to its first picture.

    python scripts/speed/viewer_numbers.py [--material lafortune-blue-paint] [--loads 5] [--out FILE.md] [--short]

A fit of five textures by the search, McCool's projections of the same size and the source's table go into one page,
as `homofact view` writes it. Every load is a headless Chromium of its own, which draws with SwiftShader. The first
picture's time is from the start of the navigation until the GPU's work on all three pictures is done, a pixel read
back; what comes before it (data unpacked, shaders compiled) is in it. The median of the loads is judged.
"""

import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from homofact.brdf.source import open_source
from homofact.errors import BadInput
from homofact.evaluation.compare import fit_and_measure
from homofact.evaluation.machine import machine
from homofact.factor.factorization import Factorization
from homofact.methods.search import Search
from homofact.web.page import write_view

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured
from scripts.shared.headless import chromium, first_frame, open_page, required

LARGEST, LATEST = 300_000, 3.0
# Kinds that are all of two dimensions, so that five textures are five of size × size.
KINDS = ("theta_h-theta_d", "theta_d-phi_d", "theta_i-delta_phi", "isotropic-half-diff", "isotropic-half-diff")


def parts_of(page: str) -> dict[str, int]:
    """Bytes of the page's style, data and scripts, and of what is left."""
    sizes = {}
    for name, begin, end in (
        ("style", "<style>", "</style>"),
        ("data", '<script type="application/json" id="data">', "</script>"),
        ("script", "<script>", "</script>"),
    ):
        sizes[name] = len(page.partition(begin)[2].partition(end)[0].encode())
    return sizes | {"rest": len(page.encode()) - sum(sizes.values())}


def loaded(page: Path, count: int, size: tuple[int, int]) -> tuple[list[float], str]:
    """Seconds to the first picture, load by load, and the browser's name and version."""
    seconds, name = [], ""
    for _ in range(count):
        with tempfile.TemporaryDirectory() as folder, chromium(Path(folder) / "profile", size=size) as driver:
            open_page(driver, page)
            seconds.append(first_frame(driver) / 1000)
            said = [entry["message"] for entry in driver.get_log("browser")]
            if said:
                raise BadInput(f"the page complained ({said[0]})", where=page, expected="it silent")
            name = f"Chromium {driver.capabilities['browserVersion']}"
    return seconds, name


def main(arguments: list[str] | None = None) -> int:
    """Fit, write, load and print; 2 where something is missing."""
    parser = parser_of(__doc__, "effort")
    parser.add_argument("--material", default="lafortune-blue-paint")
    parser.add_argument("--loads", type=int, default=5, help="browsers started (%(default)s)")
    parser.add_argument("--page", type=Path, help="keep the page in this file")
    return print_measured(parser, arguments, measured)


def measured(chosen: Any) -> str:
    """The text. Raises MissingDependency where a browser is missing, before anything is fitted."""
    required()
    size, count = (8, 2000) if chosen.short else (32, 45_000)
    loads, effort = (1, 1.0) if chosen.short else (chosen.loads, chosen.effort)
    source = open_source(f"material:{chosen.material}", count=count)
    settings = Search(textures=len(KINDS), size=size, effort=effort, projections=KINDS)
    row = fit_and_measure(source, settings)
    assert isinstance(row.factorization, Factorization)
    shape = (640, 480) if chosen.short else (1440, 900)
    with tempfile.TemporaryDirectory() as folder:
        page = chosen.page or Path(folder) / "view.html"
        written = write_view(row.factorization, page, source)
        sizes = parts_of(page.read_text(encoding="utf-8"))
        seconds, browser = loaded(page, loads, shape)
    textures = ", ".join(f"{columns} × {rows}" for rows, columns in (term.size for term in row.factorization.terms))
    first = median(seconds)
    rows = [
        ("file, bytes", f"{written.size:,}", f"< {LARGEST:,}", "held" if written.size < LARGEST else "NOT held"),
        ("first picture, s, median", figure(first), f"< {LATEST:g}", "held" if first < LATEST else "NOT held"),
        ("first picture, s, slowest", figure(max(seconds)), "", ""),
    ]
    lines = [
        f"# The viewer's file of {chosen.material}",
        "",
        f"- {len(row.factorization.terms)} textures ({textures}), log MSE {figure(row.held_out.log_mse)} held out;"
        f" pictures: {', '.join(written.titles)}; the source as {written.record['table']['nodes']}",
        f"- bytes: {', '.join(f'{name} {size:,}' for name, size in sizes.items())}",
        f"- {loads} loads, {shape[0]} × {shape[1]} pixels, {browser}, WebGL 2 by SwiftShader. {machine()}",
        "",
        markdown(("figure", "measured", "wanted", "verdict"), rows),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
