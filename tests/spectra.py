"""What the tests of the theory compare with: coefficients by quadrature, and a mirror's transfer function."""

import math
from collections.abc import Callable

import torch
from torch import Tensor

from homofact.theory.harmonics import gauss_legendre, zonal


def project_zonal(function: Callable[[Tensor], Tensor], order: int, nodes: int = 100, low: float = -1.0) -> Tensor:
    """Coefficients f_l (order+1,) of a function of the cosine to an axis, 0 below `low`: 2π ∫ f Y_l0 dcosθ."""
    cosine, weights = gauss_legendre(nodes, low, 1.0)
    return zonal(order, cosine).T @ (2 * math.pi * weights * function(cosine))


def mirror_transfer(order: int) -> Tensor:
    """ρ̂_lpq = (−1)^q δ_lp of a mirror, by [l, p, q + order] (Ramamoorthi 2002, 3.23); 0 for |q| > l."""
    values = torch.zeros(order + 1, order + 1, 2 * order + 1, dtype=torch.float64)
    for degree in range(order + 1):
        q = torch.arange(-degree, degree + 1)
        values[degree, degree, order - degree : order + degree + 1] = (1 - 2 * (q.abs() % 2)).double()
    return values
