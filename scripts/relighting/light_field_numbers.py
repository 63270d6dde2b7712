"""Separate lighting and BRDF from the light field of a sphere: the error of both by noise.

    python scripts/relighting/light_field_numbers.py [--order 8] [--repeats 10] [--short]

Light fields are made from a named lighting and a named material up to --order by the convolution formula
(Ramamoorthi 2002, 3.8), white noise is added to the coefficients (as of white noise in the light field, whose norm is
the given share of the field's), and both are sought again, up to the one scale Λ_0 L_00 = 1: by least squares
over all coefficients (`theory.light_field.factor_light_field`) and by the chapter's ratios (`factor_by_ratios`).

Errors are relative RMS over what was recovered, the root mean square over the repeats; "stated" is what the standard
errors say. "Recovered" are the orders of the lighting that are excited and share the scale, and the shares of the
coefficients that are known in it, both of the last seed. The conditions are `reflection.brdf_condition` of the planted
lighting and `reflection.lighting_condition` of the planted BRDF: how much more noise the worst order takes than the
best.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from homofact.brdf.materials import material
from homofact.evaluation.machine import machine
from homofact.scene.lighting import named_lighting
from homofact.theory.light_field import LightFieldFactors, factor_by_ratios, factor_light_field
from homofact.theory.reflection import (
    brdf_condition,
    convolve_isotropic,
    lighting_condition,
    normalisation,
    uniform_lighting,
)
from homofact.theory.sphere_field import transfer_coefficients

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from scripts.shared.harness import figure, finish, markdown, parser_of

LIGHTINGS = ("sun", "studio", "overcast", "uniform")
MATERIALS = ("cook-torrance-plastic", "phong-30", "lafortune-clay")
NOISES = (0.0, 1e-4, 1e-3, 1e-2)
HEADER = (
    "lighting", "material", "noise", "condition of the BRDF", "of the lighting", "orders recovered",
    "L recovered", "error of L", "stated", "by ratios", "ρ̃ recovered", "error of ρ̃", "stated", "by ratios",
)  # fmt: skip


def relative(wrong: Tensor, planted: Tensor, known: Tensor) -> float:
    """Relative RMS where something was found, by the norm of the planted there."""
    return float(wrong[known].norm() / planted[known].norm())


def squared_mean(values: list[float]) -> float:
    """The root mean square."""
    return math.sqrt(sum(value**2 for value in values) / len(values))


def measured(lighting: Tensor, transfer: Tensor, level: float, repeats: int) -> list[str]:
    """The cells of one row after the names."""
    order = len(transfer) - 1
    scale = float(normalisation(0)[0] * lighting[0])
    planted = (lighting / scale, transfer * scale)
    field = convolve_isotropic(lighting, transfer)
    noise = level * float(field.norm()) / math.sqrt(field.numel())
    errors: list[list[float]] = [[] for _ in range(6)]
    found: LightFieldFactors | None = None
    for seed in range(repeats if level else 1):
        generator = torch.Generator().manual_seed(seed)
        seen = field + noise * torch.randn(field.shape, dtype=torch.float64, generator=generator)
        found = factor_light_field(seen, noise)
        ratios = factor_by_ratios(seen)
        sides = (
            (found.lighting, found.lighting_error, found.known_lighting),
            (found.transfer, found.transfer_error, found.known_transfer),
        )
        for side, (values, stated, known) in enumerate(sides):
            errors[3 * side].append(relative(values - planted[side], planted[side], known))
            errors[3 * side + 1].append(relative(stated, planted[side], known))
            errors[3 * side + 2].append(relative(ratios[side] - planted[side], planted[side], ~ratios[side].isnan()))
    assert found is not None
    cells = [figure(squared_mean(each)) for each in errors]
    inside = transfer.new_zeros(transfer.shape, dtype=torch.bool)
    for degree in range(order + 1):
        for p in range(order + 1):
            least = min(degree, p)
            inside[degree, p, order - least : order + least + 1] = True
    known = (found.known_lighting, found.known_transfer[inside])
    shares = [f"{float(each.double().mean()):.0%}" for each in known]
    filtered = normalisation(order) * transfer.square().sum((1, 2)).sqrt()
    conditions = [figure(brdf_condition(lighting)), figure(lighting_condition(filtered))]
    shared = f"{int((found.scales == 0).sum())} of {order + 1}"
    return [f"{level:g}", *conditions, shared, shares[0], *cells[:3], shares[1], *cells[3:]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and write it."""
    parser = parser_of(__doc__)
    parser.add_argument("--order", type=int, default=8, help="largest order of lighting and BRDF (%(default)s)")
    parser.add_argument("--repeats", type=int, default=10, help="seeds of the noise (%(default)s)")
    parser.add_argument("--out", type=Path, default=Path("out/light_field"), help="folder (%(default)s)")
    chosen = parser.parse_args(arguments)
    order, repeats = (3, 1) if chosen.short else (chosen.order, chosen.repeats)
    transfers = {name: transfer_coefficients(material(name).model, order)[..., 1] for name in MATERIALS}
    rows = []
    for name in LIGHTINGS:
        # The texels of a uniform map leave a rest at higher orders.
        uniform = name == "uniform"
        lighting = uniform_lighting(order) if uniform else named_lighting(name).coefficients[: (order + 1) ** 2].mean(1)
        for surface, transfer in transfers.items():
            rows += [[name, surface, *measured(lighting, transfer, level, repeats)] for level in NOISES]
    lines = [
        "# Lighting and BRDF out of a light field",
        "",
        f"- order {order}, {repeats} seeds of the noise, the materials' green channel, the lightings' mean channel",
        f"- {machine()}",
        "",
        markdown(HEADER, rows, 2),
        "",
    ]
    return finish("\n".join(lines), chosen, chosen.out / "light_field.md")


if __name__ == "__main__":
    sys.exit(main())
