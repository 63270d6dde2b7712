"""Measure the noise of importance sampling: relative variance of f cosθi/p, and noise of Mitsuba's pictures.

    python scripts/engines/sampling_noise.py [--data FOLDER] [--effort quick] [--size 300] [--spp 64] [--short]

Each RGL file is fitted straightened and as it is, with three textures of 32². One direction is drawn for a viewer at
each angle (azimuth 0.4 rad): by the cosine, from a cosine and one GGX lobe with visible normals, from the density of
the shaders and of the Mitsuba material (`shading.lobe_mixture`), and by Mitsuba's `measured` from the file. f is the
fit, for `measured` the file; f is the mean of the channels. The variance of the first three is a quadrature, that of
`measured` is of 2²⁰ weights. `albedo` is how far the mean of 2²⁰ weights is from the albedo by quadrature, `lost` the
largest share of directions under the horizon, `clipped` how many weights are above their bound.

The roughness and the share of the GGX lobe are the best of a grid for each viewer, which flatters it.
"""

import math
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch

import homofact
from homofact.evaluation.machine import machine
from homofact.factor.fitted import Fitted
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.methods.saved import open_saved
from homofact.methods.search import Search
from homofact.rendering.mitsuba_bsdf import load_bsdf, measured_bsdf, open_mitsuba
from homofact.shading.cost import operations_of
from homofact.shading.functions import sampling_functions
from homofact.shading.lobe_mixture import LEAST, LobeMixture
from homofact.shading.mixture_fit import fitted_mixture
from homofact.shading.noise import ANGLES, albedo_of, cosine_density, noise_of, viewer_at

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.engines.mitsuba_comparison import relative_rms, render, scene
from scripts.shared.harness import add_effort, data_folder, figure, finish, markdown, parser_of, progress

FILE = "{}_rgb.bsdf"
DRAWN = 1 << 20
ALPHAS = tuple(float(alpha) for alpha in np.geomspace(2e-3, 1, 28))
SHARES = (1 / 256, 0.02, 0.1, 0.3, 0.6)


def best_ggx(fitted: Fitted, angle: float) -> float:
    """The least variance of `SHARES` of a cosine and else ωo mirrored at the normals of GGX that it sees, of `ALPHAS`.

    The density of these is D/(2 (zo + √(zo² + α² (1 − zo²)))).
    """
    wo = viewer_at(angle)
    wi, angles = (nodes[0] for nodes in hemisphere_nodes(wo[None]))
    light = fitted.evaluate(wi, wo.expand_as(wi)).mean(1) * wi[:, 2]
    squared = light**2 * angles / (light * angles).sum() ** 2
    half = wi + wo
    upright = half[:, 2] ** 2 / (half**2).sum(1)
    found = []
    for alpha in ALPHAS:
        facets = alpha**2 / (math.pi * (upright * (alpha**2 - 1) + 1) ** 2)
        seen = facets / (2 * (wo[2] + torch.sqrt(wo[2] ** 2 + alpha**2 * (1 - wo[2] ** 2))))
        found += [float((squared / (share * wi[:, 2] / math.pi + (1 - share) * seen)).sum()) for share in SHARES]
    return min(found) - 1


def weights_of(mi: Any, bsdf: Any, angle: float, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(weights, the channels' mean, the densities, the directions) of `count` draws of a material of Mitsuba."""
    dr: Any = import_module("drjit")
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, count)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(*viewer_at(angle).tolist())
    found, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    return np.array(weight, dtype=np.float64).mean(0), np.array(found.pdf), np.array(found.wo)


def relative_variance(weights: np.ndarray) -> float:
    """Of weights whose mean is not 0."""
    return float(weights.var() / weights.mean() ** 2)


def checked(mi: Any, fitted: Fitted, bsdf: Any) -> tuple[float, float, int]:
    """(largest relative error of a mean weight, largest lost share, weights above π f/LEAST) over `ANGLES`."""
    errors, lost, above = [], [], 0
    for angle in ANGLES:
        weights, densities, directions = weights_of(mi, bsdf, angle, DRAWN)
        errors.append(abs(float(weights.mean()) / albedo_of(fitted, viewer_at(angle)) - 1))
        lost.append(float((densities <= 0).mean()))
        wi = torch.from_numpy(directions.T[:20_000].astype(np.float64))
        bound = fitted.evaluate(wi, viewer_at(angle).expand_as(wi)).mean(1).numpy() * math.pi / LEAST
        above += int((weights[:20_000] > bound * 1.001 + 1e-6).sum())
    return max(errors), max(lost), above


def rows_of(mi: Any, name: str, way: str, file: Path, fitted: Fitted, mixture: LobeMixture) -> list[tuple[str, ...]]:
    """The table's lines for one file."""
    place = Path(tempfile.mkdtemp()) / "factorization.npz"
    fitted.save(place)
    ours = load_bsdf(place)
    found = {"cosine": [], "GGX × 1": [], "ours": []}
    for angle in ANGLES:
        wo = viewer_at(angle)
        found["cosine"].append(noise_of(fitted, cosine_density, wo)[0])
        found["GGX × 1"].append(best_ggx(fitted, angle))
        found["ours"].append(noise_of(fitted, mixture.density, wo)[0])
    measured = [relative_variance(weights_of(mi, measured_bsdf(file), angle, DRAWN)[0]) for angle in ANGLES]
    error, lost, above = checked(mi, fitted, ours)
    ratios = [one / other for one, other in zip(found["ours"], measured, strict=True)]
    rows: list[tuple[str, ...]] = []
    for key, each in found.items():
        checks = (f"{error:.2%}", f"{lost:.1g}", str(above)) if key == "ours" else ("", "", "")
        rows.append(("" if rows else f"{name}, {way}", key, *map(figure, each), *checks))
    rows.append(("", "`measured`", *map(figure, measured), "", "", ""))
    rows.append(("", "ours / `measured`", *(f"{ratio:.2f}" for ratio in ratios), "", "", ""))
    return rows


def picture_row(mi: Any, name: str, file: Path, place: Path, size: int, spp: int) -> tuple[str, ...]:
    """Noise of pictures by both materials at equal samples, and the ratio of it at equal time."""
    covered = torch.from_numpy(np.array(mi.render(scene(mi, None, size, True), spp=16)))[..., 0] > 0.999
    both = [render(mi, bsdf, size, spp, 0) for bsdf in (measured_bsdf(file), load_bsdf(place))]
    noises = [relative_rms(each.noise, each.radiance, covered) for each in both]
    seconds = [each.seconds for each in both]
    equal = noises[1] / noises[0]
    at_equal_time = equal * math.sqrt(seconds[1] / seconds[0])
    return (name, *(f"{noise:.2%}" for noise in noises), f"{equal:.2f}", *map(figure, seconds), f"{at_equal_time:.2f}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = parser_of(__doc__, "data", "out")
    add_effort(parser, "quick")
    parser.add_argument("--fits", type=Path, help="a folder that keeps the fits, and from which they are read")
    parser.add_argument("--size", type=int, default=200, help="pixels per side of a picture (%(default)s)")
    parser.add_argument("--spp", type=int, default=64, help="samples per pixel (%(default)s)")
    options = parser.parse_args(arguments)
    files = sorted((data_folder(options.data) / "rgl").glob(FILE.format("*")))
    if not files:
        print(f"no RGL files in {data_folder(options.data) / 'rgl'} (--data FOLDER or HOMOFACT_DATA)", file=sys.stderr)
        return 2
    ways = {"straight": {}, "raw": {"calibrate": ["none"]}}
    if options.short:
        files, ways, options.effort, options.size, options.spp = files[:1], {"raw": ways["raw"]}, 1.0, 32, 8
    mi = open_mitsuba()
    folder = options.fits or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    rows, pictures, seconds, cost = [], [], [], ""
    for file in files:
        name = file.name.removesuffix(FILE.format(""))
        for way, how in ways.items():
            place = folder / f"{name}.{way}.npz"
            if not place.is_file():
                settings = Search(textures=3, size=8 if options.short else 32, effort=options.effort)
                homofact.fit(homofact.read(str(file), **how), settings).factorization.save(place)
            fitted = open_saved(place)
            began = time.perf_counter()
            mixture = fitted_mixture(fitted)
            seconds.append(time.perf_counter() - began)
            counts = [operations_of(each.statements, each.result)[1] for each in sampling_functions(mixture)]
            cost = (
                f"{mixture.nbytes} bytes, {counts[0]} + {counts[1]} operations on scalars to draw and for the density"
            )
            rows += rows_of(mi, name, way, file, fitted, mixture)
            progress(name, way, f"{seconds[-1]:.1f} s", *rows[-3:])
    for file in files:
        name = file.name.removesuffix(FILE.format(""))
        place = folder / f"{name}.{next(iter(ways))}.npz"
        pictures.append(picture_row(mi, name, file, place, options.size, options.spp))
        progress(*pictures[-1])
    angles = tuple(f"{angle:.0f}°" for angle in ANGLES)
    header = ("file", "drawn from", *angles, "albedo", "lost", "clipped")
    shown = ("file", "noise, `measured`", "noise, ours", "ratio", "seconds, `measured`", "seconds, ours",
             "ratio at equal time")  # fmt: skip
    text = "\n\n".join(
        [
            markdown(header, rows, 2),
            markdown(shown, pictures),
            f"Fits of three textures of 32², effort {options.effort}, seed 0. The density takes {cost}; it was fitted"
            f" in {sorted(seconds)[len(seconds) // 2]:.1f} s (median). Pictures of {options.size}² pixels,"
            f" {options.spp} samples per pixel, seed 0, Mitsuba {mi.__version__}. {machine()}",
        ]
    )
    return finish(text, options)


if __name__ == "__main__":
    sys.exit(main())
