"""The field in one table: what the 100 MERL materials become in other methods' few bytes and in ours.

    python scripts/compression_table.py [--every 1] [--methods A,B] [--means] [--out FILE.md] [--plot FILE.png]

MERL itself is not at hand. Three published fits of it are taken as readings (`published_fits`): networks (nbrdf),
factors (npf) and Neural Processes (nps). What was published is scored against the readings that it is not itself; a
method that is fitted here is fitted to one reading, or to the mean of two, and scored against the others. The pairs
and pictures are the same for all; nothing is chosen by hand for a material, all settings are defaults but the bytes.
Errors on the reading that a method was fitted to stand apart.

    MALE      mean |log(1 + f cosθi) − log(1 + f̂ cosθi)| over 20,000 pairs under 80°, uniform on both hemispheres
    Cole      mean squared difference of log((f + εA)/A) over the same, ε = 1e-2, A of the reading
    energy    |Σ f̂ cosθi cosθo / Σ f cosθi cosθo − 1|, the worst channel
    pictures  spheres of 96² under three skies (studio, St Peter's, Grace), filtered without noise, each at one exposure
              chosen from the reading, sRGB: mean absolute and root mean square error, SSIM and PSNR of the sphere's
              pixels, mean of the skies (of PSNR too)

Every material and method is one file in the cache folder, written whole or not at all: the script goes on where it was
stopped.
"""

import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from conditions import data_folder, figure, markdown, parser_of, write
from matplotlib.figure import Figure
from published_fits import PUBLISHED, names, plain, published
from torch import Tensor

from homofact.brdf.analytic.common import RGB, AnalyticModel
from homofact.brdf.names import DEFAULT_COUNT, DEFAULT_SCHEME
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.source import MEASURED_EPSILON
from homofact.errors import BadInput, HomofactError
from homofact.evaluate.image_metrics import psnr, ssim
from homofact.evaluate.machine import machine
from homofact.figures.log_axis import log_y
from homofact.files.archive import read_arrays, write_arrays
from homofact.files.atomic import replace_file
from homofact.geometry.directions import draw_uniform
from homofact.linear.normal import warm_up
from homofact.methods.fitting import Method
from homofact.methods.mccool import McCool
from homofact.methods.models import Ggx
from homofact.methods.search import Search
from homofact.render.environment import read_environment
from homofact.render.filtered import FilteredMaterial, Surroundings
from homofact.render.lobe_patches import DRAFT
from homofact.render.sphere import SphereImage
from homofact.render.tonemap import choose_exposure, displayed

READINGS = ("nbrdf", "npf", "nps")
SKIES = ("studio_small_03_1k", "stpeters_probe_latlong", "grace_probe_latlong")
PAIRS, PIXELS = 20_000, 96
METHODS: dict[str, Method] = {
    "GGX × 1": Ggx(),
    "GGX × 2": Ggx(lobes=2),
    "McCool 3 KiB": McCool(size=11),
    "McCool 12 KiB": McCool(size=22),
    "ours 3.2 KiB": Search(bytes=3276),
    "ours 12 KiB": Search(bytes=12288),
    "ours 48 KiB": Search(bytes=49152),
}
# The order of Sztrajman et al. 2021, table 1, from the worst to the best.
PUBLISHED_ORDER = ("GGX × 1", "sgd", "abc", "npf", "nbrdf")
SCORES = ("MALE", "Cole", "energy", "MAE", "RMSE", "SSIM", "PSNR")
INTRODUCTION = """\
The MERL materials by published fits (NBRDF, NPF, Neural Processes, ABC, SGD: [references](references.bib)), by GGX
and McCool's projections fitted here, and by ours at three budgets of bytes, all other settings defaults. The
measurements themselves are not at hand: three of the published fits stand for them, as readings. A method is judged
by readings that it was not fitted to; each reading's own error is then part of everyone's, and it is large: the
readings differ from each other by more than ours differs from any of them, so that 3.2, 12 and 48 KiB of ours come
out alike. What a method makes of the reading that it was fitted to stands at the end: so do published tables judge.

MALE, Cole error (ε = 1e-2) and energy of 20,000 pairs under 80°; MAE, RMSE, SSIM and PSNR of spheres under three
skies. `nps` needs a decoder of 4 MB beside its 28 bytes.

![Error against bytes](pictures/compression.png)"""
_PARTS = ("values", "pictures", "facts")


@dataclass(frozen=True)
class Mean:
    """The mean of readings, to be fitted."""

    readings: tuple[AnalyticModel, ...]
    isotropic: bool = True
    channels: tuple[str, ...] = RGB
    nbytes: int = 0
    fetches: int = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Their mean (N, 3) in sr⁻¹."""
        return torch.stack([each.evaluate(wi, wo).to(torch.float64) for each in self.readings]).mean(0)


@dataclass(frozen=True)
class Shown:
    """What a material becomes by a method: values at `pairs` (N, 3), pictures (S, P, P, 3), and what it costs."""

    values: Tensor
    pictures: Tensor
    nbytes: float
    fetches: float
    seconds: float


@cache
def pairs() -> tuple[Tensor, Tensor]:
    """The pairs of directions, both under 80°."""
    wi, wo = draw_uniform(2 * PAIRS, torch.Generator().manual_seed(20261122))
    under = (wi[:, 2] > math.cos(math.radians(80))) & (wo[:, 2] > math.cos(math.radians(80)))
    return wi[under][:PAIRS], wo[under][:PAIRS]


@cache
def surroundings(folder: Path) -> tuple[Surroundings, ...]:
    """The three skies for pictures of this size."""
    lights = (read_environment(folder / "envmaps" / f"{name}.hdr") for name in SKIES)
    return tuple(Surroundings.of(light, PIXELS, fineness=DRAFT) for light in lights)


def shown(reflectance: Reflectance, folder: Path, seconds: float) -> Shown:
    """Ask a reflectance for everything that is scored."""
    wi, wo = pairs()
    material = FilteredMaterial.of(reflectance, fineness=DRAFT)
    pictures = torch.stack([material.under(each).radiance for each in surroundings(folder)])
    values = reflectance.evaluate(wi, wo).to(torch.float64)
    return Shown(values, pictures, reflectance.nbytes, reflectance.fetches, seconds)


def fitted(reading: AnalyticModel | Mean, method: Method) -> tuple[Reflectance, float]:
    """(the fit of a reading by a method, seconds)."""
    samples = sample_model(reading, DEFAULT_COUNT, DEFAULT_SCHEME, 0)
    began = time.perf_counter()
    found = method.fit(samples)
    return found.factorization, time.perf_counter() - began


def kept(cache_folder: Path, material: str, label: str, make: Callable[[], Shown]) -> Shown:
    """What is in the cache, or made now."""
    place = _place(cache_folder, material, label)
    if place.is_file():
        found = read_arrays(place, place.read_bytes(), _PARTS, "what this script wrote")
        values, pictures, facts = (torch.from_numpy(found[name]) for name in _PARTS)
        return Shown(values.double(), pictures.double(), *facts.tolist())
    made = make()
    place.parent.mkdir(parents=True, exist_ok=True)
    facts = np.array([made.nbytes, made.fetches, made.seconds])
    write_arrays(
        place, {"values": made.values.float().numpy(), "pictures": made.pictures.float().numpy(), "facts": facts}
    )
    return kept(cache_folder, material, label, make)


def _place(cache_folder: Path, material: str, label: str) -> Path:
    return cache_folder / plain(material) / f"{plain(label)}.npz"


def scores(truth: Shown, found: Shown, coverage: Tensor) -> dict[str, float]:
    """`SCORES` of one method on one material."""
    wi, wo = pairs()
    cosine = wi[:, 2:]
    a, b = truth.values, found.values
    mean = a.mean(0).clamp_min(1e-12)
    logs = [torch.log((x + MEASURED_EPSILON * mean) / mean) for x in (a, b)]
    light = [(x * cosine * wo[:, 2:]).sum(0) for x in (a, b)]
    pictures: list[tuple[float, ...]] = []
    for theirs, mine in zip(truth.pictures, found.pictures, strict=True):
        exposure = choose_exposure(SphereImage(theirs, coverage))
        p, q = (displayed(SphereImage(x, coverage), exposure) for x in (theirs, mine))
        inside = coverage > 0
        off = (p - q)[inside]
        rmse = float(off.square().mean().sqrt())
        pictures.append((float(off.abs().mean()), rmse, ssim(p, q, inside), min(psnr(p, q, inside), 100.0)))
    means = [statistics.fmean(column) for column in zip(*pictures, strict=True)]
    return {
        "MALE": float((torch.log1p(b * cosine) - torch.log1p(a * cosine)).abs().mean()),
        "Cole": float((logs[1] - logs[0]).square().mean()),
        "energy": float((light[1] / light[0].clamp_min(1e-12) - 1).abs().max()),
    } | dict(zip(SCORES[3:], means, strict=True))


@dataclass(frozen=True)
class Entry:
    """One method on one material: fitted to `readings` (the published one: itself), judged by another `by`."""

    material: str
    label: str
    readings: tuple[str, ...]
    by: str
    shown: Shown
    scores: dict[str, float]


def entries(material: str, labels: Sequence[str], means: bool, cache_folder: Path, folder: Path) -> Iterable[Entry]:
    """Everything on one material."""
    sources = {kind: published(kind, material, folder) for kind in PUBLISHED}
    here = {
        kind: kept(cache_folder, material, kind, lambda kind=kind: shown(sources[kind], folder, math.nan))
        for kind in PUBLISHED
    }
    coverage = surroundings(folder)[0].coverage
    for kind in PUBLISHED:
        for by in READINGS:
            if by != kind:
                yield Entry(material, kind, (kind,), by, here[kind], scores(here[by], here[kind], coverage))
    fits = [(label, (reading,)) for label in labels for reading in READINGS]
    if means:
        two = [tuple(kind for kind in READINGS if kind != by) for by in READINGS]
        fits += [(label, both) for label in labels for both in two]
    for label, both in fits:

        def make(label: str = label, both: tuple[str, ...] = both) -> Shown:
            reading = sources[both[0]] if len(both) == 1 else Mean(tuple(sources[kind] for kind in both))
            fit, seconds = fitted(reading, METHODS[label])
            return shown(fit, folder, seconds)

        try:
            found = kept(cache_folder, material, f"{label} of {'+'.join(both)}", make)
        except HomofactError as error:
            print(f"{material}, {label} of {'+'.join(both)}: {error}", file=sys.stderr)
            continue
        for by in READINGS:
            yield Entry(material, label, both, by, found, scores(here[by], found, coverage))


def table(found: Sequence[Entry], by: str | None, own: bool) -> str:
    """Median and worse tenth over materials, judged by one reading, or by all of them."""
    rows = []
    for label in dict.fromkeys((*PUBLISHED, *METHODS)):
        for several in (1, 2):
            those = [e for e in found if e.label == label and len(e.readings) == several]
            those = [e for e in those if (e.by in e.readings) is own and by in (None, e.by)]
            if not those:
                continue
            words = label + (" (mean of two readings)" if several == 2 else "")
            columns = []
            for name in SCORES:
                values = sorted(e.scores[name] for e in those)
                tenth = values[round(0.1 * (len(values) - 1))] if name in ("PSNR", "SSIM") else None
                worse = tenth if tenth is not None else values[round(0.9 * (len(values) - 1))]
                columns.append(f"{figure(statistics.median(values))} ({figure(worse)})")
            seconds = [e.shown.seconds for e in those if not math.isnan(e.shown.seconds)]
            spent = figure(statistics.median(seconds)) if seconds else "–"
            rows.append((words, f"{statistics.median(e.shown.nbytes for e in those):.0f}", *columns, spent))
    return markdown(("method", "bytes", *SCORES, "fit, s"), rows)


def order(found: Sequence[Entry]) -> str:
    """Whether the published order comes out: the mean of each score, judged by what is not itself."""
    rows = []
    for label in PUBLISHED_ORDER:
        those = [e for e in found if e.label == label and len(e.readings) == 1 and e.by not in e.readings]
        if those:
            rows.append((label, *(figure(statistics.fmean(e.scores[name] for e in those)) for name in SCORES)))
    return markdown(("worst first, as published", *SCORES), rows)


def draw(path: Path, found: Sequence[Entry]) -> None:
    """Error against bytes: the median of PSNR and of MALE, judged by readings that a method was not fitted to."""
    chart = Figure(figsize=(10, 4.6), layout="constrained")
    axes = chart.subplots(1, 2)
    groups = [[label] for label in PUBLISHED]
    groups += [[label for label in METHODS if label.split()[0] == name] for name in ("GGX", "McCool", "ours")]
    for axis, name in zip(axes, ("PSNR", "MALE"), strict=True):
        for labels in groups:
            points = []
            for label in labels:
                those = [e for e in found if e.label == label and len(e.readings) == 1 and e.by not in e.readings]
                if those:
                    nbytes = statistics.median(e.shown.nbytes for e in those)
                    points.append((nbytes, statistics.median(e.scores[name] for e in those)))
            if not points:
                continue
            colour = "#1f4e79" if labels[0].startswith("ours") else "#b2521b" if labels[0] in PUBLISHED else "#777777"
            axis.plot(*zip(*points, strict=True), "o-", color=colour, linewidth=1)
            words = labels[0] if len(labels) == 1 else labels[0].split()[0]
            words = "nps, and 4 MB that all share" if words == "nps" else words
            axis.annotate(words, points[0], xytext=(5, 5), textcoords="offset points", fontsize=9)
        axis.set_xscale("log")
        axis.set_xlabel("bytes a material")
        axis.set_ylabel("PSNR of the spheres [dB], more is better" if name == "PSNR" else "MALE, less is better")
        axis.margins(x=0.2, y=0.12)
        axis.spines[["top", "right"]].set_visible(False)
    log_y(axes[1], *axes[1].get_ylim())
    words = "GGX with one and two lobes, McCool's projections and ours at several sizes"
    chart.suptitle(f"Median over materials, judged by readings that a method was not fitted to\n{words}", fontsize=10)
    replace_file(path, lambda made: chart.savefig(made, dpi=120, format="png"))


def main(arguments: list[str] | None = None) -> int:
    """Fill the cache, print the tables, write and draw them where it is asked for."""
    parser = parser_of(__doc__)
    parser.add_argument("--every", type=int, default=1, help="every so many materials alone")
    parser.add_argument("--methods", default=",".join(METHODS), help="of those that are fitted here")
    parser.add_argument("--means", action="store_true", help="fit the mean of two readings too")
    parser.add_argument("--done", action="store_true", help="only materials of which all is in the cache")
    parser.add_argument("--cache", type=Path, default=Path("out/compression"), help="the folder of what is done")
    parser.add_argument("--data", type=Path, help="the folder of real measurements")
    parser.add_argument("--out", type=Path, help="a Markdown file of the tables")
    parser.add_argument("--plot", type=Path, help="a PNG of error against bytes")
    options = parser.parse_args(arguments)
    folder = data_folder(options.data)
    warm_up()
    labels = [name.strip() for name in options.methods.split(",") if name.strip()]
    unknown = [name for name in labels if name not in METHODS]
    if unknown:
        raise BadInput(f"methods: found {unknown[0]!r}, expected some of {', '.join(METHODS)}")
    chosen = names(folder)[:: options.every]
    if options.short:
        chosen, labels = chosen[:1], ["GGX × 1"]
    if options.done:
        wanted = [*PUBLISHED, *(f"{label} of {reading}" for label in labels for reading in READINGS)]
        chosen = [m for m in chosen if all(_place(options.cache, m, each).is_file() for each in wanted)]
    found: list[Entry] = []
    for number, material in enumerate(chosen, 1):
        began = time.perf_counter()
        found += entries(material, labels, options.means, options.cache, folder)
        print(
            f"{number} of {len(chosen)}: {material}, {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True
        )
    parts = [
        "<!-- Made by `python scripts/compression_table.py`: change the words there, not here. -->",
        "# The field in one table",
        INTRODUCTION,
        f"{len(chosen)} of 100 materials: {', '.join(chosen) if len(chosen) < 100 else 'all'}.",
        f"Fits of {DEFAULT_COUNT} pairs ({DEFAULT_SCHEME}) of a reading, seed 0. {machine()}",
        *(["a smoke test: the figures mean nothing"] if options.short else []),
        "## Judged by readings that a method was not fitted to: median (worse tenth)",
        table(found, None, own=False),
        *(line for by in READINGS for line in (f"### by {by}", table(found, by, own=False))),
        "## The published order (Sztrajman et al. 2021, table 1), means",
        order(found),
        "## On the reading that a method was fitted to",
        table(found, None, own=True),
    ]
    text = "\n\n".join(parts) + "\n"
    print(text)
    if options.out:
        write(options.out, text)
    if options.plot:
        draw(options.plot, found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
