"""Compare a sum of two products, A₁(exp Σ p₁ − ε) + A₂(exp Σ p₂ − ε), with one product of the same bytes.

A diffuse base beside a lobe is no product, so that plastics and paints are where a sum should gain. For each material:

* one: the default search with 2 textures of 23² and with 3 of 18² (1058 and 972 texels), the better of both;
* constant: a Lambert constant for each channel, TAKEN of the values' darkest 2%, beside the mix of the search with 2
  textures of 23², solved again for what is left;
* two: two products of 2 textures of 16² (1024 texels). One has the mix of the default search with 2 × 16², the other
  stands for the base, (θi, θo)·(θh, θd) without a warp, and starts from the samples with θh over 30°. Then samples are
  split by the current shares, f̂k/Σ f̂, and each product is solved for its part under the default objective, ROUNDS
  times: expectation and maximisation for the divergence of flux, each part by the normal equations that fits have.

Figures are of `evaluation.appearance`, for sums the best of all rounds and shares in each column: a sum that does not
pay by these does not pay.

    python scripts/accuracy/sums_of_products.py [--only NAME ...] [--count 20000] [--data FOLDER] [--out FILE.md]
"""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.evaluation.appearance import appearance
from homofact.evaluation.machine import machine
from homofact.factor.energy import keep_light
from homofact.factor.factorization import Factorization
from homofact.factor.projection import Projection, fixed_projection
from homofact.factor.textures import solve_terms, texture_shape
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.linear.normal import warm_up
from homofact.linear.threads import one_thread
from homofact.methods.common import transform_of
from homofact.methods.search import Search
from homofact.methods.search_data import SearchData

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import data_folder, finish, markdown, parser_of, progress

MATERIALS = {
    "chm_light_blue": "rgl/chm_light_blue_rgb.bsdf",
    "aurora_white": "rgl/aurora_white_rgb.bsdf",
    "vch_golden_yellow": "rgl/vch_golden_yellow_rgb.bsdf",
    "irid_flake_paint1": "rgl/irid_flake_paint1_rgb.bsdf",
} | {
    name: f"nbrdf/merl_nbrdf_weights.npz#{name}"
    for name in ("pink-plastic", "violet-acrylic", "nylon", "gray-plastic", "black-phenolic", "specular-white-phenolic")
}
SIZE, ALIKE = 16, ((2, 23), (3, 18))
ROUNDS, TAKEN = 5, (0.5, 0.9)
BASE = ("theta_i-theta_o", "theta_h-theta_d")
BASE_SMOOTHING = 1e-2
PAYS = 0.9  # a figure of errors at most this of one product's


@dataclass(frozen=True)
class Sum:
    """A `Reflectance` that is the sum of its `parts`; what it takes to store is not asked for."""

    parts: tuple[Callable[[Tensor, Tensor], Tensor], ...]
    channels: tuple[str, ...]
    nbytes: int = 0
    fetches: int = 0

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C)."""
        return torch.stack([part(wi, wo) for part in self.parts]).sum(0)


@dataclass(frozen=True)
class Figures:
    """Relative RMS, how far total energy is off, dB of the sphere under the sky."""

    rms: float
    energy: float
    sky: float

    def best(self, other: "Figures") -> "Figures":
        """The better of both, figure by figure."""
        return Figures(min(self.rms, other.rms), min(self.energy, other.energy), max(self.sky, other.sky))


def figures_of(fit: Sum | Factorization, source: Source) -> Figures:
    """The figures of a fit."""
    found = appearance(fit, source)
    assert found is not None
    return Figures(found.energy.rms, abs(found.energy.energy_overall - 1), found.psnr_sky)


@one_thread
def solved(
    samples: Samples, projections: tuple[Projection, ...], size: int, smoothing: tuple[float, ...], settings: Search
) -> Factorization:
    """Textures for given projections, as the search ends: the masked solve, then the light kept."""
    transform = transform_of(samples, settings)
    data = SearchData.of(samples, transform, settings, knows_azimuth=False)
    shapes = tuple(texture_shape(projection, size) for projection in projections)
    terms = solve_terms(data.judged, projections, shapes, smoothing, settings.solver).terms
    if data.flux is not None:
        terms, _ = keep_light(data.logs, terms, smoothing, data.flux)
    return Factorization(terms, transform, samples.channels)


def mix_of(fit: Factorization) -> tuple[tuple[Projection, ...], tuple[float, ...]]:
    """The projections of a searched fit, and its λ."""
    return tuple(term.projection for term in fit.terms), tuple(fit.provenance["smoothing"])


def searched(samples: Samples, textures: int, size: int, settings: Search) -> Factorization:
    """A default fit."""
    fit = replace(settings, textures=textures, size=size).fit(samples).factorization
    assert isinstance(fit, Factorization)
    return fit


def with_constant(samples: Samples, fit: Factorization, size: int, settings: Search) -> Iterator[Sum]:
    """A constant taken off, the fit's mix solved again for the rest."""
    projections, smoothing = mix_of(fit)
    for share in TAKEN:
        level = share * samples.values.quantile(0.02, 0)
        rest = replace(samples, values=(samples.values - level).clamp_min(0))
        product = solved(rest, projections, size, smoothing, settings)
        yield Sum((product.evaluate, lambda wi, _, level=level: level.expand(len(wi), -1)), samples.channels)


def two_products(samples: Samples, fit: Factorization, settings: Search, rounds: int) -> Iterator[Sum]:
    """The sum after each round of shares and solves."""
    lobe_mix = mix_of(fit)
    reciprocal = lobe_mix[0][0].reciprocal
    base_mix = tuple(fixed_projection(name, reciprocal) for name in BASE), (BASE_SMOOTHING,) * len(BASE)
    theta_h, _, _ = rusinkiewicz_angles(samples.wi, samples.wo)
    base = solved(samples.select(theta_h > torch.pi / 6), base_mix[0], SIZE, base_mix[1], settings)
    under = base.evaluate(samples.wi, samples.wo).clamp_min(0)
    share = (1 - under / samples.values.clamp_min(1e-30)).clamp(0.02, 0.98)
    for _ in range(rounds):
        parts = [
            solved(replace(samples, values=samples.values * part), mix[0], SIZE, mix[1], settings)
            for part, mix in ((share, lobe_mix), (1 - share, base_mix))
        ]
        yield Sum(tuple(part.evaluate for part in parts), samples.channels)
        lobe, under = (part.evaluate(samples.wi, samples.wo).clamp_min(1e-30) for part in parts)
        share = lobe / (lobe + under)


def best_of(sums: Iterator[Sum], source: Source) -> Figures:
    """The best of each figure over several sums."""
    found = [figures_of(each, source) for each in sums]
    best = found[0]
    for other in found[1:]:
        best = best.best(other)
    return best


def told(figures: Figures) -> tuple[str, str, str]:
    """Three cells."""
    return f"{figures.rms:.4f}", f"{100 * figures.energy:.2f}%", f"{figures.sky:.1f}"


def main(arguments: list[str] | None = None) -> int:
    """Print (and with --out write) the table; returns the exit code."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=tuple(MATERIALS), help="these materials alone")
    parser.add_argument("--count", type=int, default=20_000, help="pairs drawn (%(default)s)")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    paths = {name: str(folder / MATERIALS[name]) for name in chosen.only or MATERIALS}
    count, rounds, effort, alike, size = chosen.count, ROUNDS, "normal", ALIKE, SIZE
    if chosen.short:
        paths = {"lafortune-blue-paint": "material:lafortune-blue-paint"}
        count, rounds, effort, alike, size = 400, 1, 5.0, ((1, 5),), 4
    warm_up()
    rows, pays = [], []
    for name, path in paths.items():
        if not path.startswith("material:") and not Path(path.split("#")[0]).is_file():
            print(f"skipped {name}: no {path} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
            continue
        began = time.process_time()
        source = open_source(path, count=count)
        settings = Search(effort=effort, epsilon=source.default_epsilon)
        ones = [searched(source.samples, *shape, settings) for shape in alike]
        one = figures_of(ones[0], source)
        for other in ones[1:]:
            one = one.best(figures_of(other, source))
        constant = best_of(with_constant(source.samples, ones[0], alike[0][1], settings), source)
        small = searched(source.samples, 2, size, settings)
        two = best_of(two_products(source.samples, small, settings, rounds), source)
        rows.append((name, *(cell for each in (one, constant, two) for cell in told(each))))
        for word, other in (("constant", constant), ("two products", two)):
            if other.rms <= PAYS * one.rms:
                pays.append(f"{name}, {word}: RMS {other.rms / one.rms:.2f} of one product's")
        progress(*rows[-1], f"{time.process_time() - began:.0f} s")
    heads = [f"{word}: {what}" for word in ("one", "constant", "two") for what in ("RMS", "energy off", "sky dB")]
    parts = [
        "# Sums of products at equal bytes",
        "Made by `python scripts/accuracy/sums_of_products.py`. One product (the better of 2 textures of 23² and 3"
        " of 18²), a"
        " Lambert constant and one product of 2 × 23², two products of 2 × 16² each; for sums the best of all rounds"
        " and shares, column by column.",
        f"{count} pairs, ε of the source, seed 0. {machine()}",
        markdown(("material", *heads), rows),
        f"Sums that lower the RMS by a tenth or more: {'; '.join(pays) if pays else 'none'}.",
    ]
    return finish(parts, chosen)


if __name__ == "__main__":
    sys.exit(main())
