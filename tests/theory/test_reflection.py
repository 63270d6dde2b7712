"""The formulas of Ramamoorthi's chapter 3 against quadrature and the digits printed there."""

import math

import pytest
import torch
from refusals import refused

from homofact.geometry.directions import draw_uniform, from_spherical
from homofact.theory import reflection as r
from homofact.theory.harmonics import (
    energy_by_order,
    gauss_legendre,
    harmonics,
    orders,
    project,
    project_zonal,
    quadrature,
)

Z = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
TILTED = torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64)


def by_quadrature(function, order: int, low: float = 0.0) -> torch.Tensor:
    """Λ_l ρ̂_l of a lobe that is a function of the cosine to its axis."""
    return project_zonal(function, order, 400, low) * r.normalisation(order)


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
        gap = (r.phong_filter(order, exponent) - r.phong_gaussian(order, exponent)).abs().max()
        gaps.append(float(gap))
    # The first correction is l/2s at l ~ √s.
    assert gaps[0] < 0.035
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.15)


def test_microfacets_are_nearly_their_gaussian_at_the_normal() -> None:
    """Eq. 3.44: θh is half the angle to the mirror direction; 3.51 up to O(σ), of l² for l(l+1)."""
    gaps = []
    for sigma in (0.05, 0.1, 0.2):

        def lobe(c: torch.Tensor, sigma: float = sigma) -> torch.Tensor:
            return torch.exp(-((torch.arccos(c) / (2 * sigma)) ** 2)) / (4 * math.pi * sigma**2)

        found = by_quadrature(lobe, 40)
        gaps.append(float((found - r.microfacet_filter(40, sigma)).abs().max()))
        assert gaps[-1] < 0.5 * sigma
    assert gaps[1] / gaps[0] == pytest.approx(2, rel=0.1)


def test_a_mirror_keeps_every_order() -> None:
    assert r.mirror_filter(5).tolist() == [1] * 6
    # ρ̂_lpq of a mirror by quadrature of Y_pq(θ, φ + π) Y_lq: (−1)^q δ_lp (3.23).
    w, weights = quadrature(6)
    turned = w * torch.tensor([-1.0, -1.0, 1.0], dtype=torch.float64)
    gram = (harmonics(6, w) * weights[:, None]).T @ harmonics(6, turned)
    degree, m = orders(6)
    transfer = r.mirror_transfer(6)
    for row in range(49):
        for column in range(49):
            expected = transfer[degree[row], degree[column], m[row] + 6] if m[row] == m[column] else 0.0
            assert float(gram[row, column]) == pytest.approx(float(expected), abs=1e-13)


def test_a_directional_source_has_all_orders_alike() -> None:
    """3.13, 3.14: L_lm = Y_lm(s), along z δ_m0/Λ_l; the condition of finding a BRDF is 1."""
    own = r.directional_lighting(8, Z)
    assert torch.allclose(own, r.axial_lighting(1 / r.normalisation(8)), atol=1e-14)
    tilted = r.directional_lighting(8, TILTED)
    assert torch.allclose(energy_by_order(tilted), energy_by_order(own), atol=1e-13)
    assert r.brdf_condition(tilted) == pytest.approx(1)
    # And reflected by Lambert it is the clamped cosine.
    normals = draw_uniform(50, torch.Generator().manual_seed(0))[0]
    lit = harmonics(40, normals) @ r.convolve(r.directional_lighting(40, TILTED), r.lambertian_filter(40))
    assert float((lit - (normals @ TILTED).clamp_min(0)).abs().max()) < 0.02


def test_uniform_light_tells_only_the_mean() -> None:
    own = r.uniform_lighting(4)
    assert float(own[0]) == pytest.approx(1 / math.sqrt(4 * math.pi))
    assert float(own[1:].abs().max()) == 0
    assert float(r.uniform_lighting(4, radiance=0.0)[0]) == 0
    assert r.brdf_condition(own) == math.inf
    assert r.brdf_condition(own, 0) == 1
    for brdf in (r.lambertian_filter(4) / math.pi, r.mirror_filter(4)):
        reflected = r.convolve(own, brdf)
        assert torch.allclose(reflected, own)
        found = r.inverse_brdf(reflected, own)
        assert float(found[0]) == pytest.approx(1)
        assert bool(found[1:].isnan().all())


def test_convolution_is_the_integral_over_the_light() -> None:
    """B(n) = ∫ L(ω) k(n·ω) dω by quadrature, for light of order 6 and Phong's lobe about n."""
    light = torch.randn(49, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    normal = from_spherical(torch.tensor(0.7, dtype=torch.float64), torch.tensor(2.1, dtype=torch.float64))
    w, weights = quadrature(40)
    cosine = (w @ normal).clamp_min(0)
    integral = (weights * (harmonics(6, w) @ light) * 21 / (2 * math.pi) * cosine**20).sum()
    series = harmonics(6, normal[None])[0] @ r.convolve(light, r.phong_filter(6, 20))
    assert float(series) == pytest.approx(float(integral), rel=1e-10)


def test_the_general_formula_holds_the_mirror_and_its_inverse() -> None:
    """3.5 with 3.23: B_lmlq = Λ_l (−1)^q L_lm (3.24)."""
    light = torch.randn(16, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    found = r.convolve_isotropic(light, r.mirror_transfer(3))
    degree, _ = orders(3)
    for row in range(16):
        own = int(degree[row])
        for q in range(-own, own + 1):
            expected = float(r.normalisation(3)[own] * light[row]) * (-1) ** q
            assert float(found[row, own, q + 3]) == pytest.approx(expected)
    assert int((found != 0).sum()) == sum((2 * k + 1) ** 2 for k in range(4))


def test_what_was_convolved_can_be_recovered_but_for_lamberts_zeros() -> None:
    light = torch.randn(36, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    for brdf in (r.phong_filter(5, 20), r.microfacet_filter(5, 0.3), r.mirror_filter(5)):
        reflected = r.convolve(light, brdf)
        assert torch.allclose(r.inverse_lighting(reflected, brdf), light)
        assert torch.allclose(r.inverse_brdf(reflected, light), brdf)
    found = r.inverse_lighting(r.convolve(light, r.lambertian_filter(5)), r.lambertian_filter(5))
    degree, _ = orders(5)
    assert torch.equal(found.isnan(), (degree == 3) | (degree == 5))
    few = r.inverse_lighting(r.convolve(light, r.lambertian_filter(5)), r.lambertian_filter(5), floor=0.2)
    assert torch.equal(few.isnan(), degree > 2)


def test_conditioning() -> None:
    assert r.lighting_condition(r.mirror_filter(30)) == 1
    assert r.lighting_condition(r.lambertian_filter(2)) == pytest.approx(4)
    assert r.lighting_condition(r.lambertian_filter(3)) == math.inf
    assert r.lighting_condition(r.phong_filter(20, 200), 20) == pytest.approx(math.exp(400 / 400), rel=0.1)
    # Well-conditioned up to order √s and 1/σ; Lambert's nine terms.
    assert r.recoverable_order(r.lambertian_filter(20), 0.05) == 2
    assert r.recoverable_order(r.phong_gaussian(60, 100), math.exp(-0.5)) == 10
    assert r.recoverable_order(r.microfacet_filter(60, 0.1), math.exp(-1.0001)) == 10


def test_nine_terms_hold_irradiance() -> None:
    assert r.irradiance_share(0) == pytest.approx(3 / 8)
    assert r.irradiance_share(2) == pytest.approx(127 / 128)  # "over 99%"
    assert r.irradiance_share(1) < 0.99
    assert r.irradiance_error_bound(2) == pytest.approx(3 / 32, abs=1e-9)
    # The bound is kept by light drawn at random, and nearly reached by a source.
    normals = draw_uniform(400, torch.Generator().manual_seed(4))[0]
    sources = quadrature(12)[0]
    generator = torch.Generator().manual_seed(5)
    for power in (1, 40):
        flux = torch.rand(len(sources), dtype=torch.float64, generator=generator) ** power
        flux = flux / flux.sum()
        exact = (normals @ sources.T).clamp_min(0) @ flux
        nine = r.convolve(harmonics(2, sources).T @ flux, r.lambertian_filter(2))
        assert float((harmonics(2, normals) @ nine - exact).abs().max()) <= 3 / 32 + 1e-12
    one = harmonics(2, normals) @ r.convolve(r.directional_lighting(2, TILTED), r.lambertian_filter(2))
    assert float((one - (normals @ TILTED).clamp_min(0)).abs().max()) > 0.09


def test_projecting_light_and_then_convolving_is_one_way_to_shade() -> None:
    sky = project(lambda w: 1 + 2 * w[:, 2:].clamp_min(0), 2, 60)[:, 0]
    up = harmonics(2, Z[None])[0] @ r.convolve(sky, r.lambertian_filter(2))
    cosine, weights = gauss_legendre(50, 0.0, 1.0)
    exact = 2 * math.pi * float((weights * cosine * (1 + 2 * cosine)).sum())
    assert float(up) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize(
    ("call", "expected"),
    [
        (lambda: r.phong_filter(3, -1), "exponent: found -1, expected 0 or more"),
        (lambda: r.phong_gaussian(3, 0), "exponent: found 0, expected above 0"),
        (lambda: r.microfacet_filter(3, math.nan), "sigma: found nan, expected above 0"),
        (lambda: r.convolve(torch.zeros(9), r.mirror_filter(3)), "found 9 coefficients beside a filter up to order 3"),
    ],
)
def test_what_cannot_be_meant_is_refused(call, expected: str) -> None:
    with refused(expected):
        call()
