"""Coefficients of transfer functions and of reflected light fields, against closed forms and plain summation."""

import math

import pytest
import torch
from refusals import refused

from homofact.brdf.analytic import Lambert
from homofact.brdf.materials import material
from homofact.geometry.directions import draw_uniform
from homofact.theory.harmonics import harmonics, quadrature
from homofact.theory.reflection import (
    convolve_isotropic,
    directional_lighting,
    lambertian_filter,
    normalisation,
)
from homofact.theory.sphere_field import (
    SphereGrid,
    field_coefficients,
    frames,
    reflected_radiance,
    rotation_coefficients,
    transfer_coefficients,
)


def test_lambert_is_the_product_of_two_clamped_cosines() -> None:
    """ρ̃ = albedo/π cosθi cosθo: ρ̃_lp0 = albedo/π c_l c_p with c_l of (3.32), nothing at q ≠ 0."""
    found = transfer_coefficients(Lambert((0.25, 0.5), channels=("a", "b")), 5)
    cosine = lambertian_filter(5) / normalisation(5)
    for channel, albedo in enumerate((0.25, 0.5)):
        expected = torch.zeros(6, 6, 11, dtype=torch.float64)
        expected[:, :, 5] = albedo / math.pi * cosine[:, None] * cosine
        assert torch.allclose(found[..., channel], expected, atol=1e-12)


def test_a_reciprocal_model_has_symmetric_coefficients_that_sum_to_it() -> None:
    model = material("phong-10").model
    found = transfer_coefficients(model, 24, 60)[..., 1]
    assert torch.allclose(found, found.transpose(0, 1), atol=1e-12)
    assert torch.equal(found, found.flip(2))
    # Far from the horizon, where the cut rings.
    wi, wo = draw_uniform(200, torch.Generator().manual_seed(0))
    wi, wo = (w[(wi[:, 2] > 0.5) & (wo[:, 2] > 0.5)] for w in (wi, wo))
    seen, lit = harmonics(24, wo), harmonics(24, wi)
    total = torch.zeros(len(wi), dtype=torch.float64)
    for degree in range(25):
        for p in range(25):
            q = torch.arange(-min(degree, p), min(degree, p) + 1)
            own = lit[:, degree * degree + degree + q] * seen[:, p * p + p + q]
            total += own @ found[degree, p, 24 + q]
    expected = model.evaluate(wi, wo)[:, 1] * wi[:, 2] * wo[:, 2]
    assert float((total - expected).abs().max()) < 0.02 * float(expected.max())


def test_frames_stand_on_their_normals() -> None:
    normals = draw_uniform(50, torch.Generator().manual_seed(2))[0]
    normals = torch.cat((normals, -normals, torch.tensor([[0.0, 0, 1], [0, 0, -1]], dtype=torch.float64)))
    found = frames(normals)
    assert torch.allclose(found.transpose(1, 2) @ found, torch.eye(3).double().expand(len(found), 3, 3), atol=1e-12)
    assert torch.allclose(torch.linalg.det(found), torch.ones(len(found)).double())
    assert torch.equal(found[:, :, 2], normals)
    # A source at the pole falls in at (α, π) (3.15).
    local = found[:50].transpose(1, 2) @ torch.tensor([0.0, 0, 1], dtype=torch.float64)
    assert torch.allclose(local[:, 1], torch.zeros(50).double(), atol=1e-12)
    assert bool((local[:, 0] < 0).all())


def test_rotations_turn_harmonics() -> None:
    normals, w = draw_uniform(4, torch.Generator().manual_seed(3))
    turned = frames(normals)
    found = rotation_coefficients(4, turned)
    for each, own in zip(turned, found, strict=True):
        assert torch.allclose(harmonics(4, w @ each.T), harmonics(4, w) @ own.T, atol=1e-12)


@pytest.mark.slow
def test_a_lit_sphere_has_the_products_of_lighting_and_brdf() -> None:
    """(3.8) from first principles: f cosθi under one directional source, at every normal."""
    source = torch.tensor([0.48, -0.6, 0.64], dtype=torch.float64)
    model = material("phong-10").model
    grid = SphereGrid.of(24, 20)
    local = torch.einsum("nij,i->nj", grid.local_frames, source)
    pairs = (len(grid.normals), len(grid.wo))
    wi = local[:, None].expand(*pairs, 3).reshape(-1, 3)
    wo = grid.wo.expand(*pairs, 3).reshape(-1, 3)
    field = (model.evaluate(wi, wo)[:, 0] * wi[:, 2].clamp_min(0)).reshape(pairs)
    found = field_coefficients(field, grid, 3)
    expected = convolve_isotropic(directional_lighting(3, source), transfer_coefficients(model, 3, 40)[..., 0])
    # The grid feels the terminator's kink.
    assert torch.allclose(found, expected, atol=0.01 * float(expected.abs().max()))


def test_coefficients_come_back_from_their_own_light_field() -> None:
    generator = torch.Generator().manual_seed(4)
    lighting = torch.randn(9, dtype=torch.float64, generator=generator)
    transfer = transfer_coefficients(material("phong-10").model, 2)[..., 0]
    field = convolve_isotropic(lighting, transfer)
    # Views on both sides of the horizon, none at it: there the harmonics are orthogonal.
    whole = SphereGrid(*quadrature(4), *quadrature(5))
    assert torch.allclose(field_coefficients(reflected_radiance(field, whole), whole, 2), field, atol=1e-12)


def test_bad_light_fields() -> None:
    grid = SphereGrid.of(2, 2)
    with refused(where="light field", found="shape (3, 4)"):
        field_coefficients(torch.zeros(3, 4), grid, 1)
    with refused(where="light field", found="values that are not finite"):
        field_coefficients(torch.full((18, 18), math.nan), grid, 1)
