"""The formulas of Ramamoorthi's chapter 3 against quadrature and the digits printed there."""

import math

import pytest
import torch
from refusals import refused
from spectra import mirror_transfer, project_zonal

from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.theory import reflection as r
from homofact.theory.harmonics import (
    energy_by_order,
    gauss_legendre,
    harmonics,
    orders,
    project,
    quadrature,
)

Z = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
TILTED = torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64)


def by_quadrature(function, order: int, low: float = 0.0) -> torch.Tensor:
    """Λ_l ρ̂_l of a lobe that is a function of the cosine to its axis."""
    return project_zonal(function, order, 400, low) * r.normalisation(order)


def convolve(lighting: torch.Tensor, gains: torch.Tensor) -> torch.Tensor:
    """B_lm = Λ_l ρ̂_l L_lm (3.10)."""
    return lighting * gains[orders(len(gains) - 1)[0]]


def test_lambert_has_the_printed_digits_and_the_integrals() -> None:
    printed = [3.142, 2.094, 0.785, 0, -0.131, 0, 0.049]  # (3.33)
    assert [round(each, 3) for each in r.lambertian_filter(6).tolist()] == printed
    found = by_quadrature(lambda c: c, 60)
    assert torch.allclose(r.lambertian_filter(60), found, atol=1e-12)
    # Λ_l ρ̂_l falls as l^(−5/2).
    tail = r.lambertian_filter(400)
    assert float(tail[400] / tail[200]) == pytest.approx(2**-2.5, rel=0.02)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.5, 10.0, 30.0, 100.0])
def test_phong_is_its_integral(exponent: float) -> None:
    found = by_quadrature(lambda c: (exponent + 1) / (2 * math.pi) * c**exponent, 30)
    # Half-odd exponents have a kink that quadrature feels.
    assert torch.allclose(r.phong_filter(30, exponent), found, atol=1e-8 if exponent == 2.5 else 1e-12)


def test_phong_with_exponent_one_is_lambert_over_pi() -> None:
    assert torch.allclose(r.phong_filter(20, 1), r.lambertian_filter(20) / math.pi, atol=1e-15)


def test_phong_vanishes_beyond_the_exponent_at_its_parity_and_tends_to_a_gaussian() -> None:
    found = r.phong_filter(13, 5)
    assert found[[7, 9, 11, 13]].tolist() == [0, 0, 0, 0]
    assert float(found[8]) < 0 < float(found[10])
    gaps = []
    for exponent in (100, 1600):
        order = int(2 * math.sqrt(exponent))
        # exp(−l²/2s) (3.40).
        gaussian = torch.exp(-(torch.arange(order + 1).double() ** 2) / (2 * exponent))
        gap = (r.phong_filter(order, exponent) - gaussian).abs().max()
        gaps.append(float(gap))
    # The first correction is l/2s at l ~ √s.
    assert gaps[0] < 0.035
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.15)


def test_a_mirror_keeps_every_order() -> None:
    # ρ̂_lpq of a mirror by quadrature of Y_pq(θ, φ + π) Y_lq: (−1)^q δ_lp (3.23).
    w, weights = quadrature(6)
    turned = w * torch.tensor([-1.0, -1.0, 1.0], dtype=torch.float64)
    gram = (harmonics(6, w) * weights[:, None]).T @ harmonics(6, turned)
    degree, m = orders(6)
    transfer = mirror_transfer(6)
    for row in range(49):
        for column in range(49):
            expected = transfer[degree[row], degree[column], m[row] + 6] if m[row] == m[column] else 0.0
            assert float(gram[row, column]) == pytest.approx(float(expected), abs=1e-13)


def test_a_directional_source_has_all_orders_alike() -> None:
    """3.13, 3.14: L_lm = Y_lm(s), along z δ_m0/Λ_l; the condition of finding a BRDF is 1."""
    own = r.directional_lighting(8, Z)
    _, m = orders(8)
    assert torch.allclose(own[m == 0], 1 / r.normalisation(8), atol=1e-14)
    assert float(own[m != 0].abs().max()) < 1e-14
    tilted = r.directional_lighting(8, TILTED)
    assert torch.allclose(energy_by_order(tilted), energy_by_order(own), atol=1e-13)
    assert r.brdf_condition(tilted) == pytest.approx(1)
    # And reflected by Lambert it is the clamped cosine.
    normals = draw_uniform(50, torch.Generator().manual_seed(0))[0]
    lit = harmonics(40, normals) @ convolve(r.directional_lighting(40, TILTED), r.lambertian_filter(40))
    assert float((lit - (normals @ TILTED).clamp_min(0)).abs().max()) < 0.02


def test_uniform_light_tells_only_the_mean() -> None:
    own = r.uniform_lighting(4)
    assert float(own[0]) == pytest.approx(1 / math.sqrt(4 * math.pi))
    assert float(own[1:].abs().max()) == 0
    assert r.brdf_condition(own) == math.inf
    assert r.brdf_condition(own, 0) == 1


def test_convolution_is_the_integral_over_the_light() -> None:
    """B(n) = ∫ L(ω) k(n·ω) dω by quadrature, for light of order 6 and Phong's lobe about n."""
    light = torch.randn(49, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    normal = from_spherical(torch.tensor(0.7, dtype=torch.float64), torch.tensor(2.1, dtype=torch.float64))
    w, weights = quadrature(40)
    cosine = (w @ normal).clamp_min(0)
    integral = (weights * (harmonics(6, w) @ light) * 21 / (2 * math.pi) * cosine**20).sum()
    series = harmonics(6, normal[None])[0] @ convolve(light, r.phong_filter(6, 20))
    assert float(series) == pytest.approx(float(integral), rel=1e-10)


def test_the_general_formula_holds_the_mirror_and_its_inverse() -> None:
    """3.5 with 3.23: B_lmlq = Λ_l (−1)^q L_lm (3.24)."""
    light = torch.randn(16, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    found = r.convolve_isotropic(light, mirror_transfer(3))
    degree, _ = orders(3)
    for row in range(16):
        own = int(degree[row])
        for q in range(-own, own + 1):
            expected = float(r.normalisation(3)[own] * light[row]) * (-1) ** q
            assert float(found[row, own, q + 3]) == pytest.approx(expected)
    assert int((found != 0).sum()) == sum((2 * k + 1) ** 2 for k in range(4))


def test_conditioning() -> None:
    assert r.lighting_condition(torch.ones(31)) == 1
    assert r.lighting_condition(r.lambertian_filter(2)) == pytest.approx(4)
    assert r.lighting_condition(r.lambertian_filter(3)) == math.inf
    assert r.lighting_condition(r.phong_filter(20, 200), 20) == pytest.approx(math.exp(400 / 400), rel=0.1)


def test_projecting_light_and_then_convolving_is_one_way_to_shade() -> None:
    sky = project(lambda w: 1 + 2 * w[:, 2:].clamp_min(0), 2, 60)[:, 0]
    up = harmonics(2, Z[None])[0] @ convolve(sky, r.lambertian_filter(2))
    cosine, weights = gauss_legendre(50, 0.0, 1.0)
    exact = 2 * math.pi * float((weights * cosine * (1 + 2 * cosine)).sum())
    assert float(up) == pytest.approx(exact, rel=0.02)


def test_what_cannot_be_meant_is_refused() -> None:
    with refused("exponent: found -1, expected 0 or more"):
        r.phong_filter(3, -1)
