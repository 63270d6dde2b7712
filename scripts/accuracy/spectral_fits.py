"""Fit the Cornell paints in 31 bands by few basis vectors: bytes, ranks, and CIEDE2000 under D65, A and F11.

    python scripts/accuracy/spectral_fits.py [--data FOLDER] [--sizes 16,32] [--seeds 3] [--tolerance 0.5]
        [--out FILE.md] [--short]

Each paint is fitted as RGB, in all its 31 bands, and in all bands with a spectral basis of that tolerance, by the same
settings on the same four fifths of its samples. Differences are CIEDE2000 of π f (`brdf.colour_difference`):

- to the measurement, at the held-out samples: median and 95th percentile. RGB is what it is under every light, so that
  under A and F11 it is compared as an observer adapted to the light would see it.
- of the basis to the fit of all bands: mean and 95th percentile at the held-out samples, and over a sphere under a
  lamp, also under illuminants that the choice of the basis does not know.
- by rank: the mean that vectors leave at the held-out samples, the largest of D65, A and F11, beside that of plain
  principal components of the logarithms.

Figures are means over the seeds, each with a split of its own. CPU seconds are those of the process.
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np
import torch

from homofact.brdf.cielab import ciede2000
from homofact.brdf.colour_difference import ILLUMINANTS, lab_of, lab_of_xyz
from homofact.brdf.pair_density import over_discs
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, open_source
from homofact.brdf.spectral import xyz_weights
from homofact.brdf.tristimulus import to_xyz
from homofact.brdf.wavelengths import spectrum_of
from homofact.evaluation.machine import machine
from homofact.evaluation.split import Split
from homofact.factor.factorization import Factorization
from homofact.factor.fitted import Fitted
from homofact.factor.spectral_choice import whole_basis
from homofact.factor.spectral_fit import SpectralFit
from homofact.methods.common import in_spectral_basis
from homofact.methods.search import Search
from homofact.rendering.light import DEFAULT_LIGHT
from homofact.rendering.surface import seen_surface

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import cornell_files, data_folder, figure, finish, markdown, parser_of, progress

HELD_OUT, SPHERE, RANKS = 0.2, 96, (1, 2, 3, 4, 5, 6)
# The choice of a basis does not know these: daylight, a wide-band fluorescent lamp, a white LED.
OTHERS = ("D50", "F2", "LED-B3")


@dataclass(frozen=True)
class FittedPaint:
    """One fit of a paint: its CPU seconds, and its differences to the measurement by illuminant."""

    fit: Fitted
    seconds: float
    measured: dict[str, np.ndarray]


@dataclass(frozen=True)
class Seed:
    """The three fits of a paint at one size and seed, and what the basis leaves by illuminant, or by rank."""

    rgb: FittedPaint
    bands: FittedPaint
    basis: FittedPaint
    held_out: dict[str, np.ndarray]
    sphere: dict[str, np.ndarray]
    by_rank: dict[str, list[float]]


def split(source: Source, seed: int) -> tuple[Samples, Samples]:
    """(training samples, held-out samples)."""
    train, test = Split.of(source, HELD_OUT, seed).parts(source)
    assert test is not None
    return train, test


def timed(fit: Callable[[], Fitted]) -> tuple[Fitted, float]:
    """(what was fitted, CPU seconds)."""
    began = time.process_time()
    return fit(), time.process_time() - began


def apart(first: np.ndarray, second: np.ndarray, bands: Sequence[float], illuminants: Sequence[str]) -> dict:
    """CIEDE2000 (N,) of two sets of spectra (N, W), by illuminant."""
    return {each: ciede2000(lab_of(first, bands, each), lab_of(second, bands, each)) for each in illuminants}


def rgb_apart(rgb: torch.Tensor, spectra: np.ndarray, bands: Sequence[float]) -> dict[str, np.ndarray]:
    """CIEDE2000 (N,) of linear sRGB (N, 3) from spectra (N, W), by illuminant, seen after adaptation to it."""
    seen = lab_of_xyz(to_xyz(rgb, ("R", "G", "B")).numpy(), xyz_weights(range(360, 781)).sum(0))
    return {each: ciede2000(seen, lab_of(spectra, bands, each)) for each in ILLUMINANTS}


def on_sphere(fit: Fitted) -> np.ndarray:
    """Apparent spectra (P, W) of a sphere's pixels under one lamp, as much light as the perfect diffuser needs."""
    _, surface = seen_surface(SPHERE, (0.0, 0.0, 1.0))
    wi = surface.frame @ DEFAULT_LIGHT.unit()
    lit = wi[:, 2] > 0
    return (fit.evaluate(wi[lit], surface.wo[lit]) * wi[lit, 2:]).numpy()


def left_by_rank(fit: Factorization, train: Samples, test: Samples, bands: Sequence[float]) -> dict[str, list[float]]:
    """By kind of vectors and rank, the largest mean CIEDE2000 of the three illuminants to the fit of all bands."""
    weights = over_discs(train).double().numpy()
    logs, held = (fit.evaluate_log(each.wi, each.wo).numpy() for each in (train, test))
    middle = weights @ logs / weights.sum()
    whole = whole_basis(logs, weights, fit.transform, bands)
    plain = np.linalg.svd((logs - middle) * np.sqrt(weights)[:, None], full_matrices=False)[2]

    def left(vectors: np.ndarray, dual: np.ndarray) -> float:
        made = middle + (held - middle) @ dual @ vectors
        first, second = (fit.transform.inverse(torch.from_numpy(each)).numpy() for each in (held, made))
        return max(float(each.mean()) for each in apart(first, second, bands, ILLUMINANTS).values())

    return {
        "by colour": [left(whole.vectors[:rank], whole.dual[:, :rank]) for rank in RANKS],
        "plain": [left(plain[:rank], plain[:rank].T) for rank in RANKS],
    }


def fitted(file: Path, method: Search, tolerance: float) -> Seed:
    """All fits of a paint with the settings and the seed of `method`."""
    rgb_source, source = (open_source(str(file), channels=channels) for channels in ("rgb", "spectral"))
    bands = spectrum_of(source.samples.channels)
    rgb_train, rgb_test = split(rgb_source, method.seed)
    train, test = split(source, method.seed)
    truth = test.values.numpy()
    rgb, rgb_seconds = timed(lambda: method.fit(rgb_train).factorization)
    began = time.process_time()
    whole = method.fit(train)
    seconds = time.process_time() - began
    with_basis = replace(method, spectral_tolerance=tolerance)
    basis, more = timed(lambda: in_spectral_basis(whole, train, with_basis).factorization)
    bare = whole.factorization
    assert isinstance(bare, Factorization)
    values = {name: fit.evaluate(test.wi, test.wo).numpy() for name, fit in (("all", bare), ("basis", basis))}
    return Seed(
        FittedPaint(rgb, rgb_seconds, rgb_apart(rgb.evaluate(rgb_test.wi, rgb_test.wo), truth, bands)),
        FittedPaint(bare, seconds, apart(values["all"], truth, bands, ILLUMINANTS)),
        FittedPaint(basis, seconds + more, apart(values["basis"], truth, bands, ILLUMINANTS)),
        apart(values["basis"], values["all"], bands, (*ILLUMINANTS, *OTHERS)),
        apart(on_sphere(basis), on_sphere(bare), bands, ILLUMINANTS),
        left_by_rank(bare, train, test, bands),
    )


def pair(found: Sequence[np.ndarray], middle: Callable[..., Any] = np.mean) -> str:
    """The middle and the 95th percentile, each a mean over the seeds."""
    return f"{mean(float(middle(each)) for each in found):.2f} / {mean(np.percentile(each, 95) for each in found):.2f}"


def worst(found: Sequence[dict[str, np.ndarray]]) -> str:
    """The pair under the illuminant with the largest mean."""
    light = max(ILLUMINANTS, key=lambda each: mean(float(one[each].mean()) for one in found))
    return pair([one[light] for one in found])


def rank_of(fit: Fitted) -> int:
    """How many vectors a fit has."""
    return fit.basis.rank if isinstance(fit, SpectralFit) else len(fit.channels)


def over_seeds(values: Sequence[int]) -> str:
    """A count, or its range over the seeds."""
    return str(values[0]) if min(values) == max(values) else f"{min(values)}-{max(values)}"


def fit_rows(paint: str, size: int, seeds: Sequence[Seed]) -> list[tuple[str, ...]]:
    """A row for each fit."""
    rows = []
    for name, words in (("rgb", "RGB"), ("bands", "all bands"), ("basis", "basis")):
        fits: list[FittedPaint] = [getattr(seed, name) for seed in seeds]
        sizes = [each.fit.nbytes for each in fits]
        times = max(each / seed.rgb.fit.nbytes for each, seed in zip(sizes, seeds, strict=True))
        colours = [pair([each.measured[light] for each in fits], np.median) for light in ILLUMINANTS]
        cells = (over_seeds([rank_of(each.fit) for each in fits]), over_seeds(sizes), f"{times:.2f}")
        seconds = figure(mean(each.seconds for each in fits))
        rows.append((f"{paint}, 2 × {size}²", words, *cells, seconds, *colours))
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables; 1 where no paint is there."""
    parser = parser_of(__doc__, "data", "out")
    parser.add_argument("--sizes", default="16,32", help="texels per side, with commas (%(default)s)")
    parser.add_argument("--seeds", type=int, default=3, help="how many splits (%(default)s)")
    parser.add_argument("--tolerance", type=float, default=0.5, help="the basis's tolerance (%(default)s)")
    options = parser.parse_args(arguments)
    files, missing = cornell_files(data_folder(options.data))
    if not files:
        print("\n".join(missing), file=sys.stderr)
        return 1
    sizes, seeds = [int(size) for size in options.sizes.split(",")], range(options.seeds)
    if options.short:
        files, sizes, seeds = files[:1], [6], range(1)
    method = Search(effort="quick" if options.short else "normal", epsilon=1e-2)
    # What is compiled or loaded once.
    fitted(files[0], replace(method, size=4, effort="quick"), options.tolerance)
    rows, left, ranks = [], [], []
    for file in files:
        for size in sizes:
            found = [fitted(file, replace(method, size=size, seed=seed), options.tolerance) for seed in seeds]
            progress(file.stem, size)
            rows += fit_rows(file.stem, size, found)
            vectors = over_seeds([rank_of(each.basis.fit) for each in found])
            here = [pair([seed.held_out[light] for seed in found]) for light in (*ILLUMINANTS, *OTHERS)]
            left.append((f"{file.stem}, 2 × {size}²", vectors, *here, worst([seed.sphere for seed in found])))
            if size == sizes[0]:
                for kind in ("by colour", "plain"):
                    means = [mean(seed.by_rank[kind][k] for seed in found) for k in range(len(RANKS))]
                    ranks.append((file.stem, kind, *(f"{value:.2f}" for value in means)))
    header = ("paint", "fit", "vectors", "bytes", "times RGB", "CPU s", *ILLUMINANTS)
    lamps = ("paint", "vectors", *ILLUMINANTS, *OTHERS, "sphere")
    conditions = f"Tolerance {options.tolerance:g}, {len(seeds)} splits, ε = {method.epsilon:g}. {machine()}"
    return finish(
        [
            "CIEDE2000 to the measurement at held-out samples, median / 95th percentile:",
            markdown(header, rows, 2),
            "CIEDE2000 of the basis to the fit of all bands at held-out samples, mean / 95th percentile; the sphere's"
            " under the worst of the first three lights:",
            markdown(lamps, left),
            "The largest mean CIEDE2000 under the three lights that vectors leave at held-out samples,"
            f" 2 × {sizes[0]}²:",
            markdown(("paint", "vectors", *map(str, RANKS)), ranks, 2),
            conditions,
        ],
        options,
    )


if __name__ == "__main__":
    sys.exit(main())
