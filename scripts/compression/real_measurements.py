"""Compare homofact at four budgets with published and locally fitted methods on real measurements.

    python scripts/compression/real_measurements.py --done FILE.jsonl [--hybrid FOLDER] [--methods A,B]
        [--materials A,B] [--kept] [--out docs/real.md] [--plot docs/pictures/real.png]

Ten RGL files, a car paint, three Cornell paints and a retroreflective tape (`real_fits`), judged by `real_judging`.
Every material, way (raw or straightened; left-out samples or rings) and method is one line of the file that --done
names, so that a run goes on where it was stopped; --kept makes the page of what is there and fits nothing. The lines of
the published page are real_measurements.jsonl here. To have one method anew, take its lines out. --hybrid names a
folder with the shaders of the hybrid of De Oliveira et al. 2026 (`hybrid_fits`); without it that row is empty.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from homofact.brdf.quality.tilt import ReciprocalMean
from homofact.brdf.source import Source
from homofact.errors import BadInput, HomofactError
from homofact.linear.normal import warm_up
from homofact.methods.method import Method
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_fits import SharedSearch
from scripts.compression.real_fits import (
    BOUND,
    LABELS,
    METHODS,
    PUBLISHED,
    RAW,
    RINGS,
    SAMPLES,
    STRAIGHT,
    Problem,
    Subject,
    cost,
    fitted_here,
    problems,
    published,
    subjects,
)
from scripts.compression.real_judging import PIXELS, Asked, judged_at
from scripts.compression.real_page import page
from scripts.compression.real_tables import Row
from scripts.shared.harness import Finished, data_folder, finish, listed, parser_of, progress

COUNT, SHORT_COUNT, SHORT_PIXELS, SHORT_EFFORT = 45_000, 3000, 32, 5.0
SHORT_METHODS, SHORT_MATERIALS = (PUBLISHED[0], "GGX × 1", "ours 1 KiB"), ("vch_golden_yellow", "garnet_red")


def key(subject: Subject, way: str, label: str) -> str:
    """What the file of finished fits calls one."""
    return f"{subject.name} | {way} | {label}"


class Run:
    """What the fits of a run share: the data, what is finished, and how finely it is judged."""

    def __init__(self, folder: Path, shaders: Path | None, finished: Finished, short: bool) -> None:
        """Of the folder of real data and that of the hybrid's shaders; a short run draws few pairs, small pictures."""
        self.folder, self.shaders, self.finished = folder, shaders, finished
        self.count, self.pixels = (SHORT_COUNT, SHORT_PIXELS) if short else (COUNT, PIXELS)
        self.short = short

    def method(self, label: str) -> Method:
        """The settings of a method; a short run hardly searches."""
        method = METHODS[label]
        return replace(method, effort=SHORT_EFFORT) if self.short and isinstance(method, Search) else method

    def asked(self, source: Source) -> Asked:
        """A measurement with all that fits are held against."""
        return Asked.of(source.reflectance, self.folder, self.pixels)

    def material(self, subject: Subject, labels: Sequence[str]) -> None:
        """Fit and judge what is missing of a material."""
        raw: Asked | None = None
        for problem in problems(subject, self.count):
            missing = [label for label in labels if key(subject, problem.way, label) not in self.finished]
            if problem.way == STRAIGHT:
                missing = [label for label in missing if label not in PUBLISHED]
            if problem.test is not None:
                missing = [label for label in missing if label != BOUND]
            own = None
            if missing and problem.test is None:
                own = self.asked(problem.source)
                if problem.way == RAW:
                    raw = own
                elif raw is None:
                    raw = self.asked(subject.opened(RAW, self.count))
            shared = SharedSearch()
            for label in missing:
                began = time.perf_counter()
                found = self.row(subject, problem, label, shared, own, raw)
                self.finished.keep(key(subject, problem.way, label), found)
                progress(f"{key(subject, problem.way, label)}, {time.perf_counter() - began:.0f} s")

    def row(
        self, subject: Subject, problem: Problem, label: str, shared: SharedSearch, own: Asked | None, raw: Asked | None
    ) -> dict[str, Any]:
        """The figures of one method: its cost, `own` against what was fitted, `raw` against the raw measurement."""
        try:
            if label == BOUND:
                assert own is not None
                return {"cost": {}, "own": own.judged(ReciprocalMean(problem.source.reflectance))}
            if label in METHODS:
                fit, seconds = fitted_here(self.method(label), problem, shared)
            else:
                found = published(label, subject, self.folder, self.shaders)
                if isinstance(found, str):
                    return {"skipped": found}
                fit, seconds = found, None
            if problem.test is not None:
                return {"cost": cost(fit, seconds), "own": judged_at(problem.test, fit)}
            assert own is not None
            figures = {"cost": cost(fit, seconds), "own": own.judged(fit)}
            return figures if problem.way == RAW or raw is None else figures | {"raw": raw.numbers(fit)}
        except HomofactError as error:
            return {"skipped": str(error)}


def rows_of(finished: Finished, chosen: Sequence[Subject], labels: Sequence[str]) -> list[Row]:
    """What is finished of the chosen materials and methods."""
    ways = (RAW, STRAIGHT, SAMPLES, RINGS)
    return [
        Row(subject.name, subject.group, way, label, finished[key(subject, way, label)])
        for subject in chosen
        for way in ways
        for label in labels
        if key(subject, way, label) in finished
    ]


def main(arguments: list[str] | None = None) -> int:
    """Fit and judge what is missing, print the page, write and draw it where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--done", type=Path, help="keep what is done in this file, and leave it out the next time")
    parser.add_argument("--kept", action="store_true", help="fit nothing: the page of what --done has")
    parser.add_argument("--hybrid", type=Path, help="a folder with the hybrid's published shaders of RGL")
    parser.add_argument("--methods", help=f"separated by commas without spaces, of {'; '.join(LABELS)}")
    parser.add_argument("--materials", help="separated by commas (default: all)")
    parser.add_argument("--plot", type=Path, help="a PNG of error against bytes")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    there = subjects(folder)
    try:
        if not there:
            raise BadInput(
                where="data", found=f"no measurements in {folder}", expected="--data FOLDER or HOMOFACT_DATA"
            )
        labels = listed(options.methods, LABELS, "methods")
        names = listed(options.materials, [subject.name for subject in there], "materials")
        if options.short:
            labels = [label for label in labels if label in SHORT_METHODS]
            names = [name for name in names if name in SHORT_MATERIALS]
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    chosen = [subject for subject in there if subject.name in names]
    finished = Finished(options.done)
    if not options.kept:
        warm_up()
        run = Run(folder, options.hybrid, finished, options.short)
        for subject in chosen:
            run.material(subject, labels)
    rows = rows_of(finished, chosen, labels)
    if options.plot:
        from scripts.compression.real_chart import draw

        draw(options.plot, rows)
    return finish(page(rows), options)


if __name__ == "__main__":
    sys.exit(main())
