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
the 100 MERL materials, in error, bytes and speed. The published representations are NBRDF (a neural network), NPF
(non-parametric factors), Neural Processes (nps), ABC (a microfacet model) and SGD (shifted gamma distribution); see
the [references](references.bib). The tables also contain methods that homofact fits itself: GGX lobes and McCool's
projections, and for a few materials also NPF ("NPF, fitted here") and NBRDF ("NBRDF, trained here"). The rows
"ours" are homofact's search at three byte budgets. All other settings are the defaults of the version that made
these tables. That version tried every mix of projections. Today the default effort starts from the [known
mixes](known_mixes.md). For measurements instead of published fits, read [Real measurements](real.md). To compare
methods on your own file, run

    homofact compare SOURCE --methods mccool,search,ggx,npf --plot out/methods.png

homofact may not redistribute the MERL measurements. Three published fits of them (nbrdf, npf, nps) serve as
proxies. Each method that homofact fits is fitted to one proxy, and its error is measured against the same proxy or
another one. An error against another proxy includes the error of both proxies. Only the [first
table](#error-on-the-proxy-that-a-method-was-fitted-to), the section [What more bytes gain](#what-more-bytes-gain)
and three columns of [Scatter over seeds](#scatter-over-seeds) measure against the fitted proxy.

![Error against bytes and speed](pictures/compression.png)"""
READING = """\
Each figure is a median over materials. Do not compare rows of 3 or 4 materials with rows of 100 materials. The
figure in brackets is the worse end: a tenth of the materials is worse. It is the 90th percentile of an error, and the
10th percentile of SSIM and PSNR, where larger is better.

- **MALE** is the mean of |log(1 + f cosθi) − log(1 + f̂ cosθi)|, **Cole** the Cole error with ε = 1e-2, and
  **energy** the relative error of the total reflected light in the worst channel ([glossary](glossary.md)). All
  three use the same 20,000 pairs of directions, with θi and θo under 80°.
- **MAE**, **RMSE**, **SSIM** and **PSNR** compare rendered spheres of 96² pixels in sRGB, with values from 0 to 1.
  Each figure is the mean over three skies (studio, St Peter's, Grace).
- **bytes** is the size per material. `nps` also needs a decoder of 4 MB, which all materials share. **fetches** is
  the number of texture lookups per evaluation."""
OWN = """\
This table measures the error of each method against the proxy that it was fitted to. Published tables do the same.
On MERL itself, Sztrajman et al. (2021) report an MAE of .0028 and an SSIM of .995 for NBRDF, and an MAE of .0056
and an SSIM of .990 for NPF. Our targets at 3.2 KiB were an MAE of .0025, an SSIM of .996 and a PSNR of 47 dB. Our
targets for PSNR were 50 dB at 12 KiB and 56 dB at 48 KiB. The medians meet all of them."""
ADDED = """\
This table shows how much error a fit adds to that of its proxy. The row "nbrdf itself" gives the error of nbrdf,
measured against the two other proxies. The rows "… of nbrdf" give the errors of fits to nbrdf, measured against the
same two proxies. The rows for npf and nps work in the same way. "Added by the fit" is the median of the fit's
figure minus its proxy's figure. For MALE and energy, a positive difference means that the fit is worse. For PSNR, a
negative one does. "Fit better in" counts pairs of a material and another proxy. It is the share of pairs in which
the fit is nearer to the other proxy than its own proxy is. homofact adds almost no error at any budget. By MALE and
PSNR, its fits of nbrdf and nps are in most cases even slightly nearer to the other proxies than nbrdf and nps
themselves. A fit has no information beyond its proxy. However, it may not reproduce an error that only its proxy has,
and is then nearer to the other proxies. For comparison, McCool's projections and GGX, fitted to the same proxies, add
a clear error."""
OTHERS = """\
Each published fit is compared with the proxies other than itself. Each method that homofact fits to one proxy is
compared with the two other proxies. In the rows "mean of two proxies", homofact fits the mean of two proxies and
compares with the third. A homofact fit is about as far from the other proxies as its own proxy is. Each row "ours"
pools the fits of all three proxies, and each fit inherits the error of its proxy. The errors of "ours" therefore
lie between the smallest and the largest error of nbrdf, nps and npf. The tables "Judged by …" measure against one
proxy only."""
AHEAD = """\
Each row compares homofact (first figure) with another method (second figure). Both are measured against one proxy,
named in the column "judged by". If the other method is itself a proxy, homofact was fitted to that proxy, so both
have the same information. If the other method was fitted to MERL itself (abc, sgd) or fitted here, the row pools
homofact's fits of the two proxies that are not in "judged by". homofact uses 12 KiB against McCool 12 KiB, and 3.2
KiB against all other methods. One row needs an explanation: abc, judged by npf. Measured against npf, even nbrdf
and nps have a larger MALE than abc. homofact fitted only these two proxies in this row, so its MALE is also larger
than that of abc. Its PSNR is better."""
SPEED = """\
`scripts/compression/compression_speed.py` evaluates every method on the same directions, in one run on one thread.
Each method uses its best batch size. Other work ran on the machine at the same time. M/s is millions of evaluations
per second, as a median over the materials (three by default). "By material" is the range over them. homofact's own
compiler compiles all methods (column "compiler": ours) except nps, which runs in torch."""
SEEDED = """\
`scripts/compression/compression_seeds.py` draws the samples and runs the fit with seeds 0, 1 and 2. The table shows
the mean over the seeds ± the sample standard deviation. All fits are made to nbrdf. MALE, energy and PSNR are
measured against nbrdf, too. "By others" means the mean error against the two other proxies."""
ORDER = """\
Sztrajman et al. (2021, table 1) rank the methods, from worst to best: GGX, SGD, ABC, NPF, NBRDF. The table shows
means over materials. Each method is compared only with proxies that are neither itself nor the one that it was
fitted to."""
SGD = """\
ABC, NPF and NBRDF come out in the published order. SGD does not: it falls behind our GGX fits. Our formula of SGD
is not the reason. We compared it term by term (distribution, masking, the sum, the order of the 33 parameters per
material) with the public implementation from which the parameters come, and both are the same. So the published
parameters are the reason. SGD's distribution falls off like exp(−tan²θh/α). Metals and metallic paints have a
narrow highlight with a long tail. SGD makes such a highlight too wide and too low, and its tail falls to zero where
the tails of the proxies continue. GGX has a long tail. homofact fits GGX to the cube roots of the values, so the
tail keeps a large weight in the fit. The published GGX was fitted differently. The next table shows the mean of
|log(f̂/f)| in four ranges of the half vector's angle θh, where f is nbrdf. Each figure is a median over materials.
The figure in brackets is the share of pairs whose f̂ differs from f by more than a factor of two."""
CROWDED = """\
Measured against the fitted proxy, 48 KiB reduce the error hardly more than 12 KiB.
`scripts/compression/compression_limits.py` repeats the fits and increases one setting at a time. More texels, more
samples, more textures and more search effort all help little. The remaining error comes from the form of the fit.
Each texture has two coordinates, and an isotropic BRDF depends on three. A product of such textures cannot
represent every function of three coordinates. "Highlight" is the RMS difference of log f where θh < 10°. "Rest" is
the same where θh is larger."""
LIMITATIONS = """\
- All errors are measured against proxies, which have errors of their own. The MERL measurements were not used.
- homofact fitted NPF to four materials and NBRDF to three, because these fits are slow. The script fits them only
  on request (`--methods`).
- Other work ran on the machine while the fits were timed. If two byte budgets share one search, its seconds are
  included in the time of both."""


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
        ("What more bytes gain", CROWDED, rows_of(cache / LIMITS), limits),
    ):
        if rows:
            page += [f"## {title}", words, made(rows)]

    def truth(material: str):
        return kept(cache, material, "nbrdf", _missing).values

    return [
        *page,
        "## Check the published ranking of methods",
        ORDER,
        order(found),
        SGD,
        zones(found, truth, "nbrdf"),
        "## Limits",
        LIMITATIONS,
        "## Materials and settings",
        f"Every method is fitted to {DEFAULT_COUNT} pairs of directions, evaluated on a proxy (sampling scheme"
        f" `{DEFAULT_SCHEME}`), and its error is measured at {PAIRS} other pairs. The seed is 0. Machine: {machine()}.",
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
