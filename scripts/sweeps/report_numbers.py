"""Measure reports of small and large sweeps: bytes, seconds to write, and time to the first page.

    python scripts/sweeps/report_numbers.py SWEEP [--fits 1000 10000] [--loads 3] [--out FILE.md] [--short]

The site is written as `homofact report` writes it. The larger sweeps are the same fits again and again, each time as
another material with figures a little off; of those the first page alone is made. A load is from the start of the
navigation until a frame after everything is drawn, in a headless Chromium of its own; then one click sorts the table
by the first metric, and another metric is chosen for the charts, both until a frame after. The median of the loads is
said.
"""

import hashlib
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from homofact.errors import BadInput
from homofact.evaluation.machine import machine
from homofact.sweeps.report.index_page import index_html
from homofact.sweeps.report.material_page import FitFiles
from homofact.sweeps.report.reading import ReadSweep, ReportedFit, read_results
from homofact.sweeps.report.site import write_site

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, markdown, parser_of, print_measured
from scripts.shared.headless import chromium, open_page

_FRAME = "const done = arguments[0], began = performance.now(); {}requestAnimationFrame(() => setTimeout(() => "
_TIMED = _FRAME + "done(performance.now() - began)));"
SORT = _TIMED.format(
    "[...document.querySelectorAll('#table thead button')].find((each) => each.title === 'log MSE, held out').click();"
)
CHOOSE = _TIMED.format(
    "const metric = document.getElementById('metric'); metric.selectedIndex = 1;"
    " metric.dispatchEvent(new Event('change'));"
)


def larger(sweep: ReadSweep, count: int) -> ReadSweep:
    """`count` fits: those of a sweep again and again, each time as other materials, figures up to a tenth off."""
    numbers = random.Random(0)
    found: list[ReportedFit] = []
    while len(found) < count:
        k, fit = len(found), sweep.fits[len(found) % len(sweep.fits)]
        turn = k // len(sweep.fits)
        digest = hashlib.sha256(f"{fit.task.digest} {turn}".encode()).hexdigest()
        figures = {name: value and value * numbers.uniform(0.9, 1.1) for name, value in fit.row.metrics.items()}
        seconds = fit.row.seconds * numbers.uniform(0.9, 1.1)
        task = replace(fit.task, digest=digest, source=f"{fit.row.name} {turn}")
        row = replace(fit.row, key=f"{k:032x}", name=task.source, seconds=seconds, metrics=figures)
        found.append(replace(fit, task=task, row=row))
    return replace(sweep, fits=tuple(found))


def loaded(page: Path, loads: int) -> tuple[list[float], str]:
    """Milliseconds (load, sort, choose), each the median of the loads, and the browser's name and version."""
    rows, name = [], ""
    for _ in range(loads):
        with (
            tempfile.TemporaryDirectory() as folder,
            # The page needs no WebGL, whose software would draw all else too.
            chromium(Path(folder) / "profile", webgl=False, size=(1400, 900)) as driver,
        ):
            open_page(driver, page)
            shown = driver.execute_async_script("window.homofact.ready.then((said) => arguments[0](said.shownMs))")
            rows.append((shown, driver.execute_async_script(SORT), driver.execute_async_script(CHOOSE)))
            said = [entry["message"] for entry in driver.get_log("browser")]
            if said:
                raise BadInput(f"the page complained ({said[0]})", where=page, expected="it silent")
            name = f"Chromium {driver.capabilities['browserVersion']}"
    return [median(column) for column in zip(*rows, strict=True)], name


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, load and print; 2 where something is missing."""
    parser = parser_of(__doc__)
    parser.add_argument("sweep", type=Path)
    parser.add_argument("--fits", type=int, nargs="+", default=[1000, 10_000], help="sizes of larger sweeps")
    parser.add_argument("--loads", type=int, default=3, help="browsers started for each page (%(default)s)")
    return print_measured(parser, arguments, measured)


def measured(chosen: Any) -> str:
    """The text. Raises BadInput for a folder that is no sweep, and where a browser is missing."""
    loads, counts = (1, [40]) if chosen.short else (chosen.loads, chosen.fits)
    sweep = read_results(chosen.sweep)
    pages, browser = [], ""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        site = write_site(chosen.sweep, Path(folder) / "site")
        seconds = time.perf_counter() - begun
        kinds = {
            words: sum(each.stat().st_size for each in site.folder.glob(pattern))
            for words, pattern in (
                ("first page", "index.html"), ("pages of materials", "materials/*.html"), ("viewers", "fits/*.html"),
                ("pictures and textures", "fits/*.png"), ("tables", "fits.*"),
            )
        }  # fmt: skip
        for count in (len(sweep.fits), *counts):
            page = site.folder / "index.html"
            if count != len(sweep.fits):
                many = larger(sweep, count)
                page = Path(folder) / f"{count}.html"
                nothing = {fit.row.key: FitFiles(None, (), None, "") for fit in many.fits}
                page.write_text(index_html(many, nothing, None, ["fits.csv"]), encoding="utf-8")
            times, browser = loaded(page, loads)
            pages.append((f"{count:,}", f"{page.stat().st_size:,}", *(f"{each:.0f}" for each in times)))
    lines = [
        f"# The report of {sweep.name}",
        "",
        f"- {len(sweep.fits)} fits of {len(sweep.names())} materials: {site.files} files, {site.size:,} bytes,"
        f" written in {figure(seconds)} s",
        f"- bytes: {', '.join(f'{name} {size:,}' for name, size in kinds.items())}",
        f"- {loads} loads of each page, 1400 × 900 pixels, {browser}. {machine()}",
        "",
        markdown(("fits", "first page, bytes", "loaded, ms", "sorted, ms", "another metric, ms"), pages, 0),
        "",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
