"""Compare the error and the time of a search that tries known mixes first with one that tries every mix.

Ten measurements of RGL, three Cornell paints, twenty surrogates and eight analytic models; no known mix was made from
one of them. Each is fitted with two textures of 16² and three of 32², by every way in turn: "all", the exhaustive
search with the units that "normal" grants, the same with another seed, and the efforts by name. Errors are the Cole
error of held-out samples at random azimuths and the relative RMS of f cosθi cosθo; ratios are to "all". CPU seconds
are those of the fit, on one thread.

    python scripts/accuracy/known_mixes_against_all.py [--work FILE] [--efforts quick normal] [--data FOLDER]
"""

import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

from homofact.brdf.source import open_source
from homofact.evaluation.energy import energy_errors
from homofact.evaluation.machine import machine
from homofact.evaluation.metrics import measure
from homofact.linear.normal import warm_up
from homofact.methods.effort import LEVELS
from homofact.methods.search import Search

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.accuracy.known_mixes import MEASURED, REPORTED
from scripts.shared.harness import CORNELL, Finished, data_folder, figure, finish, markdown, parser_of, progress
from scripts.verdict.drawn_cases import MORE_NETWORKS, NETWORKS, UNTOUCHED

SIZES = ((2, 16), (3, 32))
GROUPS = ("RGL", "Cornell", "surrogate", "model")
MODELS = (
    "lafortune-blue-paint", "lafortune-clay", "lafortune-skin", "cook-torrance-plastic", "phong-30", "blinn-phong-50",
    "torrance-sparrow-20", "car-paint-red",
)  # fmt: skip
# A number of units tries every mix; these are what "normal" grants. Another seed shows how far such searches differ.
ALL, AGAIN = "all", "all, seed 1"


def sources(folder: Path) -> list[tuple[str, str, str]]:
    """(group, name, path) of every material that is at hand."""
    found = [("RGL", name, str(folder / "rgl" / f"{name}_rgb.bsdf")) for name in MEASURED]
    found += [("Cornell", name, str(folder / "cornell" / f"{name}.brdf")) for name in CORNELL]
    found += [("surrogate", name, f"{folder / NETWORKS}#{name}") for name in UNTOUCHED]
    found += [("surrogate", name, f"{folder / MORE_NETWORKS}#{name}") for name in REPORTED]
    found = [line for line in found if Path(line[2].split("#")[0]).is_file()]
    return found + [("model", name, f"material:{name}") for name in MODELS]


def measured(path: str, textures: int, size: int, way: str) -> dict[str, Any]:
    """Errors and CPU seconds of one fit."""
    source = open_source(path)
    train, held = source.samples.split(0.2, 0)
    effort = LEVELS["normal"] * textures**2 if way in (ALL, AGAIN) else way
    method = Search(textures=textures, size=size, effort=effort, epsilon=source.default_epsilon, seed=int(way == AGAIN))
    began = time.process_time()
    fit = method.fit(train)
    seconds = time.process_time() - began
    held = held.rotated_at_random(0) if held.isotropic else held
    error = measure(fit.factorization, held, fit.factorization.transform).log_mse
    rms = energy_errors(fit.factorization, source.reflectance, source.samples.isotropic).rms
    return {"seconds": seconds, "error": error, "rms": rms, "kinds": fit.report.details["kinds"]}


def main(arguments: list[str] | None = None) -> int:
    """Fit, print the table of every material and the summary, and write them where that is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--work", type=Path, help="where results are kept, so that an ended run goes on")
    parser.add_argument("--efforts", nargs="*", default=["quick", "normal"], help="efforts beside all (%(default)s)")
    parser.add_argument("--groups", nargs="+", default=GROUPS, choices=GROUPS, help="which materials")
    options = parser.parse_args(arguments)
    found = Finished(options.work)
    materials = [line for line in sources(data_folder(options.data)) if line[0] in options.groups]
    if options.short:
        materials = materials[:1]
    warm_up()
    rows, summary = [], []
    ways = [ALL, AGAIN, *options.efforts]
    for textures, size in SIZES:
        fits: dict[str, list[dict[str, dict[str, Any]]]] = {}
        for group, name, path in materials:
            both = {}
            for way in ways:
                key = f"{name} {textures} {size} {way}"
                both[way] = found[key] if key in found else found.keep(key, measured(path, textures, size, way))
            fits.setdefault(group, []).append(both)
            cells = [figure(both[way][key]) for way in ways for key in ("error", "rms", "seconds")]
            rows.append((name, f"{textures} × {size}²", *cells))
            progress(*rows[-1], *("+".join(both[way]["kinds"]) for way in ways))
        for group, every in fits.items():
            for way in ways[1:]:
                ratios = [[both[way][key] / both[ALL][key] for both in every] for key in ("error", "rms", "seconds")]
                error, rms, cpu = ratios
                seconds = [both[way]["seconds"] for both in every]
                figures = (median(error), max(error), median(rms), max(rms), median(cpu), median(seconds))
                summary.append((group, f"{textures} × {size}²", way, *(f"{value:.2f}" for value in figures)))
    header = ("material", "textures", *(f"{way} {key}" for way in ways for key in ("error", "rms", "s")))
    short = (
        "materials", "textures", "search", "error, median", "error, worst", "rms, median", "rms, worst",
        "CPU ratio, median", "CPU seconds, median",
    )  # fmt: skip
    head = f"Ratios to the search of all mixes. {machine()}"
    return finish([head, markdown(short, summary, 3), markdown(header, rows, 2)], options)


if __name__ == "__main__":
    sys.exit(main())
