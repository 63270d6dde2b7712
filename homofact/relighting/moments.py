"""Integrals of a reflectance against smooth functions of direction, however sharp its lobe.

For each angle of the light, the nodes are dense on both sides of the plane of incidence and on both sides of the
light's own angle. Lobes lie at the mirror direction and at the light's direction. Both are corners of the grid, near
which the distances between nodes shrink cubically. 48 × 48 nodes resolve a lobe of a thousandth of a radian.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.geometry.directions import from_spherical
from homofact.theory.harmonics import gauss_legendre
from homofact.theory.in_out import DirectionGrid, polynomial

# Gauss nodes of each half of a crowded interval, at least, and the power by which they crowd.
_NODES, _CROWDING = 24, 3


def moments(
    reflectance: Reflectance,
    theta: Tensor,
    grid: DirectionGrid,
    power: float,
    swapped: bool = False,
    even: bool = False,
) -> tuple[Tensor, Tensor]:
    """Integrals over ωo for light from angles `theta` (T,) at azimuth 0, weighted by cos^power θo.

    (∫ f p_q(θo) exp(−imφ) (m, T, rings, C), ∫ Σ_c f² (T,)).
    p_q are the polynomials through the grid's rings, m goes below half its turns. `swapped` integrates over ωi for a
    view from θ at azimuth 0 instead, against exp(+imφ). An `even` f is evaluated on one side of the plane of incidence
    only, and its integrals are real. Raises BadInput for values that are not finite.
    """
    # As many as the waves of the highest order need in the middle, where the nodes are far apart.
    crowded, weights = _crowded(max(_NODES, grid.turns // 2))
    phi = torch.cat((crowded, 2 * math.pi - crowded.flip(0))) if not even else crowded
    turn = weights.repeat(2) if not even else 2 * weights
    order = torch.arange((grid.turns + 1) // 2, dtype=torch.float64)
    # The sign of an azimuth difference φo − φi: it is the light that is turned where swapped.
    wave = torch.exp(1j * order[:, None] * phi * (1 if swapped else -1)) * turn
    wave = torch.cos(order[:, None] * phi) * turn if even else wave
    found, squares = [], []
    for each in theta.tolist():
        # Crowded on both sides of θ itself, by its shares of the quarter turn.
        low, high = each, math.pi / 2 - each
        other = torch.cat((each - low * crowded.flip(0) / math.pi, each + high * crowded / math.pi))
        width = torch.cat((low * weights.flip(0), high * weights)) / math.pi
        fixed = torch.tensor([math.sin(each), 0.0, math.cos(each)], dtype=torch.float64)
        w = from_spherical(other[:, None].expand(-1, len(phi)), phi.expand(len(other), -1)).reshape(-1, 3)
        here = fixed.expand(len(w), 3)
        values = reflectance.evaluate(*((w, here) if swapped else (here, w))).double()
        if not bool(torch.isfinite(values).all()):
            what = "the reflectance has values that are not finite"
            raise BadInput(what, where="relighting", expected="finite numbers")
        values = values.reshape(len(other), len(phi), -1)
        ring = width * torch.sin(other) * torch.cos(other) ** power
        against = polynomial(grid, from_spherical(other, torch.zeros_like(other))) * ring[:, None]
        inner = against.T @ values.reshape(len(other), -1)
        inner = inner.reshape(len(against.T), len(phi), -1).permute(1, 0, 2).reshape(len(phi), -1)
        found.append((wave @ inner.to(wave)).reshape(len(wave), len(against.T), -1))
        squares.append(torch.einsum("opc,o,p->", values**2, ring, turn))
    return torch.stack(found, 1), torch.stack(squares)


def _crowded(count: int) -> tuple[Tensor, Tensor]:
    """Return quadrature nodes and weights on [0, π], denser at both ends: x = (π/2) s³ for Gauss nodes s."""
    s, weights = gauss_legendre(count, 0.0, 1.0)
    x = math.pi / 2 * s**_CROWDING
    weights = math.pi / 2 * _CROWDING * s ** (_CROWDING - 1) * weights
    return torch.cat((x, math.pi - x.flip(0))), torch.cat((weights, weights.flip(0)))
