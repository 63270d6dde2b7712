"""Pairs of directions with the values of an export, by which a person checks a shader of their own.

A third of the pairs are random, with cosine-weighted density, a third lie at mirror directions and up to a few degrees
off them, where a highlight is, and a third have a grazing direction. All are drawn by one seed.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.geometry.directions import draw_cosine_weighted, from_spherical

CHECK = "brdf_check.csv"
_EACH, _OFF = 24, math.radians(4)
_GRAZING = (math.radians(75), math.radians(85))


def check_pairs() -> tuple[Tensor, Tensor]:
    """Return unit directions ωi and ωo (72, 3), float64, rounded to six decimals."""
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_cosine_weighted(_EACH, generator)
    theta, phi, off, turn = torch.rand(4, _EACH, generator=generator, dtype=torch.float64)
    theta, phi = math.radians(70) * theta, 2 * math.pi * phi
    lit = from_spherical(theta, phi)
    mirrored = lit * lit.new_tensor([-1, -1, 1]) + torch.sin(_OFF * off)[:, None] * from_spherical(
        math.pi / 2 + 0 * turn, 2 * math.pi * turn
    )
    one, other = draw_cosine_weighted(_EACH, generator)
    share = torch.rand(_EACH, generator=generator, dtype=torch.float64)
    along = torch.atan2(one[:, 1], one[:, 0])
    grazing = from_spherical(_GRAZING[0] + (_GRAZING[1] - _GRAZING[0]) * share, along)
    pairs = torch.cat((wi, lit, grazing)), torch.cat((wo, mirrored, other))
    rounded = [(w / w.norm(dim=1, keepdim=True) * 1e6).round() / 1e6 for w in pairs]
    return rounded[0], rounded[1]


def check_table(stored: Reflectance) -> str:
    """Return the text of the table: wi_x … wo_z and the value f of each channel in sr⁻¹, a row per pair.

    The values are those at the directions as written, made unit vectors again.
    """
    wi, wo = check_pairs()
    values = stored.evaluate(*(w / w.norm(dim=1, keepdim=True) for w in (wi, wo))).double()
    names = [f"{w}_{axis}" for w in ("wi", "wo") for axis in "xyz"] + [f"f_{name}" for name in stored.channels]
    rows = [
        ",".join([*(f"{x:.6f}" for x in (*one, *other)), *(f"{value:.9g}" for value in each)])
        for one, other, each in zip(wi.tolist(), wo.tolist(), values.tolist(), strict=True)
    ]
    return "\n".join([",".join(names), *rows]) + "\n"
