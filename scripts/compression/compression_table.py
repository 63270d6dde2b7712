"""The field in one table: what the 100 MERL materials become in other methods' few bytes and in ours.

    python scripts/compression/compression_table.py [--count 100] [--methods A,B] [--means A,B] [--plot FILE.png]

MERL itself is not at hand. Three published fits of it are taken as readings (`published_fits`): networks (nbrdf),
factors (npf) and Neural Processes (nps). What was published is scored against the readings that it is not itself; a
method that is fitted here is fitted to one reading, or to the mean of two, and scored against the others
(`compression_protocol`). Nothing is chosen by hand for a material, all settings are defaults but the bytes. Errors on
the reading that a method was fitted to stand apart.

Materials are taken in an order that spreads over all names, every tenth from the first, every tenth from the sixth, and
so on, so that the first of them are a fair sample; what is done is kept in the cache folder, also from run to run.
`compression_speed.py` and `compression_seeds.py` put their rows there.
"""

import csv
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from homofact.brdf.source_names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.evaluation.machine import machine
from homofact.linear.normal import warm_up

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.compression.compression_charts import draw
from scripts.compression.compression_fits import DEFAULT_METHODS, METHODS, READINGS, Entry, entries, name_of, wanted
from scripts.compression.compression_limits import FILE as LIMITS
from scripts.compression.compression_protocol import PAIRS, kept, place_of
from scripts.compression.compression_seeds import FILE as SEEDS
from scripts.compression.compression_speed import read
from scripts.compression.compression_tables import added, ahead, materials, order, seeds, speeds, table, zones
from scripts.data.published_fits import PUBLISHED, names
from scripts.shared.harness import data_folder, finish, listed, markdown, parser_of, progress

STARTS = (0, 5, 2, 7, 4, 9, 1, 6, 3, 8)
INTRODUCTION = """\
The MERL materials by published fits (NBRDF, NPF, Neural Processes, ABC, SGD: [references](references.bib)), by GGX
and McCool's projections fitted here, and by ours at three budgets of bytes, all other settings defaults. The
measurements themselves are not at hand: three of the published fits (nbrdf, npf, nps) stand for them, as readings, and
each reading's own error is then part of everyone's.

MALE, Cole error (ε = 1e-2) and energy (the worst channel's relative error) of 20,000 pairs under 80°; MAE, RMSE, SSIM
and PSNR of spheres under three skies. Median over materials, in brackets what a tenth of them is worse than. `nps`
needs a decoder of 4 MB beside its 28 bytes."""
OWN = """\
So do published tables judge: there NBRDF has an MAE of .0028 and SSIM of .995, NPF .0056 and .990 (Sztrajman et al.
2021), of MERL itself. Of ours .0025, .996 and 47 dB were asked at 3.2 KiB, 50 and 56 dB at 12 and 48 KiB."""
ADDED = """\
A fit of a reading cannot be nearer to the truth than the reading is but by luck. What counts is how little it adds: the
reading itself judged by the two others, beside what is fitted to that reading. "More than the reading" is the median
over materials of the difference in the score; "nearer than it in" is the share of materials and judges where the fit
has the better one. Ours adds next to nothing at any budget (of nbrdf and nps it is more often a little nearer to the
others than they are); McCool's projections and GGX, fitted to the same, show what it is to lose something."""
OTHERS = """\
A published fit is judged by the readings that it is not; what is fitted here to one reading by the two others. Since
ours comes out about as far from the others as the reading that it was fitted to, ours pooled over three readings lies
between nbrdf, nps and npf: it inherits npf's error where it is fitted to npf."""
AHEAD = """\
Judge by judge, ours first. Against a reading stands ours fitted to that reading, so that both know the same; against
what was published of MERL itself (abc, sgd) or fitted here, ours fitted to the two other readings. Ours at the bytes of
the other, or the smallest of ours where the other has fewer. Where npf judges, abc is ahead of nbrdf and nps
themselves, so ours, which knows only these, is behind it."""
SPEED = """\
`scripts/compression/compression_speed.py`: the same directions in one run on one thread, each at its best batch size,
beside other work; medians over materials. All but nps are shading programs by one compiler."""
SEEDED = """\
`scripts/compression/compression_seeds.py`: samples are drawn, and the fit run, with seeds 0, 1 and 2; mean ± sample
standard deviation over the seeds. Fitted to nbrdf."""
ORDER = """\
Sztrajman et al. 2021, table 1: GGX < SGD < ABC < NPF < NBRDF. Means over materials, judged by what a method is not."""
SGD = """\
ABC, NPF and NBRDF come out in the published order. SGD does not: it falls behind our GGX. Its formula here is, term by
term (distribution, masking, the sum, the order of the 33 numbers), that of the public implementation that the numbers
come from, so the numbers are the reason. Its distribution falls off like exp(−tan²θh/α): a highlight that is narrow and
has a long tail, as those of metals and metallic paints, becomes too wide and too low, and ends where the readings go
on. The table has the median of mean |log(f̂/f)| by the half vector's angle, and in brackets how many pairs are off by
more than a factor of two, f by nbrdf. GGX has the long tail, and ours is fitted to cube roots, which do not forget it;
the published GGX was fitted otherwise."""
CROWDED = """\
Why 48 KiB are hardly better than 12 on the reading that is fitted: `scripts/compression/compression_limits.py` fits the
same with more of one thing at a time. None of it helps much, neither texels, samples, textures nor effort. What is left
is what a product of textures of two coordinates each cannot say about a function of three. "Highlight" is the root mean
square difference of logarithms where θh < 10°, "rest" where it is more."""


def spread(every: Sequence[str]) -> list[str]:
    """All names, every tenth from the starts of `STARTS`."""
    return [name for start in STARTS for name in every[start::10]]


def main(arguments: list[str] | None = None) -> int:
    """Fill the cache, print the tables, write and draw them where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--count", type=int, default=100, help="how many materials, spread over all")
    parser.add_argument("--methods", default=",".join(DEFAULT_METHODS), help=f"of {', '.join(METHODS)}")
    parser.add_argument("--means", default="", help="methods that are fitted to the mean of two readings too")
    parser.add_argument("--done", action="store_true", help="only what is in the cache, of materials that are complete")
    parser.add_argument("--cache", type=Path, default=Path("out/compression"), help="the folder of what is done")
    parser.add_argument("--plot", type=Path, help="a PNG of error against bytes and speed")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    warm_up()
    labels, means = (listed(each, list(METHODS), "methods") for each in (options.methods, options.means))
    every = names(folder)
    some = spread(every)[: options.count]
    if options.short:
        some, labels = some[:1], ["GGX × 1"]
    fits = wanted(labels, means)
    more = wanted(list(METHODS), list(METHODS))
    if options.done:
        needed = [*PUBLISHED, *(name_of(*fit) for fit in fits if len(fit[1]) == 1)]
        some = [m for m in some if all(place_of(options.cache, m, each).is_file() for each in needed)]
    found: list[Entry] = []
    for number, material in enumerate(some, 1):
        began = time.perf_counter()
        own = [f for f in more if place_of(options.cache, material, name_of(*f)).is_file()] if options.done else fits
        found += entries(material, own, options.cache, folder)
        progress(f"{number} of {len(some)}: {material}, {time.perf_counter() - began:.0f} s")
    finish(parts(found, every, options.cache, options.short), options)
    if options.plot:
        draw(options.plot, found, read(options.cache))
    return 0


def parts(found: Sequence[Entry], every: Sequence[str], cache: Path, short: bool) -> list[str]:
    """The page, paragraph by paragraph."""
    count, done = materials(found), {e.material for e in found}
    others, behind = ahead(found)
    page = [
        "<!-- Made by `python scripts/compression/compression_table.py`: change the words there, not here. -->",
        "# The field in one table",
        INTRODUCTION,
        "![Error against bytes and speed](pictures/compression.png)",
        f"{count} of {len(every)} materials: {', '.join(m for m in every if m in done)}.",
        f"Fits of {DEFAULT_COUNT} pairs ({DEFAULT_SCHEME}) of a reading, {PAIRS} others to judge, seed 0; seconds are"
        " beside other work, those of a search that two budgets share counted for each.",
        machine(),
        *(["a smoke test: the figures mean nothing"] if short else []),
        "## On the reading that a method was fitted to",
        OWN,
        table(found, lambda e: e.readings == (e.by,)),
        "## What a fit adds to its reading",
        ADDED,
        added(found),
        "## Judged by readings that a method was not fitted to",
        OTHERS,
        table(found, lambda e: e.by not in e.readings),
        *(
            line
            for by in READINGS
            for line in (f"### by {by}", table(found, lambda e, by=by: e.by == by and by not in e.readings))
        ),
        "## Where ours is ahead, and where not",
        AHEAD,
        behind,
        others,
    ]
    for title, words, rows, made in (
        ("Speed", SPEED, read(cache), speeds),
        ("Seeds", SEEDED, rows_of(cache / SEEDS), seeds),
        ("More bytes", CROWDED, rows_of(cache / LIMITS), limits),
    ):
        if rows:
            page += [f"## {title}", words, made(rows)]

    def truth(material: str):
        return kept(cache, material, "nbrdf", _missing).values

    return [*page, "## The published order", ORDER, order(found), SGD, zones(found, truth, "nbrdf")]


def limits(rows: Sequence[dict[str, str]]) -> str:
    """Rows of `compression_limits.py` as they are."""
    return markdown(list(rows[0]), [list(row.values()) for row in rows], 2)


def rows_of(place: Path) -> list[dict[str, str]]:
    """Rows of a CSV file, none where there is none."""
    return list(csv.DictReader(place.read_text().splitlines())) if place.is_file() else []


def _missing():
    raise AssertionError("every reading of an entry is in the cache")


if __name__ == "__main__":
    sys.exit(main())
