"""Compare `--bytes` with a given number and size of textures where a measurement has few samples.

    python scripts/accuracy/bytes_on_few_samples.py                   # all of it: some ten minutes of one processor
    python scripts/accuracy/bytes_on_few_samples.py --rows 600 --materials phong-30
    python scripts/accuracy/bytes_on_few_samples.py --one-fold        # layouts chosen as for many samples

Materials of which all values are known are "measured" without noise on rings or at random directions. Each row of the
table is a fit: the error on its held-out samples, the error on 20,000 directions that nobody measured (cosine-weighted,
θ up to 75°), and whether the verdict warns. Last come the geometric means of both errors over all fits by `--bytes`.
"""

import argparse
import math
import sys
from dataclasses import dataclass
from statistics import geometric_mean, median
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.analytic import CookTorrance
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.source import Source, source_of
from homofact.evaluation.compare import ComparisonRow, fit_and_measure
from homofact.evaluation.metrics import measure
from homofact.evaluation.wording import figure, shapes
from homofact.geometry.directions import draw_cosine_weighted, draw_in_discs, from_spherical
from homofact.methods import shapes as layouts
from homofact.methods.search import Search

_STEEPEST = 75  # degrees
_TESTS = 20_000
# The pigment under a coat of data_synthetic/synthetic_cornell.brdf in three bands.
_PIGMENT = CookTorrance((0.1, 0.37, 0.09), (1.0, 1.0, 1.0), 0.12, 0.05)
MATERIALS = ("pigment", "lafortune-blue-paint", "cook-torrance-plastic", "phong-30", "car-paint-red")
ROWS = (150, 300, 600, 1200)
LAYOUTS = ("rings", "random")
METHODS: dict[str, dict[str, Any]] = {
    "--bytes 3072": {"bytes": 3072},
    "--textures 1 --size 16": {"textures": 1, "size": 16},
    "--bytes 6144": {"bytes": 6144},
    "--textures 2 --size 16": {"textures": 2, "size": 16},
    "--bytes 12288": {"bytes": 12288},
}


@dataclass(frozen=True)
class Trial:
    """A fit of a measurement of a material, and its error on directions that nobody measured."""

    about: tuple[str, str, int]
    method: str
    row: ComparisonRow
    truth: float

    @property
    def line(self) -> str:
        """The trial as a row of a table."""
        name, layout, rows = self.about
        held, train = self.row.held_out.log_mse, self.row.train.log_mse
        fitted = self.row.factorization
        sizes = shapes([texture.texels.shape[:2] for texture in fitted.textures])
        warned = "warns" if self.row.verdict.alarm.given else ""
        return (
            f"{name:22} {layout:7} {rows:5} {self.method:23} {sizes:22} {fitted.nbytes:6}"
            f" {figure(train):>9} {figure(held):>9} {figure(self.truth):>9} {warned}"
        )


def model_of(name: str) -> Reflectance:
    """Return the reflectance of one of `MATERIALS`."""
    return _PIGMENT if name == "pigment" else material(name).model


def directions(layout: str, rows: int) -> tuple[Tensor, Tensor]:
    """Return (wi, wo) of about so many rows up to 75°: on rings of light and viewer, or at random."""
    if layout == "random":
        return draw_in_discs(rows, torch.Generator().manual_seed(7), math.sin(math.radians(_STEEPEST)) ** 2)
    lights = max(3, round((rows / 8) ** (1 / 3)))
    views, azimuths = 2 * lights, math.ceil(rows / (2 * lights * lights))
    light, view, azimuth = torch.meshgrid(
        torch.linspace(5, _STEEPEST, lights, dtype=torch.float64),
        torch.linspace(0, _STEEPEST, views, dtype=torch.float64),
        torch.linspace(0, 180, azimuths, dtype=torch.float64),
        indexing="ij",
    )
    light, view, azimuth = (torch.deg2rad(each.reshape(-1)) for each in (light, view, azimuth))
    return from_spherical(light, torch.zeros_like(light)), from_spherical(view, azimuth)


def measured(name: str, layout: str, rows: int) -> Source:
    """Return a measurement of a material without noise."""
    wi, wo = directions(layout, rows)
    model = model_of(name)
    return source_of(Samples(wi, wo, model.evaluate(wi, wo), isotropic=True))


def tests_of(name: str) -> Samples:
    """Return values of a material at directions that no measurement has."""
    wi, wo = draw_cosine_weighted(2 * _TESTS, torch.Generator().manual_seed(11))
    kept = torch.minimum(wi[:, 2], wo[:, 2]) > math.cos(math.radians(_STEEPEST))
    wi, wo = wi[kept][:_TESTS], wo[kept][:_TESTS]
    return Samples(wi, wo, model_of(name).evaluate(wi, wo), isotropic=True)


def main() -> None:
    """Fit all that is asked for, print a line per fit and the medians by rows and method."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--materials", nargs="+", default=MATERIALS, choices=MATERIALS)
    parser.add_argument("--rows", nargs="+", type=int, default=ROWS)
    parser.add_argument("--layouts", nargs="+", default=LAYOUTS, choices=LAYOUTS)
    parser.add_argument("--methods", nargs="+", default=tuple(METHODS), choices=tuple(METHODS))
    parser.add_argument("--one-fold", action="store_true", help="choose layouts of few samples as those of many")
    asked = parser.parse_args()
    if asked.one_fold:
        layouts._FEW = 0
    trials = []
    print(f"{'material':22} {'layout':7} {'rows':>5} {'options':23} {'textures':22} {'bytes':>6}"
          f" {'training':>9} {'held out':>9} {'truth':>9}")  # fmt: skip
    for name in asked.materials:
        tests = tests_of(name)
        for layout in asked.layouts:
            for rows in asked.rows:
                source = measured(name, layout, rows)
                for method in asked.methods:
                    row = fit_and_measure(source, Search(**METHODS[method], effort="quick"))
                    truth = measure(row.factorization, tests, row.factorization.transform).log_mse
                    trials.append(Trial((name, layout, rows), method, row, truth))
                    print(trials[-1].line)
                    sys.stdout.flush()
    print(f"\n{'rows':>5} {'options':23} {'bytes':>6} {'held out':>9} {'truth':>9} {'warned':>7}")
    for rows in asked.rows:
        for method in asked.methods:
            some = [each for each in trials if each.about[2] == rows and each.method == method]
            warned = sum(each.row.verdict.alarm.given for each in some)
            nbytes = median(each.row.factorization.nbytes for each in some)
            held, truth = (median(values) for values in ([each.row.held_out.log_mse for each in some],
                                                         [each.truth for each in some]))  # fmt: skip
            print(f"{rows:5} {method:23} {nbytes:6.0f} {figure(held):>9} {figure(truth):>9} {warned:4} of {len(some)}")
    chosen = [each for each in trials if "bytes" in METHODS[each.method]]
    if chosen:
        held, truth = (geometric_mean(values) for values in ([each.row.held_out.log_mse for each in chosen],
                                                             [each.truth for each in chosen]))  # fmt: skip
        warned = sum(each.row.verdict.alarm.given for each in chosen)
        print(f"\n{len(chosen)} fits by --bytes, geometric means: held out {figure(held)}, truth {figure(truth)};"
              f" {warned} warned")  # fmt: skip


if __name__ == "__main__":
    main()
