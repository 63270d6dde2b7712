"""Count the operations of one evaluation of a generated shader, like section 3.3 of Cole's thesis.

    python scripts/speed/cost_of_shading.py

Counted on the expressions that the shader is printed from (`homofact.shading.cost`): an operator or function of
a vector is one operation; the last but one column counts every component by itself. The frame change of ωi and ωo, six
dot products, is the renderer's and in no row. There are no normalisations: lengths are square roots, which divide once.
Bytes are those of texels of 16² in half floats on a GPU, where three channels take the room of four.

The thesis counts, beyond the frame change, for two textures in in-out coordinates 4 dot products and 2 sums; for
McCool's projections 4 sums and 1 normalisation; for half vector and difference vector 2 sums, a product, 2
normalisations, 4 dot products and a cross product, plus the projections.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import torch

from homofact.brdf.log_transform import LogTransform
from homofact.containers.formats import FORMATS
from homofact.exporting.exported import exported
from homofact.factor.factorization import Factorization, Term
from homofact.factor.fitted import Fitted
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.rotation import Rotation
from homofact.separable.separable import Separable, SeparableTerm
from homofact.shading.cost import EvaluationCost

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

SIDE, FORMAT, ALLOWED = 16, "exr16", 40
DEAREST = "general isotropic half-diff, warped + general isotropic in-out"
COLUMNS = {
    "dot": ("dot",), "sums": ("+", "-"), "products": ("*", "/"), "roots": ("sqrt",), "angles": ("atan2", "acos"),
    "exp, asinh": ("exp", "asinh"), "max, min, step, abs": ("max", "min", "step", "abs"),
}  # fmt: skip


def searched(coordinates: str, seed: int, warp: Warp | None = None) -> Projection:
    """A projection in general position: what a search ends in."""
    generator = torch.Generator().manual_seed(seed)
    rotation = Rotation.random(generator, coordinate_system(coordinates).dimension)
    return Projection.from_rotation(coordinates, rotation, True, warp=warp)


def product(*projections: Projection) -> Factorization:
    """Textures of random logarithms under these projections; a count does not depend on them."""
    texels = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    flat = [int(bool((each.matrix[1] == 0).all())) for each in projections]
    terms = (
        Term(each, texels[: 1 if one else SIDE], torch.ones(1 if one else SIDE, SIDE, dtype=torch.bool))
        for each, one in zip(projections, flat, strict=True)
    )
    return Factorization(tuple(terms), LogTransform(1e-5, torch.ones(3, dtype=torch.float64)), ("R", "G", "B"))


def sum_of_products(terms: int) -> Separable:
    """So many in-out terms of one texture each on the parabolic map, as a reciprocal SVD leaves them."""
    texels = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    term = SeparableTerm(texels, None, torch.ones(3, dtype=torch.float64))
    read = torch.ones(SIDE, SIDE, dtype=torch.bool)
    transform = LogTransform(1e-5, torch.ones(3, dtype=torch.float64))
    return Separable((term,) * terms, "parabolic", "in-out", read, transform, ("R", "G", "B"))


def representations() -> dict[str, Fitted]:
    """What rows there are."""
    half, arcs = fixed_projection("theta_h-theta_d", True, Warp(0.05)), fixed_projection("theta_i-theta_o", True)
    return {
        "McCool: ωi, h, ωo": product(fixed_projection("wi", True), fixed_projection("h", True)),
        "θh-θd, warped": product(half),
        "θh-θd, warped + θi-θo": product(half, arcs),
        DEAREST: product(searched("isotropic-half-diff", 1, Warp(0.03)), searched("isotropic-in-out", 2)),
        "2 × general isotropic in-out": product(searched("isotropic-in-out", 2), searched("isotropic-in-out", 3)),
        "2 × general in-out": product(searched("in-out", 3), searched("in-out", 4)),
        "2 × general half-diff, warped": product(
            searched("half-diff", 5, Warp(0.05)), searched("half-diff", 6, Warp(0.05))
        ),
        "5 × general isotropic half-diff": product(*(searched("isotropic-half-diff", k) for k in range(5))),
        "SVD, 1 term": sum_of_products(1),
        "SVD, 4 terms": sum_of_products(4),
    }


def table() -> tuple[str, EvaluationCost]:
    """The table as Markdown, and the cost of the dearest pair of isotropic textures."""
    rows, dearest = [], None
    for name, fitted in representations().items():
        cost = exported(fitted, FORMATS[FORMAT]).cost
        dearest = cost if name == DEAREST else dearest
        counts = [sum(cost.operations.get(kind, 0) for kind in kinds) for kinds in COLUMNS.values()]
        if sum(counts) != cost.total:
            raise AssertionError(f"{name}: {cost.operations} has operations of no column")
        rows.append((name, *counts, cost.total, cost.scalar, cost.fetches, cost.nbytes))
    assert dearest is not None
    header = ("representation", *COLUMNS, "operations", "on scalars", "fetches", "bytes")
    return markdown(header, rows), dearest


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = parser_of(__doc__, "out")
    options = parser.parse_args(arguments)
    found, dearest = table()
    text = (
        f"{found}\n\nA half-diff and an in-out texture cost at most {dearest.fetches} fetches and"
        f" {figure(dearest.total)} operations beyond the frame change; expected at most 3 and under {ALLOWED}."
        " Two in-out textures, each read at its conjugate too, would take 4 fetches."
    )
    return finish(text, options)


if __name__ == "__main__":
    sys.exit(main())
