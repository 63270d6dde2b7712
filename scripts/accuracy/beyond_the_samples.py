"""Measure fits where a goniometer did not: at grazing angles and between its rings, with and without a model there.

    python scripts/accuracy/beyond_the_samples.py [--data FOLDER] [--textures N] [--size N] [--samples N]

Named materials and measured tables (RGL) are "measured" with 1% noise on the rings of a goniometer that ends at 80°
(`interpolated_samples.goniometer`). Of measured lists (Cornell) all samples with θi or θo in the outermost sixth of
their angles are left out. Both are fitted by the search, once as it is, following a GGX model where nothing was
measured (`brdf.quality.extrapolation`), and once without this model. Each row has the Cole error (ε = 0.01) and the
mean squared error on held-out samples within the measured angles, the misplaced light Σ|fit − true| cosθi cosθo over
Σ true at pairs beyond them, and there Σ fit over Σ true. Geometric means are last. With --samples, only so many of the
training samples are fitted, drawn at random.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from statistics import geometric_mean

import torch
from torch import Tensor

from homofact.brdf.formats import read_samples
from homofact.brdf.quality import extrapolation
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source import open_source
from homofact.evaluation.metrics import measure
from homofact.geometry.directions import draw_in_discs
from homofact.methods.search import Search
from scripts.accuracy.interpolated_samples import LAYOUTS, model_of

NAMES = ("lacquer", "copper paint", "cook-torrance-plastic", "lafortune-clay")
LISTS = ("garnet_red", "krylon_blue", "cayman")
NOISE, HELD_OUT, EPSILON = 0.01, 0.2, 0.01
OUTERMOST = 1 / 6  # of the samples by their larger angle
PAIRS = 20_000


def known(data: Path) -> Iterator[tuple[str, Samples, Samples, Samples]]:
    """Yield name, training and held-out samples within the measured angles, and true samples beyond them."""
    tables = sorted((data / "rgl").glob("*.bsdf"))
    for name in (*NAMES, *map(str, tables)):
        model: Reflectance = open_source(name, count=10).reflectance if Path(name).is_file() else model_of(name)
        samples = LAYOUTS["goniometer"](model)
        generator = torch.Generator().manual_seed(1)
        noise = (NOISE * torch.randn(len(samples), 1, generator=generator, dtype=torch.float64)).exp()
        measured = Samples(samples.wi, samples.wo, samples.values * noise, channels=model.channels, isotropic=True)
        wi, wo = draw_in_discs(PAIRS, torch.Generator().manual_seed(2), 0.999)
        beyond = _larger(wi, wo) > _larger(measured.wi, measured.wo).max()
        wi, wo = wi[beyond], wo[beyond]
        true = Samples(wi, wo, model.evaluate(wi, wo).double(), channels=model.channels, isotropic=True)
        yield Path(name).stem, *measured.split(HELD_OUT, seed=0), true
    for name in LISTS:
        samples = read_samples(data / "cornell" / f"{name}.brdf")
        angle = _larger(samples.wi, samples.wo)
        within = angle <= angle.quantile(1 - OUTERMOST)
        yield name, *samples.select(within).split(HELD_OUT, seed=0), samples.select(~within)


def _larger(wi: Tensor, wo: Tensor) -> Tensor:
    """The larger of θi and θo in radians."""
    return torch.acos(torch.minimum(wi[:, 2], wo[:, 2]))


def main() -> None:
    """Print a line per material and fit, and the geometric means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("data"), help="folder with rgl and cornell")
    parser.add_argument("--textures", type=int, default=2)
    parser.add_argument("--size", type=int, default=16)
    parser.add_argument("--samples", type=int, default=None, help="training samples at most (default: all)")
    asked = parser.parse_args()
    surface_of = extrapolation._surface_of
    found: dict[str, list[tuple[float, ...]]] = {}
    print(f"{'material':24} {'fit':10} {'Cole error':>10} {'mse':>10} {'misplaced':>9} {'light':>6}")
    for name, train, held_out, beyond in known(asked.data):
        tests = held_out.rotated_at_random(0)
        train = train if asked.samples is None else train.subset(asked.samples, 0)
        for label in ("no model", "model"):
            extrapolation._surface_of = surface_of if label == "model" else (lambda samples: None)
            fit = Search(textures=asked.textures, size=asked.size, epsilon=EPSILON).fit(train).factorization
            errors = measure(fit, tests, fit.transform).record()
            values, true = fit.evaluate(beyond.wi, beyond.wo), beyond.values
            light = beyond.wi[:, 2:] * beyond.wo[:, 2:]
            misplaced = float((light * (values - true).abs()).sum() / (light * true).sum())
            ratio = float((light * values).sum() / (light * true).sum())
            row = (errors["log_mse"], errors["mse"], misplaced, max(ratio, 1 / ratio))
            found.setdefault(label, []).append(row)
            print(f"{name:24} {label:10} {row[0]:10.5f} {row[1]:10.4g} {misplaced:9.3f} {ratio:6.2f}", flush=True)
    for label, rows in found.items():
        means = [geometric_mean(each) for each in zip(*rows, strict=True)]
        print(
            f"{'geometric mean':24} {label:10} {means[0]:10.5f} {means[1]:10.4g} {means[2]:9.3f}"
            f" light off by a factor of {means[3]:.2f}"
        )


if __name__ == "__main__":
    main()
