"""Measure the error of the in-out SVD by terms and size of its maps (Wang, Tran and Luebke 2004, figure 4).

Ashikhmin-Shirley with Wang's parameters, and Lafortune's clay and skin with the coefficients of Lafortune et al.
1997; Wang's plastic is not given. The BRDF matrix is the model at texel directions, its terms eigenvectors, R, G and
B apart. The error is √mean((f − f̂)² cos²θi) over 80,000 pairs, each direction uniform on the hemisphere, and over the
channels; sums below zero stay as they are in the figure, as in the paper, and are counted. Wang's orthographic map
comes first. Beside it stand the polar and the parabolic ones, and matrices weighted by projected solid angle.

Our texel centres reach the rim of the disc, his end half a texel inside it; f is asked for at most 84.3° from the
normal (`baselines.direction_maps`), where Ashikhmin-Shirley still is finite.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from matplotlib.figure import Figure

from homofact.brdf.channels import OneChannel
from homofact.brdf.materials import material
from homofact.brdf.reflectance import Reflectance
from homofact.evaluation.machine import machine
from homofact.files.atomic import replace_file
from homofact.geometry.directions import draw_uniform
from homofact.linear.threads import one_thread
from homofact.methods.separable_fit import separable_of
from homofact.separable.decompositions import eigen, power
from homofact.separable.maps import MAPS, direction_map
from homofact.separable.matrix import brdf_matrix
from homofact.separable.separable import Separable

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

MATERIALS = ("ashikhmin-shirley-wang", "lafortune-clay", "lafortune-skin")
MAP_ORDER = ("orthographic", "polar", "parabolic")
COLOURS = ("#b2521b", "#c79a1e", "#3f7f4f", "#1f4e79")


@dataclass(frozen=True)
class Curve:
    """Errors of 1 … K terms, in sr⁻¹, and the share of values below zero at the last."""

    material: str
    map: str
    weighted: bool
    size: int
    errors: tuple[float, ...]
    negative: float
    seconds: float


@one_thread
def curve(
    name: str, map: str, weighted: bool, size: int, terms: int, pairs: tuple[torch.Tensor, torch.Tensor]
) -> Curve:
    """One line of the figure."""
    began = time.perf_counter()
    wi, wo = pairs
    model = material(name).model
    # The channels of Wang's grey material are one.
    grey = name == MATERIALS[0]
    channels = model.channels[:1] if grey else model.channels
    sums = torch.zeros(terms, dtype=torch.float64)
    negative = 0.0
    for channel in channels:
        single: Reflectance = OneChannel(model, channel)
        expected = single.evaluate(wi, wo)
        whole = separable_of(single, terms, size, map=map, weighted=weighted)
        total = torch.zeros_like(expected)
        for k, each in enumerate(products(whole)):
            total += each.evaluate_signed(wi, wo)
            sums[k] += (((total - expected) * wi[:, 2:]) ** 2).mean()
        negative += float((total < 0).double().mean()) / len(channels)
    errors = tuple((sums / len(channels)).sqrt().tolist())
    return Curve(name, map, weighted, size, errors, negative, time.perf_counter() - began)


def products(whole: Separable) -> list[Separable]:
    """Each term as a sum of its own."""
    return [replace(whole, terms=(term,)) for term in whole.terms]


def power_against_eigen(size: int, terms: int) -> tuple[list[tuple[object, ...]], bool]:
    """(rows, whether all agree to 1e-6): sizes of eigenvalues and errors of the rank-K products.

    Sign and product need not be equal where the last eigenvalue and the next are of one size.
    """
    rows, agree = [], True
    for name in MATERIALS:
        model = OneChannel(material(name).model, "R")
        matrix = brdf_matrix(model, direction_map(MAP_ORDER[0]), size).values[..., 0]
        best = eigen(matrix, terms)
        found = power(matrix, terms, torch.Generator().manual_seed(0))
        sizes = [(factors.left**2).sum(0) for factors in (best, found)]
        apart = float((sizes[0] - sizes[1]).abs().max() / sizes[0].max())
        errors = [float((factors.product() - matrix).norm()) for factors in (best, found)]
        worse = abs(errors[1] / errors[0] - 1)
        agree &= apart < 1e-6 and worse < 1e-6
        rows.append((name, f"{apart:.1e}", f"{worse:.1e}", found.iterations, "yes" if found.converged else "no"))
    return rows, agree


def draw(path: Path, curves: Sequence[Curve]) -> None:
    """The figure: a panel a material, Wang's map and weights, a line a size."""
    names = list(dict.fromkeys(each.material for each in curves))
    chart = Figure(figsize=(3.5 * len(names) + 0.6, 4.2), layout="constrained")
    for panel, name in zip(chart.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        own = [each for each in curves if (each.material, each.map, each.weighted) == (name, MAP_ORDER[0], False)]
        for each, colour in zip(own, COLOURS, strict=False):
            steps = range(1, len(each.errors) + 1)
            panel.plot(steps, each.errors, color=colour, marker="o", markersize=3, label=f"{each.size}²")
        panel.set_ylim(bottom=0)
        panel.set_title(name, fontsize=10)
        panel.set_xlabel("terms")
        panel.xaxis.get_major_locator().set_params(integer=True)
        panel.grid(axis="y", color="#dddddd", linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
        if name == names[0]:
            panel.set_ylabel("cosine-weighted RMS error, sr⁻¹")
            panel.legend(frameon=False)
    chart.suptitle(f"In-out SVD on orthographic maps (after Wang et al. 2004, figure 4)\n{machine()}", fontsize=8)
    replace_file(path, lambda beside: chart.savefig(beside, dpi=120, format="png"))


def main(arguments: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/wang_figure_4"), help="the folder to write")
    parser.add_argument("--terms", type=int, default=16)
    parser.add_argument("--sizes", type=int, nargs="+", default=[16, 32, 48, 64])
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    count, terms, sizes = (500, 3, [6, 8]) if chosen.short else (80_000, chosen.terms, chosen.sizes)
    pairs = draw_uniform(count, torch.Generator().manual_seed(chosen.seed))
    curves = []
    for name in MATERIALS:
        for map, weighted in [(each, False) for each in MAP_ORDER] + [("parabolic", True)]:
            # The other maps are beside the point of the figure: its largest size is left out for them.
            for size in sizes if map == MAP_ORDER[0] else sizes[:-1]:
                curves.append(curve(name, map, weighted, size, terms, pairs))
                errors = curves[-1].errors
                print(f"{name}, {map}, {size}²: {figure(errors[-1])}, {curves[-1].seconds:.1f} s", file=sys.stderr)
    rows, agree = power_against_eigen(sizes[0], min(terms, 8))
    shown = [k for k in (1, 2, 4, 8, 16) if k <= terms]
    lines = [
        "# In-out SVD: error against terms and size (Wang, Tran and Luebke 2004, figure 4)",
        "",
        f"- {count} pairs uniform on both hemispheres, seed {chosen.seed}; RMS of (f − f̂) cosθi in sr⁻¹ over R, G, B",
        "- clay and skin: Lafortune et al. 1997; the paper's plastic is not given",
        f"- {machine()}",
        "",
        markdown(
            ("material", "map", "weights", "size", *(f"K = {k}" for k in shown), "below 0", "seconds"),
            [
                (
                    each.material,
                    each.map,
                    "cosine" if each.weighted else "none",
                    f"{each.size}²",
                    *(figure(each.errors[k - 1]) for k in shown),
                    f"{each.negative:.1%}",
                    f"{each.seconds:.1f}",
                )
                for each in curves
            ],
            3,
        ),
        "",
        "## 32² within 10% of 64² (orthographic)",
        "",
        *_statements(curves, terms),
        "",
        f"## Power iteration against the eigen-decomposition, {sizes[0]}², {min(terms, 8)} terms, R"
        f" ({'equal' if agree else 'NOT equal'} to 1e-6)",
        "",
        markdown(("material", "eigenvalues apart", "errors apart", "products", "converged"), rows),
        "",
    ]
    finish("\n".join(lines), chosen, chosen.out / "wang_figure_4.md")
    draw(chosen.out / "wang_figure_4.png", curves)
    print(f"{chosen.out}: wang_figure_4.md, wang_figure_4.png")
    return 0


def _statements(curves: Sequence[Curve], terms: int) -> list[str]:
    """Per material: at which K the error at 32² is within 10% of that at 64²."""
    lines = []
    for name in dict.fromkeys(each.material for each in curves):
        own = {
            each.size: each.errors
            for each in curves
            if each.material == name and each.map == MAP_ORDER[0] and not each.weighted
        }
        if 32 not in own or 64 not in own:
            return ["- not run: sizes 32 and 64 are wanted"]
        ratios = [a / b for a, b in zip(own[32], own[64], strict=True)]
        within = [k for k, ratio in enumerate(ratios, 1) if ratio <= 1.1]
        words = "at every K" if len(within) == terms else f"at {len(within)} of {terms} K ({within})"
        at_four = f", {ratios[3]:.3f} at K = 4" if terms >= 4 else ""
        lines.append(f"- {name}: {words}; the ratio is {min(ratios):.3f} to {max(ratios):.3f}{at_four}")
    return lines


if __name__ == "__main__":
    assert set(MAP_ORDER) == set(MAPS)
    sys.exit(main())
