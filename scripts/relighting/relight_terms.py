"""Repeat Mahajan's figure 1: K per material by his rule, compared with one K for all and the best split.

    python scripts/relighting/relight_terms.py [--data FOLDER] [--sky NAME] [--vertices 120] [--plot FILE] [--short]

A scene of several materials, each on the same mesh under the same sky. Of each, the light that the first K in-out terms
send from drawn vertices to an eye is measured for every K against the sum with the reflectance itself, nothing
truncated. Terms are shared out over the materials in five ways, the same number of them in all:

- share: as many of each as hold one share of its energy, the same for all (Mahajan et al. 2008, l*);
- light: as many of each as leave one expected error under the sky, the same for all (`transport.factoring`);
- expected: the split of which the error that is expected of the whole scene under the sky is least, nothing measured;
- one K: the same number of each;
- best: the split of which the measured error is least, by dynamic programming over all splits.

The error is the scene's, √(Σ|found − truth|²/Σ|truth|²) over all materials. Bytes are those of --scene-vertices
vertices a material with 96 coefficients per vector, and of the view maps.
"""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.evaluation.machine import machine
from homofact.figures.log_axis import log_x, log_y
from homofact.linear.threads import one_thread
from homofact.meshes.mesh import read_mesh
from homofact.meshes.occlusion import Occluder
from homofact.meshes.shapes import torus_knot
from homofact.relighting import cube
from homofact.relighting.decomposition import MOST_TERMS, decompositions
from homofact.relighting.factoring import MAP_SIZE, factor
from homofact.relighting.factors import InOutFactors, look_up, view_values
from homofact.relighting.precompute import KEPT
from homofact.relighting.seen import SeenVertices, seen_vertices
from homofact.relighting.tracer import Tracer
from homofact.rendering.light import EnvironmentMap
from homofact.theory.in_out import count_for_share

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.relighting.relight_truth import EYE, materials, skies
from scripts.shared.harness import data_folder, figure, finish, markdown, parser_of, progress

SHARES = (0.8, 0.9, 0.95, 0.99)
RULES = ("share", "light", "expected", "one K", "best")
HEADER = ("rule", "terms of each", "terms", "MB", "error of the scene", "over the best", "largest of a material")


def squared_errors(
    seen: SeenVertices, factors: InOutFactors, light: EnvironmentMap, size: int
) -> tuple[np.ndarray, float]:
    """(Σ|B_K − B|² for K = 0 … all (K + 1,), Σ|B|²) over the vertices and channels."""
    radiance = cube.environment_cube(light, size)
    truth = np.broadcast_to(seen.dense(radiance, size), (len(seen.which), 3))
    flux = radiance.reshape(-1, 3) * np.tile(cube.solid_angles(size).reshape(-1), cube.FACES)[:, None]
    tracer = Tracer(seen.mesh, seen.occluder, size)
    maps = torch.from_numpy(factors.light).permute(1, 2, 0).double()
    views = view_values(factors, seen.wo)
    sums = np.zeros((len(seen.which), factors.terms + 1, 3))
    for s, v in enumerate(seen.which.tolist()):
        lit = np.flatnonzero(tracer.visible(v))
        wi = tracer.directions[lit].astype(np.float64) @ seen.rows[s].T
        tuples = look_up(maps, torch.from_numpy(wi)).numpy().T @ (flux[lit] * np.maximum(wi[:, 2:], 0))
        sums[s, 1:] = (tuples * views[s]).cumsum(0)
    return ((sums - truth[:, None]) ** 2).sum((0, 2)), float((truth**2).sum())


def by_light(factors: InOutFactors, error: float) -> int:
    """The least number of terms whose expected error is at most this, or all."""
    left = 1 - factors.strength.astype(np.float64).cumsum() / factors.energy
    enough = np.flatnonzero(left <= error**2)
    return int(enough[0]) + 1 if len(enough) else factors.terms


def split_by_light(factors: Sequence[InOutFactors], total: int) -> list[int]:
    """Terms of each by the rule `light`, at the least error whose terms are `total` at most, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = (low + high) / 2
        if sum(by_light(each, middle) for each in factors) <= total:
            high = middle
        else:
            low = middle
    return [by_light(each, high) for each in factors]


def best_split(errors: Sequence[np.ndarray], total: int) -> list[int]:
    """The numbers of terms (at least one each, `total` at most together) of which the sum of errors is least: exact."""
    best = np.full((len(errors) + 1, total + 1), np.inf)
    best[0] = 0
    taken = np.zeros((len(errors) + 1, total + 1), np.int64)
    for i, each in enumerate(errors, 1):
        for whole in range(i, total + 1):
            most = min(whole - (i - 1), len(each) - 1)
            found = each[1 : most + 1] + best[i - 1, whole - most : whole][::-1]
            taken[i, whole] = int(found.argmin()) + 1
            best[i, whole] = found.min()
    counts, left = [], total
    for i in range(len(errors), 0, -1):
        counts.append(int(taken[i, left]))
        left -= counts[-1]
    return counts[::-1]


def scene_error(errors: Sequence[np.ndarray], powers: Sequence[float], counts: Sequence[int]) -> float:
    """√(Σ|found − truth|²/Σ|truth|²) over all materials."""
    return float(np.sqrt(sum(each[k] for each, k in zip(errors, counts, strict=True)) / sum(powers)))


@one_thread
def terms_by_share(reflectance: Reflectance, shares: Sequence[float]) -> list[int]:
    """Mahajan's K for each share of f's energy, on the finest grid, decomposed once; `MOST_TERMS` at most."""
    white = decompositions(reflectance)[-1]().white
    return [min(count_for_share(white, share), MOST_TERMS) for share in shares]


def splits(
    models: Sequence[Reflectance],
    factors: Sequence[InOutFactors],
    errors: Sequence[np.ndarray],
    shares: Sequence[float],
) -> list[dict[str, list[int]]]:
    """For each share the terms of each material by every rule, as many together as the share takes."""
    foretold = [each.energy - np.append(0, each.strength.astype(np.float64).cumsum()) for each in factors]
    by_share = [terms_by_share(each, shares) for each in models]
    found = []
    for number in range(len(shares)):
        counts = [min(each[number], factor.terms) for each, factor in zip(by_share, factors, strict=True)]
        total = sum(counts)
        one = [min(total // len(counts), each.terms) for each in factors]
        found.append(
            {
                "share": counts,
                "light": split_by_light(factors, total),
                "expected": best_split(foretold, total),
                "one K": one,
                "best": best_split(errors, total),
            }
        )
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, write it, and draw it."""
    parser = parser_of(__doc__, "data")
    parser.add_argument("--sky", default="stpeters", help="which of the skies (%(default)s)")
    parser.add_argument("--vertices", type=int, default=120, help="vertices drawn (%(default)s)")
    parser.add_argument("--cube", type=int, default=64, help="texels along a cube map's face (%(default)s)")
    parser.add_argument("--scene-vertices", type=int, default=17_000, help="for bytes, a material (%(default)s)")
    parser.add_argument("--plot", type=Path, help="draw error against bytes (.png, .svg)")
    parser.add_argument("--out", type=Path, default=Path("out/relight_terms"), help="folder (%(default)s)")
    chosen = parser.parse_args(arguments)
    folder = data_folder(chosen.data)
    found, missing = materials(folder, False)
    lights = skies(folder, chosen.short)
    sky = chosen.sky if chosen.sky in lights else next(iter(lights))
    most = MOST_TERMS
    if chosen.short:
        chosen.vertices, chosen.cube, most = 8, 8, 16
        found = {name: each for name, each in found.items() if name.startswith("lafortune")}
    bunny = folder / "meshes" / "bunny.ply"
    mesh = read_mesh(bunny) if bunny.is_file() and not chosen.short else torus_knot(48, 12)
    occluder = Occluder(mesh.positions, mesh.triangles)
    began = time.perf_counter()
    models, factors, errors, powers = [], [], [], []
    for name, (reflectance, _) in found.items():
        models.append(reflectance)
        factors.append(factor(reflectance, most, light=lights[sky]))
        seen = seen_vertices(mesh, reflectance, occluder, EYE, chosen.vertices)
        squares, power = squared_errors(seen, factors[-1], lights[sky], chosen.cube)
        errors.append(squares)
        powers.append(power)
        progress(f"{time.perf_counter() - began:.0f} s: {name}")
    shares = tuple(np.linspace(0.6, 0.99, 14)) + SHARES if chosen.plot else SHARES
    a_term = (chosen.scene_vertices * (4 * KEPT + 6) + MAP_SIZE**2 * 12) / 1e6
    all_splits = splits(models, factors, errors, shares)
    rows = []
    for share, split in list(zip(shares, all_splits, strict=True))[-len(SHARES) :]:
        best = scene_error(errors, powers, split["best"])
        for rule in RULES:
            counts = split[rule]
            here = scene_error(errors, powers, counts)
            worst = max(float(np.sqrt(e[k] / p)) for e, p, k in zip(errors, powers, counts, strict=True))
            name = f"share {share:.0%}" if rule == "share" else rule
            rows.append([
                name, ", ".join(map(str, counts)), sum(counts), f"{sum(counts) * a_term:.0f}", f"{here:.2%}",
                f"{here / best - 1:+.0%}", f"{worst:.2%}",
            ])  # fmt: skip
    lines = [
        "# Terms shared out over the materials of a scene",
        "",
        f"- {', '.join(found)}, each on {mesh.name} under {sky}; {chosen.vertices} vertices, cube maps of"
        f" 6 × {chosen.cube}², at most {most} terms",
        f"- {machine()}; {figure(time.perf_counter() - began)} s",
        *(f"- {each}" for each in missing),
        "",
        markdown(HEADER, rows, 2),
        "",
    ]
    finish("\n".join(lines), chosen, chosen.out / "relight_terms.md")
    if chosen.plot:
        draw(chosen.plot, errors, powers, all_splits, a_term)
    return 0


def draw(
    path: Path, errors: Sequence[np.ndarray], powers: Sequence[float], found: list[dict[str, list[int]]], a_term: float
) -> None:
    """Error against bytes, a line a rule."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = drawing.add_subplot()
    styles = {"share": "o-", "light": "s-", "expected": "d-", "one K": "^--", "best": "k:"}
    words = {
        "share": "share of energy (Mahajan et al.)", "light": "one expected error under the sky",
        "expected": "least expected error of the scene",
        "one K": "one K for all", "best": "best split",
    }  # fmt: skip
    for rule in RULES:
        points = sorted((sum(each["share"]) * a_term, scene_error(errors, powers, each[rule])) for each in found)
        axes.plot(*zip(*points, strict=True), styles[rule], label=words[rule], markersize=4)
    axes.set(xlabel="MB of the scene", ylabel="relative RMS error of its light")
    sizes, wrong = np.concatenate([np.asarray(line.get_xydata(), float) for line in axes.lines]).T
    log_x(axes, sizes.min() / 1.1, sizes.max() * 1.1, fewest=4)
    log_y(axes, wrong.min() / 1.1, wrong.max() * 1.1, fewest=4)
    axes.grid(True, alpha=0.25)
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    drawing.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
