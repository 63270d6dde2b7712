"""Spherical harmonics: orthonormal to order 100, scipy's up to the phase, and the addition theorem."""

import math

import numpy as np
import pytest
import torch
from refusals import refused
from scipy.special import sph_harm_y
from spectra import project_zonal

from homofact.geometry.directions import draw_uniform
from homofact.theory import harmonics as h


def everywhere(count: int, seed: int) -> torch.Tensor:
    """Directions on the whole sphere."""
    up, other = draw_uniform(count, torch.Generator().manual_seed(seed))
    up[:, 2] *= torch.where(other[:, 0] > 0, 1.0, -1.0)
    return up


def test_functions_of_one_azimuthal_order_are_orthonormal_to_order_100() -> None:
    """The quadrature of the module's own nodes, m by m: azimuths of different orders are orthogonal on even steps."""
    cosine, weights = h.gauss_legendre(101, -1.0, 1.0)
    legendre = h.normalised_legendre(100, cosine)
    for m in range(101):
        own = legendre[m:, m]
        gram = 2 * math.pi * (own * weights) @ own.T
        assert float((gram - torch.eye(101 - m)).abs().max()) < 1e-10
    assert float(legendre[:50, 50:].abs().max()) == 0


def test_all_harmonics_together_are_orthonormal_by_quadrature_over_the_sphere() -> None:
    w, weights = h.quadrature(40)
    assert float(weights.sum()) == pytest.approx(4 * math.pi, rel=1e-13)
    values = h.harmonics(40, w)
    gram = (values * weights[:, None]).T @ values
    assert float((gram - torch.eye(41**2)).abs().max()) < 1e-12


def test_they_are_scipys_without_its_phase() -> None:
    w = everywhere(30, 1)
    theta, phi = np.arccos(w[:, 2].numpy()), np.arctan2(w[:, 1].numpy(), w[:, 0].numpy())
    values = h.harmonics(100, w).numpy()
    for degree in (0, 1, 2, 7, 40, 100):
        for m in {0, 1, 2, degree // 2, degree} & set(range(degree + 1)):
            theirs = (-1) ** m * sph_harm_y(degree, m, theta, phi)
            pairs = [(m, theirs.real * (math.sqrt(2) if m else 1))]
            pairs += [(-m, theirs.imag * math.sqrt(2))] if m else []
            for signed, expected in pairs:
                assert np.abs(values[:, degree * degree + degree + signed] - expected).max() < 1e-11


def test_the_first_are_the_coordinates() -> None:
    w = everywhere(10, 2)
    values = h.harmonics(1, w)
    x, y, z = (w * math.sqrt(3 / (4 * math.pi))).T
    assert torch.allclose(values[:, 1:], torch.stack((y, z, x), 1), atol=1e-15)


def test_the_addition_theorem() -> None:
    """Σ_m Y_lm(a) Y_lm(b) = √((2l+1)/4π) Y_l0(a·b), at every l to 100."""
    a, b = everywhere(20, 3), everywhere(20, 4)
    products = h.harmonics(100, a) * h.harmonics(100, b)
    sums = torch.stack([products[:, k * k : (k + 1) ** 2].sum(1) for k in range(101)], 1)
    degree = torch.arange(101, dtype=torch.float64)
    expected = torch.sqrt((2 * degree + 1) / (4 * math.pi)) * h.zonal(100, (a * b).sum(1))
    assert float((sums - expected).abs().max()) < 1e-11


def test_a_band_limited_function_comes_back_and_its_energy_is_parsevals() -> None:
    wanted = torch.randn(36, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    found = h.project(lambda w: h.harmonics(5, w) @ wanted, 7)
    assert torch.allclose(found[:36], wanted, atol=1e-13)
    assert float(found[36:].abs().max()) < 1e-13
    assert torch.allclose(h.energy_by_order(found).sum(0), (wanted**2).sum(0))


def test_turning_a_function_leaves_the_energy_of_each_order() -> None:
    axis, other = everywhere(2, 6)
    energies = []
    for pole in (axis, other):
        coefficients = h.project(
            lambda w, pole=pole: torch.exp(3 * w @ pole)[:, None] + (w @ pole)[:, None] ** 5, 20, 40
        )
        energies.append(h.energy_by_order(coefficients)[:, 0])
    assert torch.allclose(*energies, rtol=1e-9, atol=1e-14)
    zonal = project_zonal(lambda c: torch.exp(3 * c) + c**5, 20) ** 2
    assert torch.allclose(energies[0], zonal, rtol=1e-9, atol=1e-14)


def test_the_order_of_a_share_lies_between_whole_ones() -> None:
    energies = torch.tensor([8.0, 0.0, 1.0, 0.0, 1.0], dtype=torch.float64)
    assert h.order_for_share(energies, 0.8) == 0
    assert h.order_for_share(energies, 0.85) == pytest.approx(1.0)
    assert h.order_for_share(energies, 0.95) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: h.harmonics(-1, everywhere(1, 0)), "found order -1, expected 0 or more"),
        (lambda: h.energy_by_order(torch.zeros(5)), "found 5 coefficients, expected"),
        (lambda: h.order_for_share(torch.ones(3), 1.0), "share: found 1.0, expected between 0 and 1"),
        (lambda: h.order_for_share(torch.zeros(3), 0.5), "no energy at any order"),
    ],
)
def test_what_cannot_be_meant_is_refused(call, expected: str) -> None:
    with refused(expected):
        call()
