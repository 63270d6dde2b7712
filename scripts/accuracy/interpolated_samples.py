"""Measure how well scattered samples are interpolated, over several coordinates.

    python scripts/accuracy/interpolated_samples.py                  # of anisotropic samples: some four minutes
    python scripts/accuracy/interpolated_samples.py --materials steel --layouts rings
    python scripts/accuracy/interpolated_samples.py --isotropic      # of isotropic ones: under a minute
    python scripts/accuracy/interpolated_samples.py --isotropic --materials A.bsdf --layouts goniometer
    python scripts/accuracy/interpolated_samples.py --files A.brdf   # of measured isotropic samples, 20% held out

Materials of which all values are known, also measured tables, are "measured" without noise. Each row is an
interpolation, judged at other directions: the RMS of the logarithms, the misplaced light Σ|found − true| f cosθo over
Σ true, and the total light over the true one at three angles of incidence. Last come the geometric means of the first
two over all rows.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import geometric_mean

import numpy as np
import torch
from torch import Tensor

from homofact.brdf import places, scattered
from homofact.brdf.analytic import Ward
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.formats import read_samples
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.scattered import Scattered
from homofact.brdf.source import open_source
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_in_discs, from_spherical

_STEEL = Ward((0.03, 0.03, 0.025), (0.55, 0.53, 0.48), 0.09, 0.22)
_SATIN = Ward((0.2, 0.1, 0.1), (0.1, 0.1, 0.1), 0.3, 0.6)
NAMED = ("ward-brushed", "ashikhmin-shirley-wang", "phong-30", "lafortune-clay")
MATERIALS = (*NAMED, "steel", "satin")
_TRUE_ANGLES = (12, 42, 57)
_DIRECTIONS = "both directions"
_FULL, _ALONE, _WEIGHTED = "full azimuth", "without a model", "with a model"
# Of these, `--isotropic` takes samples that are known to be isotropic.
ISOTROPIC = (
    "cook-torrance-plastic", "phong-10", "phong-30", "blinn-phong-50", "torrance-sparrow-20", "car-paint-red",
    "lafortune-clay", "lacquer", "copper paint",
)  # fmt: skip
_COATING = GgxLobe((1.0, 1.0, 1.0), 0.06, 0.045)
_LACQUER = GgxBrdf((0.02, 0.08, 0.29), (_COATING,))
_COPPER = GgxBrdf(
    (0.08, 0.03, 0.01), (_COATING, GgxLobe((0.45, 0.25, 0.15), 0.3, 1.0), GgxLobe((0.2, 0.1, 0.1), 0.6, 0.9))
)


def rings(model: Reflectance, lights: tuple[int, ...], turns: tuple[int, ...], steps: tuple[int, int]) -> Samples:
    """Return samples of a goniometer: θi, φi, and the steps of θo up to 80° and of φo, in degrees."""
    grid = torch.meshgrid(
        *(torch.tensor(each, dtype=torch.float64) for each in (lights, turns)),
        torch.arange(0, 81, steps[0], dtype=torch.float64),
        torch.arange(0, 360, steps[1], dtype=torch.float64),
        indexing="ij",
    )
    theta_i, phi_i, theta_o, phi_o = (torch.deg2rad(each.reshape(-1)) for each in grid)
    return _measured(model, from_spherical(theta_i, phi_i), from_spherical(theta_o, phi_o))


def drawn(model: Reflectance, count: int) -> Samples:
    """Return samples at random directions."""
    return _measured(model, *draw_in_discs(count, torch.Generator().manual_seed(1), 0.95))


def goniometer(model: Reflectance) -> Samples:
    """Return samples at coarse rings and, in steps of half a degree, across highlights in the plane of incidence."""
    angles = [(x, y, z) for x in (0, 15, 30, 45, 60, 70) for y in range(0, 81, 5) for z in range(0, 181, 10)]
    angles += [(x, x + step / 2, 180) for x in (15, 30, 45, 60, 70) for step in range(-12, 13) if x + step / 2 <= 82]
    theta_i, theta_o, turn = torch.deg2rad(torch.tensor(sorted(set(angles)), dtype=torch.float64)).T
    return _measured(model, from_spherical(theta_i, 0 * theta_i), from_spherical(theta_o, turn))


LAYOUTS: dict[str, Callable[[Reflectance], Samples]] = {
    "rings": lambda model: rings(model, (5, 20, 35, 50, 65), (0, 30, 60, 90), (5, 10)),
    "coarse rings": lambda model: rings(model, (10, 30, 50, 70), (0, 45, 90), (10, 20)),
    "goniometer": goniometer,
    "one azimuth": lambda model: rings(model, (5, 20, 35, 50, 65), (0,), (5, 10)),
    "5,000 random": lambda model: drawn(model, 5000),
    "1,500 random": lambda model: drawn(model, 1500),
}


def model_of(name: str) -> Reflectance:
    """Return the reflectance of one of `MATERIALS` or `ISOTROPIC`, or of a measured table's file."""
    if Path(name).is_file():
        return open_source(name, count=10).reflectance
    own = {"steel": _STEEL, "satin": _SATIN, "lacquer": _LACQUER, "copper paint": _COPPER}
    return own.get(name) or material(name).model


class _OverDirections(Scattered):
    """An interpolation over the parabolic coordinates of both directions."""

    def _place(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        return coordinate_system("in-out").evaluate(wi, wo).numpy()


class _FullAzimuth(Scattered):
    """An interpolation of isotropic samples over (√θh, θd, φd), φd at its full weight everywhere."""

    def _place(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        unit = (coordinate_system("isotropic-half-diff").evaluate(wi, wo) + 1) / 2
        return torch.cat((unit[:, :1].clamp_min(0).sqrt(), unit[:, 1:]), 1).numpy()


def interpolated(samples: Samples, coordinates: str) -> Reflectance:
    """Return the interpolation of samples over coordinates of `--coordinates`."""
    if coordinates == _DIRECTIONS:
        return _OverDirections(samples)
    if samples.isotropic:
        if coordinates == _FULL:
            return _FullAzimuth(samples, lobes=0)
        return Scattered(samples, lobes=0) if coordinates == _ALONE else Scattered(samples)
    places._DIFFERENCE, places._TURN = map(float, coordinates.split(","))
    return Scattered(samples)


def main() -> None:
    """Print a line per interpolation and the geometric means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--materials", nargs="+", default=(), help="names, or files of isotropic tables")
    parser.add_argument("--layouts", nargs="+", default=(), choices=tuple(LAYOUTS))
    parser.add_argument(
        "--coordinates", nargs="+", default=(_DIRECTIONS, "0.5,0.25", "0.5,0.1", "1,0.1"),
        help="weights of the difference vector's angle and of its azimuth",
    )  # fmt: skip
    parser.add_argument("--isotropic", action="store_true", help="isotropic materials, measured from one azimuth")
    parser.add_argument("--files", nargs="+", default=(), help="measurements of isotropic materials, over three splits")
    asked = parser.parse_args()
    if asked.files:
        _of_files(asked.files)
        return
    if asked.isotropic:
        asked.materials, asked.coordinates = asked.materials or ISOTROPIC, (_FULL, _ALONE, _WEIGHTED)
        asked.layouts = asked.layouts or ("goniometer", "one azimuth", "5,000 random", "1,500 random")
    asked.materials = asked.materials or MATERIALS
    asked.layouts = asked.layouts or [name for name in LAYOUTS if name != "goniometer"]
    found: dict[str, list[tuple[float, float]]] = {}
    print(f"{'material':22} {'samples':13} {'coordinates':16} {'log RMS':>8} {'misplaced':>9}  light at 12, 42, 57°")
    for name in asked.materials:
        model = model_of(name)
        for layout in asked.layouts:
            samples = replace(LAYOUTS[layout](model), isotropic=asked.isotropic)
            tests = rings(model, _TRUE_ANGLES, (0,) if layout in ("one azimuth", "goniometer") else (15, 75), (4, 9))
            for coordinates in asked.coordinates:
                log_rms, misplaced, light = _judged(interpolated(samples, coordinates), samples, tests)
                found.setdefault(coordinates, []).append((log_rms, misplaced))
                ratios = ", ".join(f"{ratio:.2f}" for ratio in light)
                print(
                    f"{Path(name).stem[:22]:22} {layout:13} {coordinates:16} {log_rms:8.3f} {misplaced:9.3f}  {ratios}",
                    flush=True,
                )
    for coordinates, rows in found.items():
        means = [geometric_mean(each) for each in zip(*rows, strict=True)]
        print(f"{coordinates:16} geometric means: log RMS {means[0]:.3f}, misplaced light {means[1]:.1%}")


def _of_files(files: Sequence[str]) -> None:
    """Print the mean squared log error (ε = 0.01) and the misplaced light at held-out samples, turned at random."""
    print(f"{'file':22} {'weight of φd':>12} {'log MSE':>8} {'misplaced':>9}")
    for name in files:
        samples = read_samples(name)
        for weight in (_FULL, 0.5, 1.0):
            rows = []
            for seed in range(3):
                training, held_out = samples.split(0.2, seed=seed)
                tests = held_out.rotated_at_random(seed)
                scattered.READ_AZIMUTH = weight
                found = _FullAzimuth(training, lobes=0) if weight == _FULL else Scattered(training)
                values, epsilon = found.evaluate(tests.wi, tests.wo), 1e-2 * training.values.mean(0)
                apart = torch.log(values + epsilon) - torch.log(tests.values + epsilon)
                light = tests.wi[:, 2:] * tests.wo[:, 2:]
                misplaced = (light * (values - tests.values).abs()).sum() / (light * tests.values).sum()
                rows.append((float(apart.square().mean()), float(misplaced)))
            log_mse, misplaced = np.mean(rows, 0)
            print(f"{Path(name).name:22} {weight!s:>12} {log_mse:8.4f} {misplaced:9.4f}")


def _measured(model: Reflectance, wi: Tensor, wo: Tensor) -> Samples:
    return Samples(wi, wo, model.evaluate(wi, wo).double(), isotropic=False)


def _judged(reflectance: Reflectance, samples: Samples, tests: Samples) -> tuple[float, float, list[float]]:
    values, true = reflectance.evaluate(tests.wi, tests.wo), tests.values
    epsilon = 1e-2 * samples.values.mean(0)
    apart = torch.log(values + epsilon) - torch.log(true + epsilon)
    weight = (tests.wo[:, 2] * torch.hypot(tests.wo[:, 0], tests.wo[:, 1]))[:, None]
    misplaced = float((weight * (values - true).abs()).sum() / (weight * true).sum())
    degrees = torch.rad2deg(torch.acos(tests.wi[:, 2])).round()
    light = []
    for angle in _TRUE_ANGLES:
        inside = degrees == angle
        light.append(float((weight * values)[inside].sum() / (weight * true)[inside].sum()))
    return math.sqrt(float(apart.square().mean())), misplaced, light


if __name__ == "__main__":
    main()
