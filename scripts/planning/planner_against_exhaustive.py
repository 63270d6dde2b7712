"""Compare the planner with exhaustive search: every candidate fitted once per material, then walks replayed.

Each material's rungs are fitted once (EFFORT of a search, COUNT samples of a model), stored in 8 bits too, and measured
under each lighting. The exhaustive optimum is the fewest bytes of all rungs that meet a tolerance; the planner, which
sees none of this, asks for single rungs and is counted by the fits that these take. One colour is no fit and counts on
neither side. Errors are those of samples and directions that no fit has seen, without the margins for other views.

    OMP_NUM_THREADS=1 python scripts/planning/planner_against_exhaustive.py [--jobs 2] [--data FOLDER] [--keep FILE]
"""

import json
import math
import multiprocessing
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from homofact.errors import HomofactError
from homofact.evaluation.machine import machine
from homofact.linear.normal import warm_up
from homofact.planning.ladder import COLOURS, CONSTANT, LAMBERT, Candidate, FitOptions, fits_among
from homofact.planning.material_fits import MaterialFits
from homofact.planning.measure import RepresentationEvaluator, best_colour
from homofact.planning.search import LadderOutcome, walk
from homofact.planning.stage import Stage
from homofact.scene.lighting import named_lighting

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import CORNELL, data_folder, figure, markdown, parser_of, write

EFFORT, COUNT = 20, 6000
LIGHTINGS = ("sun", "overcast", "studio")
TOLERANCES = {"cole": (0.3, 0.05, 0.01), "delta_e": (4.0, 1.0, 0.3), "reflected": (0.2, 0.05, 0.02)}
NAMED = (
    "lafortune-blue-paint",
    "lafortune-clay", "cook-torrance-plastic", "phong-30", "blinn-phong-50",
    "torrance-sparrow-20",
)  # fmt: skip
RGL = ("vch_golden_yellow_rgb", "aurora_white_rgb")
SURROGATES = ("blue-acrylic", "gold-metallic-paint")


def sources(folder: Path, short: bool) -> tuple[list[str], list[str]]:
    """(what there is to plan for, a message for each file that is not there)."""
    files = [folder / "cornell" / f"{name}.brdf" for name in CORNELL[:2]]
    files += [folder / "rgl" / f"{name}.bsdf" for name in RGL]
    surrogates = folder / "nbrdf" / "merl_nbrdf_weights.npz"
    found = [f"material:{name}" for name in NAMED]
    if short:
        return found[1:3], []
    found += [str(file) for file in files if file.is_file()]
    missing = [f"skipped {file.name}: no {file}" for file in (*files, surrogates) if not file.is_file()]
    if surrogates.is_file():
        found += [f"{surrogates}#{name}" for name in SURROGATES]
    return found, missing


def collect(job: tuple[str, tuple[str, ...], FitOptions, int]) -> dict:
    """Bytes, fetches and errors by lighting of every rung up to so many texels a side, with the seconds it took."""
    text, lightings, options, largest = job
    began = time.perf_counter()
    fits = MaterialFits(text, options)
    source = fits.source
    judges = {
        name: RepresentationEvaluator(source, Stage.of(named_lighting(name), options.seed), options)
        for name in lightings
    }
    reads = {name: judge.lighting.reads for name, judge in judges.items()}
    rows = []
    for candidate in (each for each in fits.rungs if each.size <= largest):
        rung = [candidate.method, candidate.textures, candidate.size, candidate.storage]
        if candidate.method in COLOURS:
            errors = {
                name: {
                    kind: judge.colour_errors(candidate, best_colour((judge,), kind != "cole"), (kind,)).of(kind)
                    for kind in TOLERANCES
                }
                for name, judge in judges.items()
            }
            found = {"bytes": candidate.most_bytes(len(source.samples.channels)), "fetches": 0}
        else:
            try:
                fitted = fits.fitted(candidate)[0]
            except HomofactError:
                nothing = {kind: math.inf for kind in TOLERANCES}
                most = candidate.most_bytes(len(source.samples.channels))
                row = {"errors": dict.fromkeys(judges, nothing), "bytes": most, "fetches": candidate.most_fetches(True)}
                rows.append({"candidate": rung, **row})
                continue
            cole = None
            errors = {}
            for name, judge in judges.items():
                kinds = ("delta_e", "reflected") if cole is not None else ("cole", "delta_e", "reflected")
                errors[name] = asdict(judge.errors(fitted, kinds))
                cole = errors[name]["cole"] if cole is None else cole
                errors[name]["cole"] = cole
            nbytes = fitted.nbytes * candidate.texel_bytes // 4
            found = {"bytes": nbytes, "fetches": fitted.fetches, "terms": len(fitted.terms)}
        rows.append({"candidate": rung, "errors": errors, **found})
    seconds = time.perf_counter() - began
    isotropic = source.samples.isotropic
    return {"source": source.name, "isotropic": isotropic, "rows": rows, "seconds": seconds, "reads": reads}


@dataclass(frozen=True)
class Case:
    """One material under one lighting with one tolerance: the planner's answer beside the exhaustive one.

    `bytes` and `optimum` are None where no rung was found, or none there is, that meets the tolerance; `least` is the
    smallest error of all rungs, `error` that of the choice.
    """

    source: str
    lighting: str
    kind: str
    tolerance: float
    bytes: int | None
    optimum: int | None
    error: float
    least: float
    fits: int
    all_fits: int

    @property
    def within(self) -> bool:
        """Whether the tolerance is met with at most 10% more bytes than the optimum; False where no rung can."""
        return self.optimum is not None and self.bytes is not None and self.bytes <= 1.1 * self.optimum

    @property
    def near_best(self) -> bool:
        """Where no rung can meet the tolerance: whether the answer is within 10% of the best that can be reached."""
        return self.optimum is None and self.error <= 1.1 * self.least


def replay(table: dict, lighting: str, kind: str, tolerance: float) -> Case:
    """The planner's walk over fits that are already there."""
    rows = {
        Candidate(*row["candidate"]): LadderOutcome(
            row["errors"][lighting][kind], row["bytes"], row["fetches"], row.get("terms", 0)
        )
        for row in table["rows"]
        if kind != "cole" or row["candidate"][0] != LAMBERT
    }
    found = walk(
        tuple(rows),
        rows.__getitem__,
        tolerance,
        isotropic=table["isotropic"],
        light_reads={CONSTANT: table["reads"][lighting], LAMBERT: 9},
    )
    chosen = found.asked[found.choice] if found.choice is not None else None
    meeting = [each.bytes for each in rows.values() if each.error <= tolerance]
    return Case(
        table["source"],
        lighting,
        kind,
        tolerance,
        chosen.bytes if found.met and chosen is not None else None,
        min(meeting, default=None),
        chosen.error if chosen is not None else math.inf,
        min(each.error for each in rows.values()),
        found.fits,
        fits_among(rows),
    )


def part(flags: Sequence[bool]) -> str:
    """The share that is true, of something."""
    return f"{sum(flags) / len(flags):.1%}" if flags else "–"


def report(cases: Sequence[Case], seconds: float) -> str:
    """The tables in Markdown."""
    groups: dict[tuple[str, ...], list[Case]] = {}
    for case in cases:
        for key in ((case.kind, f"{case.tolerance:g}"), ("all", ""), (case.source, ""), (case.lighting, "")):
            groups.setdefault(key, []).append(case)
    order = sorted(groups, key=lambda key: (key[0] in TOLERANCES or key[0] == "all", key[0] == "all"))
    lines = [
        "Cases; how many of them any rung can meet, and the planner met; of these, how many with bytes within 10% of"
        " the exhaustive optimum; of the others, how many with an error within 10% of the best that any rung reaches;"
        " mean and most fits of a walk, and their share of the exhaustive ones.",
        "",
        markdown(
            (
                "",
                "tolerance",
                "cases",
                "can be met",
                "met",
                "bytes",
                "error of the rest",
                "fits",
                "most",
                "of exhaustive",
            ),
            [
                (
                    *key,
                    len(group),
                    sum(case.optimum is not None for case in group),
                    sum(case.bytes is not None for case in group),
                    part([case.within for case in group if case.optimum is not None]),
                    part([case.near_best for case in group if case.optimum is None]),
                    f"{sum(case.fits for case in group) / len(group):.2f}",
                    max(case.fits for case in group),
                    f"{sum(case.fits for case in group) / sum(case.all_fits for case in group):.1%}",
                )
                for key, group in ((key, groups[key]) for key in order)
            ],
            text_columns=2,
        ),
        "",
        *(
            f"- more bytes: {c.source}, {c.lighting}, {c.kind} {c.tolerance:g}: {c.bytes} bytes, optimum"
            f" {c.optimum}, error {figure(c.error)}, least {figure(c.least)}"
            for c in cases
            if c.optimum is not None and not c.within
        ),
        "",
        f"{seconds:.0f} s. {machine()}",
    ]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Run it; exit code 0."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--jobs", type=int, default=2, help="materials at a time")
    parser.add_argument("--keep", type=Path, help="read the fits' errors from this file, or leave them there")
    given = parser.parse_args(argv)
    began = time.perf_counter()
    if given.keep is not None and given.keep.is_file():
        tables = [json.loads(line) for line in given.keep.read_text(encoding="utf-8").splitlines()]
    else:
        found, missing = sources(data_folder(given.data), given.short)
        for message in missing:
            print(message)
        # A smoke test leaves most of each search undone, by the clock.
        options = FitOptions(effort=1, budget=0.05, count=400) if given.short else FitOptions(EFFORT, count=COUNT)
        warm_up()
        lightings, largest = (LIGHTINGS[:1], 8) if given.short else (LIGHTINGS, 64)
        work = [(text, lightings, options, largest) for text in found]
        if given.jobs > 1 and not given.short:
            with multiprocessing.get_context("spawn").Pool(given.jobs) as pool:
                tables = pool.map(collect, work, chunksize=1)
        else:
            tables = list(map(collect, work))
        if given.keep is not None:
            write(given.keep, "".join(json.dumps(table) + "\n" for table in tables))
    cases = [
        replay(table, lighting, kind, tolerance)
        for table in tables
        for lighting in table["reads"]
        for kind, values in TOLERANCES.items()
        for tolerance in values
    ]
    print(report(cases, time.perf_counter() - began))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
