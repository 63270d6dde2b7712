"""Compare homofact with published compressions of the 100 MERL materials, at equal bytes.

    python scripts/compression/compression_table.py [--count 100] [--methods A,B] [--means A,B] [--plot FILE.png]

The measurements of MERL may not be shipped. Three published fits of them serve as proxies, called readings in the code
(`published_fits`): networks (nbrdf), factors (npf) and Neural Processes (nps). A published fit is scored against the
proxies other than itself. A method that is fitted here is fitted to one proxy, or to the mean of two, and scored
against the others (`compression_protocol`). Nothing is chosen by hand for a material, and all settings but the bytes
are defaults. Errors on the proxy that a method was fitted to are in a table of their own.

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
from scripts.compression.compression_charts import draw, points_of
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
Read this page to choose between homofact and other compact representations of a measured BRDF. It compares them on
the 100 MERL materials, in error, bytes and speed. The other representations are NBRDF, NPF, Neural Processes, ABC
and SGD as published ([references](references.bib)), and GGX lobes and McCool's projections, which homofact fits. The
rows "ours" are homofact's default search at three budgets of bytes, with all other settings at their defaults. For
measurements instead of published fits, read [Real measurements](real.md). To compare methods on your own file, run

    homofact compare SOURCE --methods mccool,search,ggx,npf --plot out/methods.png

The measurements of MERL may not be shipped. Three published fits of them (nbrdf, npf, nps) serve as proxies: a
method is fitted to a proxy, and its error is measured against a proxy. The error of the proxies is therefore part of
every figure except those of the [first table](#error-on-the-proxy-that-a-method-was-fitted-to).

![Error against bytes and speed](pictures/compression.png)"""
READING = """\
Each figure is a median over materials. The figure in brackets is the 90th percentile: a tenth of the materials is
worse.

- **MALE** is the mean of |log(1 + f cosθi) − log(1 + f̂ cosθi)|, **Cole** the Cole error with ε = 1e-2, and
  **energy** the relative error of the total reflected light in the worst channel ([glossary](glossary.md)). They are
  measured over 20,000 pairs of directions under 80°.
- **MAE**, **RMSE**, **SSIM** and **PSNR** compare rendered spheres under three skies.
- **bytes** are those of one material. `nps` also needs a decoder of 4 MB, which all materials share. **fetches** are
  texture lookups per evaluation."""
OWN = """\
Each method is judged by the proxy that it was fitted to, as published tables do. On MERL itself, Sztrajman et al.
(2021) report an MAE of .0028 and an SSIM of .995 for NBRDF, and .0056 and .990 for NPF. Our targets were an MAE of
.0025, an SSIM of .996 and a PSNR of 47 dB at 3.2 KiB, and a PSNR of 50 dB at 12 KiB and 56 dB at 48 KiB."""
ADDED = """\
A fit of a proxy can be nearer to the truth than the proxy only by chance. This table shows how much error the fit
adds. The row "nbrdf itself" judges nbrdf by the two other proxies. The rows below it judge the fits of nbrdf by the
same two. "Added by the fit" is the median difference of the two scores. "Fit better in" is the share of materials
and judges for which the fit has the better score. homofact adds almost nothing at any budget. Its fits of nbrdf and
nps are more often slightly nearer to the other proxies than nbrdf and nps are. McCool's projections and GGX, fitted
to the same proxies, show what a real loss looks like."""
OTHERS = """\
A published fit is judged by the proxies other than itself. A method that homofact fits to one proxy is judged by the
two others, and in the rows "mean of two proxies" by the third. homofact's fits are about as far from the other
proxies as the proxy that they were fitted to. Its pooled row therefore lies between nbrdf, nps and npf: fits of npf
inherit npf's error."""
AHEAD = """\
Each row compares homofact (first figure) with another method (second figure) by one proxy. If the other method is
itself a proxy, homofact was fitted to that proxy, so both have the same information. Against methods that were
published for MERL itself (abc, sgd) or fitted here, the row pools homofact's fits of the two other proxies. homofact
has as many bytes as the other method, or its smallest budget if the other method has fewer. Judged by npf, abc is
ahead of nbrdf and nps themselves. homofact was fitted to only these two there, so it is behind abc too."""
SPEED = """\
`scripts/compression/compression_speed.py` evaluates the same directions with every method in one run on one thread,
each method at its best batch size, while other work ran on the machine. M/s are millions of evaluations per second,
as a median over materials. homofact compiles the programs of all methods except nps, which runs in torch."""
SEEDED = """\
`scripts/compression/compression_seeds.py` draws the samples and runs the fit with seeds 0, 1 and 2. The table shows
the mean over the seeds ± the sample standard deviation. All fits are of nbrdf; "by others" means judged by the other
proxies."""
ORDER = """\
Sztrajman et al. (2021, table 1) rank the methods GGX < SGD < ABC < NPF < NBRDF. The table shows means over
materials, each method judged by the proxies other than itself and other than the one it was fitted to."""
SGD = """\
ABC, NPF and NBRDF come out in the published order. SGD does not: it falls behind our GGX fits. The formula is not
the reason. Term by term (distribution, masking, the sum, the order of the 33 numbers) it is that of the public
implementation from which the numbers come, so the numbers are the reason. SGD's distribution falls off like
exp(−tan²θh/α). Metals and metallic paints have a narrow highlight with a long tail. SGD makes such a highlight too
wide and too low, and its tail ends where the proxies' tails continue. GGX has the long tail, and homofact fits it to
cube roots, which keep the tail's weight; the published GGX was fitted differently. The table shows mean |log(f̂/f)|
by the half vector's angle, as a median over materials with nbrdf as f. The figure in brackets is the share of pairs
that are off by more than a factor of two."""
CROWDED = """\
On the proxy that is fitted, 48 KiB are hardly better than 12 KiB. `scripts/compression/compression_limits.py`
repeats the fits with more of one thing at a time. More texels, samples, textures and search effort all help little.
The error that remains comes from the form of the fit: a product of textures of two coordinates cannot represent
every function of three. "Highlight" is the root mean square difference of logarithms where θh < 10°, "rest" the same
where θh is larger."""
LIMITATIONS = """\
- Every judge is a proxy with an error of its own. The measurements of MERL were not used.
- NPF and NBRDF were fitted here to few materials. Each table states their number.
- The seconds of a fit were measured while other work ran. If two budgets share a search, its seconds count for each."""


def spread(every: Sequence[str]) -> list[str]:
    """All names, every tenth from the starts of `STARTS`."""
    return [name for start in STARTS for name in every[start::10]]


def main(arguments: list[str] | None = None) -> int:
    """Fill the cache, print the tables, write and draw them where it is asked for."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--count", type=int, default=100, help="how many materials, spread over all")
    parser.add_argument("--methods", default=",".join(DEFAULT_METHODS), help=f"of {', '.join(METHODS)}")
    parser.add_argument("--means", default="", help="methods to fit to the mean of two proxies too")
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
        draw(options.plot, points_of(found, read(options.cache)))
    return 0


def parts(found: Sequence[Entry], every: Sequence[str], cache: Path, short: bool) -> list[str]:
    """The page, paragraph by paragraph."""
    count, done = materials(found), {e.material for e in found}
    others, behind = ahead(found)
    page = [
        "<!-- Made by `python scripts/compression/compression_table.py`: change the words there, not here. -->",
        "# Compare with published compressions",
        INTRODUCTION,
        *(["This is a smoke test: its figures mean nothing."] if short else []),
        "## How to read the tables",
        READING,
        "## Error on the proxy that a method was fitted to",
        OWN,
        table(found, lambda e: e.readings == (e.by,)),
        "## Error that a fit adds to its proxy",
        ADDED,
        added(found),
        "## Error on the other proxies",
        OTHERS,
        table(found, lambda e: e.by not in e.readings),
        *(
            line
            for by in READINGS
            for line in (f"### Judged by {by}", table(found, lambda e, by=by: e.by == by and by not in e.readings))
        ),
        "## Where homofact is ahead, and where not",
        AHEAD,
        behind,
        others,
    ]
    for title, words, rows, made in (
        ("Evaluation speed", SPEED, read(cache), speeds),
        ("Scatter over seeds", SEEDED, rows_of(cache / SEEDS), seeds),
        ("Gain of more bytes", CROWDED, rows_of(cache / LIMITS), limits),
    ):
        if rows:
            page += [f"## {title}", words, made(rows)]

    def truth(material: str):
        return kept(cache, material, "nbrdf", _missing).values

    return [
        *page,
        "## The published order",
        ORDER,
        order(found),
        SGD,
        zones(found, truth, "nbrdf"),
        "## Limits",
        LIMITATIONS,
        "## Materials and settings",
        f"Every method is fitted to {DEFAULT_COUNT} pairs of a proxy (scheme `{DEFAULT_SCHEME}`) and judged on {PAIRS}"
        f" other pairs, with seed 0. Machine: {machine()}.",
        f"{count} of {len(every)} materials: {', '.join(m for m in every if m in done)}.",
    ]


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
