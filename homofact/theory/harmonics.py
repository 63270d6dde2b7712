"""Real orthonormal spherical harmonics on the whole sphere, and projections onto them.

Y_lm = √2 N_lm P_lm(cosθ) cos mφ for m > 0, N_l0 P_l(cosθ) for m = 0, √2 N_l|m| P_l|m|(cosθ) sin|m|φ for m < 0
(Mahajan, Tseng and Ramamoorthi 2008, eq. 6), without the Condon-Shortley phase: Y_11, Y_1−1 and Y_10 are
√(3/4π) times x, y and z. Coefficients are stored along one axis, with (l, m) at index l² + l + m.

The normalised functions P̄_lm = N_lm P_lm come from the recurrence in l at fixed m (Holmes and Featherstone 2002,
eq. 11), which starts from P̄_mm. Its factor sinᵐθ underflows harmlessly at the poles. No value grows and no factorial
is needed, so orders of several hundred keep full precision.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.geometry.directions import from_cosine


def orders(order: int) -> tuple[Tensor, Tensor]:
    """Return (l, m) of each coefficient up to `order`, both ((order+1)²,) integers."""
    _check_order(order)
    degree = torch.cat([torch.full((2 * k + 1,), k) for k in range(order + 1)])
    return degree, torch.cat([torch.arange(-k, k + 1) for k in range(order + 1)])


def normalised_legendre(order: int, cosine: Tensor) -> Tensor:
    """P̄_lm(cosθ) = N_lm P_lm(cosθ) for 0 ≤ m ≤ l ≤ `order`: (order+1, order+1, N), by [l, m]; 0 for m > l.

    `cosine` is (N,) in [−1, 1]. 2π ∫ P̄_lm² dcosθ = 1.
    """
    _check_order(order)
    sine = (1 - cosine**2).clamp_min(0).sqrt()
    values = cosine.new_zeros(order + 1, order + 1, len(cosine))
    values[0, 0] = math.sqrt(1 / (4 * math.pi))
    for m in range(1, order + 1):
        values[m, m] = math.sqrt((2 * m + 1) / (2 * m)) * sine * values[m - 1, m - 1]
    for degree in range(1, order + 1):
        m = torch.arange(degree, dtype=cosine.dtype, device=cosine.device)[:, None]
        a = torch.sqrt((4 * degree**2 - 1) / (degree**2 - m**2))
        below = values[degree - 2, :degree] if degree > 1 else torch.zeros_like(values[0, :1])
        b = torch.sqrt((((degree - 1) ** 2 - m**2) / (4 * (degree - 1) ** 2 - 1)).clamp_min(0))
        values[degree, :degree] = a * (cosine * values[degree - 1, :degree] - b * below)
    return values


def harmonics(order: int, w: Tensor) -> Tensor:
    """Y_lm(w) for every l ≤ `order`: (N, (order+1)²) from unit vectors (N, 3). Raises BadInput for order < 0."""
    values = normalised_legendre(order, w[:, 2])
    phi = torch.atan2(w[:, 1], w[:, 0])
    degree, m = (numbers.to(w.device) for numbers in orders(order))
    turn = m.abs()[:, None].to(phi) * phi
    wave = torch.where((m < 0)[:, None], torch.sin(turn), torch.cos(turn))
    # Not where(m == 0, 1.0, √2): of two Python numbers that would be float32.
    scale = torch.full_like(turn[:, :1], math.sqrt(2))
    scale[m == 0] = 1
    return (scale * values[degree, m.abs()] * wave).T


def zonal(order: int, cosine: Tensor) -> Tensor:
    """Y_l0 for l ≤ `order` at the cosines (N,) of the angle to the axis: (N, order+1)."""
    _check_order(order)
    legendre = [torch.ones_like(cosine), cosine]
    for degree in range(2, order + 1):
        legendre.append(((2 * degree - 1) * cosine * legendre[-1] - (degree - 1) * legendre[-2]) / degree)
    degree = torch.arange(order + 1, dtype=cosine.dtype, device=cosine.device)
    return torch.stack(legendre[: order + 1], 1) * torch.sqrt((2 * degree + 1) / (4 * math.pi))


@lru_cache(maxsize=64)
def gauss_legendre(count: int, low: float, high: float) -> tuple[Tensor, Tensor]:
    """Return (nodes, weights) of Gauss and Legendre on [low, high], both (count,) float64, nodes rising."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = (high - low) / 2
    return torch.from_numpy(nodes) * half + (high + low) / 2, torch.from_numpy(weights) * half


def quadrature(order: int, low: float = -1.0) -> tuple[Tensor, Tensor]:
    """Return (directions (Q, 3), weights (Q,) in sr): Gauss-Legendre in cosθ on [low, 1], even in φ.

    Exact for the product of two harmonics up to `order` on the whole sphere (low = −1): order+1 rings of 2·order+2.
    """
    _check_order(order)
    cosine, ring = gauss_legendre(order + 1, low, 1.0)
    turns = 2 * order + 2
    phi = torch.arange(turns, dtype=torch.float64) * (2 * math.pi / turns)
    directions = from_cosine(cosine[:, None].expand(-1, turns), phi.expand(order + 1, -1))
    return directions.reshape(-1, 3), (ring * (2 * math.pi / turns)).repeat_interleave(turns)


def project(function: Callable[[Tensor], Tensor], order: int, nodes: int | None = None, low: float = -1.0) -> Tensor:
    """Coefficients ((order+1)², C) of a function of unit vectors, (Q, 3) → (Q, C), by quadrature of order `nodes`.

    `low` is the smallest cosθ at which the function is not 0. With low = 0, a cut at the horizon costs no accuracy.
    `nodes` defaults to `order`; a function with content above `order` needs more.
    """
    w, weights = quadrature(order if nodes is None else nodes, low)
    return harmonics(order, w).T @ (weights[:, None] * function(w))


def energy_by_order(coefficients: Tensor) -> Tensor:
    """Σ_m c_lm² for each l, (order+1, …) from ((order+1)², …); a rotation of the function does not change it.

    Raises BadInput if the number of coefficients is not a square number.
    """
    order = math.isqrt(len(coefficients)) - 1
    if (order + 1) ** 2 != len(coefficients):
        raise BadInput(where="harmonics", found=f"{len(coefficients)} coefficients", expected="(order + 1)²")
    degree = orders(order)[0].to(coefficients.device)
    energies = coefficients.new_zeros(order + 1, *coefficients.shape[1:])
    return energies.index_add(0, degree, coefficients**2)


def order_for_share(energies: Tensor, share: float) -> float:
    """Return the order up to which `share` of the energy lies, between whole orders by linear interpolation.

    `energies` (order+1,) ≥ 0 by order. Orders without energy (every other one of an even function) are passed over.
    Raises BadInput for a share outside (0, 1) and for no energy.
    """
    check_share(share)
    if not float(energies.sum()) > 0:
        raise BadInput("no energy at any order", where="harmonics", expected="a function that is not zero")
    kept = (energies > 1e-14 * energies.max()).nonzero()[:, 0]
    reached = (energies[kept].cumsum(0) / energies.sum()).cpu().numpy()
    return float(np.interp(share, reached, kept.cpu().numpy()))


def check_share(share: float) -> None:
    """Raise BadInput for a share of the energy that is not inside (0, 1)."""
    if not 0 < share < 1:
        raise BadInput(where="share", found=share, expected="between 0 and 1")


def _check_order(order: int) -> None:
    if order < 0:
        raise BadInput(where="harmonics", found=f"order {order}", expected="0 or more")
