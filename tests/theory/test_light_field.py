"""Lighting and BRDF out of a planted light field: up to one scale, by reciprocity, and never guessed."""

import math

import pytest
import torch
from refusals import refused
from spectra import mirror_transfer
from torch import Tensor

from homofact.brdf.analytic import Lambert
from homofact.brdf.materials import material
from homofact.theory.harmonics import orders
from homofact.theory.light_field import LightFieldFactors, factor_by_ratios, factor_light_field
from homofact.theory.reflection import (
    brdf_condition,
    convolve_isotropic,
    directional_lighting,
    lighting_condition,
    normalisation,
    phong_filter,
    uniform_lighting,
)
from homofact.theory.sphere_field import transfer_coefficients

ORDER = 6
DEGREE = orders(ORDER)[0]


@pytest.fixture(scope="module")
def transfer() -> Tensor:
    """A broad lobe over a matte base: every order couples with every other."""
    return transfer_coefficients(material("cook-torrance-plastic").model, ORDER)[..., 0]


def random_lighting(seed: int = 0) -> Tensor:
    found = torch.randn((ORDER + 1) ** 2, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    found[0] = 5.0
    return found


def white(field: Tensor, noise: float, seed: int = 1) -> Tensor:
    return field + noise * torch.randn(field.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


def scale(lighting: Tensor) -> float:
    """Λ_0 L_00, what the factors have at 1."""
    return float(normalisation(0)[0] * lighting[0])


def test_a_planted_pair_comes_back_up_to_one_scale(transfer: Tensor) -> None:
    lighting = random_lighting()
    found = factor_light_field(convolve_isotropic(lighting, transfer))
    assert found.scales.tolist() == [0] * (ORDER + 1)
    assert torch.allclose(found.lighting * scale(lighting), lighting, atol=1e-10)
    assert torch.allclose(found.transfer / scale(lighting), transfer, atol=1e-11)
    assert found.residual < 1e-12
    by_ratios = factor_by_ratios(convolve_isotropic(lighting, transfer))
    assert torch.allclose(by_ratios[0], found.lighting, atol=1e-9)
    assert torch.allclose(by_ratios[1], found.transfer, atol=1e-9)


def test_one_scale_more_on_the_lighting_is_one_less_on_the_brdf(transfer: Tensor) -> None:
    lighting = random_lighting()
    found = factor_light_field(convolve_isotropic(lighting, transfer))
    again = factor_light_field(convolve_isotropic(7 * lighting, transfer))
    assert torch.allclose(again.lighting, found.lighting, atol=1e-10)
    assert torch.allclose(again.transfer, 7 * found.transfer, atol=1e-9)


def test_a_directional_source_gives_the_whole_brdf(transfer: Tensor) -> None:
    """(3.17): a light in one direction, found as such."""
    lighting = directional_lighting(ORDER, torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64))
    found = factor_light_field(convolve_isotropic(lighting, transfer))
    assert torch.allclose(found.lighting * scale(lighting), lighting, atol=1e-10)
    assert torch.allclose(found.transfer / scale(lighting), transfer, atol=1e-11)
    assert found.brdf_condition == pytest.approx(1, abs=1e-9)


def test_reciprocity_gives_what_an_order_without_light_cannot(transfer: Tensor) -> None:
    """No light of order 3: ρ̃_3pq is known as ρ̃_p3q, ρ̃_33q from nowhere; that the light has none is known."""
    lighting = torch.where(DEGREE == 3, torch.zeros(()).double(), random_lighting())
    found = factor_light_field(convolve_isotropic(lighting, transfer))
    assert found.scales.tolist() == [0, 0, 0, -1, 0, 0, 0]
    assert torch.allclose(found.lighting[DEGREE == 3], torch.zeros(7).double(), atol=1e-10)
    lost = found.transfer.isnan()
    assert lost[3, 3, ORDER - 3 : ORDER + 4].all()
    assert int(lost.sum()) == 7
    assert torch.allclose(found.transfer[~lost] / scale(lighting), transfer[~lost], atol=1e-11)
    assert math.isinf(found.brdf_condition)
    assert "not excited by the lighting: order 3" in found.describe()
    # The chapter's ratio has 0/0 there.
    assert factor_by_ratios(convolve_isotropic(lighting, transfer))[1][3].isnan().all()


def test_uniform_light_is_found_uniform_and_tells_order_0_of_the_brdf_alone(transfer: Tensor) -> None:
    """Section 3.2.3: only ρ̃_0p0, and by reciprocity ρ̃_p00."""
    found = factor_light_field(convolve_isotropic(uniform_lighting(ORDER), transfer))
    known = ~found.transfer.isnan()
    expected = torch.zeros_like(known)
    expected[0, :, ORDER] = expected[:, 0, ORDER] = True
    # Beyond q = min(l, p) there is nothing to know.
    q = torch.arange(-ORDER, ORDER + 1).abs()
    least = torch.minimum(*torch.meshgrid(torch.arange(ORDER + 1), torch.arange(ORDER + 1), indexing="ij"))
    assert torch.equal(known & (q <= least[..., None]), expected)
    assert torch.allclose(found.transfer[expected], transfer[expected], atol=1e-12)
    assert torch.allclose(found.lighting[1:], torch.zeros((ORDER + 1) ** 2 - 1).double(), atol=1e-10)


def test_what_neither_light_nor_brdf_shows_stays_open() -> None:
    """Lambert under uniform light: ρ̃_0p0 is 0 at odd p > 1, so that light of these orders would not be seen."""
    matte = transfer_coefficients(Lambert((0.5,), channels=("grey",)), ORDER)[..., 0]
    found = factor_light_field(convolve_isotropic(uniform_lighting(ORDER), matte))
    unknown = found.lighting.isnan()
    assert torch.equal(unknown, (DEGREE == 3) | (DEGREE == 5))
    assert torch.allclose(found.lighting[~unknown][1:], torch.zeros(30).double(), atol=1e-9)
    assert math.isinf(found.lighting_condition)


@pytest.mark.parametrize("gains", [torch.ones(ORDER + 1).double(), phong_filter(ORDER, 10)], ids=["mirror", "phong"])
def test_a_mirror_leaves_a_scale_of_every_order_open(gains: Tensor) -> None:
    """(3.26), (3.41): whatever the mirror passes of an order, the light field is that of a mirror under other light."""
    lighting = random_lighting()
    mirror = mirror_transfer(ORDER) * gains[:, None, None]
    found = factor_light_field(convolve_isotropic(lighting, mirror))
    assert found.scales.tolist() == list(range(ORDER + 1))
    for each in range(ORDER + 1):
        own, expected = found.lighting[each == DEGREE], lighting[each == DEGREE]
        assert float(own.abs().max() * normalisation(each)[each]) == pytest.approx(1)
        assert torch.allclose(own / own.norm() * torch.sign(own[0] * expected[0]), expected / expected.norm())
    assert found.known_lighting.tolist() == [True] + [False] * (len(DEGREE) - 1)
    assert bool(found.known_transfer[0, 0].all())
    assert int(found.known_transfer.any(2).sum()) == 1
    assert "6 more scales cannot be told from the lighting's" in found.describe()
    assert torch.allclose(convolve_isotropic(found.lighting, found.transfer), convolve_isotropic(lighting, mirror))


def errors(found: LightFieldFactors, lighting: Tensor, transfer: Tensor) -> tuple[Tensor, Tensor]:
    """How far both are from the planted, in the scale of the factors."""
    return found.lighting - lighting / scale(lighting), found.transfer - transfer * scale(lighting)


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
def test_the_errors_stated_are_those_made(transfer: Tensor, noise: float) -> None:
    lighting = random_lighting()
    field = convolve_isotropic(lighting, transfer)
    shown = orders(ORDER)[0] > 0
    squares, transfer_squares = [], []
    for seed in range(16):
        found = factor_light_field(white(field, noise, seed), noise)
        wrong, wrong_transfer = errors(found, lighting, transfer)
        squares.append(((wrong / found.lighting_error)[shown] ** 2).mean())
        some = found.transfer_error > 0
        transfer_squares.append(((wrong_transfer / found.transfer_error)[some] ** 2).mean())
    assert float(torch.stack(squares).mean().sqrt()) == pytest.approx(1, abs=0.1)
    # Those of unlike l and p with q ≠ 0 have four coefficients to them, l = p with q = 0 has one.
    assert float(torch.stack(transfer_squares).mean().sqrt()) == pytest.approx(1, abs=0.07)


def test_least_squares_over_all_coefficients_beats_the_ratios(transfer: Tensor) -> None:
    lighting, noise = random_lighting(), 1e-3
    field = white(convolve_isotropic(lighting, transfer), noise)
    found = factor_light_field(field, noise)
    ratios = factor_by_ratios(field)
    expected = lighting / scale(lighting)
    assert float((found.lighting - expected).norm()) < 0.3 * float((ratios[0] - expected).norm())
    wrong = found.transfer - transfer * scale(lighting)
    assert float(wrong.norm()) < 0.5 * float((ratios[1] - transfer * scale(lighting)).norm())


def test_the_conditions_are_those_of_what_was_planted_and_say_how_noise_grows(transfer: Tensor) -> None:
    """Light whose high orders fade: the BRDF's error there grows as their amplitude falls."""
    made = {}
    for fading in (1.0, 0.25):
        lighting = random_lighting() * fading ** DEGREE.double()
        field = convolve_isotropic(lighting, transfer)
        found = factor_light_field(field, 1e-7)
        assert found.brdf_condition == pytest.approx(brdf_condition(lighting), rel=1e-6)
        filtered = normalisation(ORDER) * transfer.square().sum((1, 2)).sqrt()
        assert found.lighting_condition == pytest.approx(lighting_condition(filtered), rel=1e-6)
        made[fading] = found
    worse = float(made[0.25].transfer_error[ORDER, ORDER].max() / made[1.0].transfer_error[ORDER, ORDER].max())
    assert worse == pytest.approx(made[0.25].brdf_condition / made[1.0].brdf_condition, rel=0.3)
    assert worse > 100


def test_orders_that_sink_in_the_noise_are_not_recovered(transfer: Tensor) -> None:
    lighting = torch.where(DEGREE == 4, 1e-6, random_lighting())
    field = convolve_isotropic(lighting, transfer)
    assert factor_light_field(white(field, 1e-9), 1e-9).scales[4] == 0
    assert factor_light_field(white(field, 1e-4), 1e-4).scales[4] == -1


@pytest.mark.parametrize(
    ("field", "noise", "words"),
    [
        (torch.zeros(9, 3, 5), 0.0, "every coefficient is 0"),
        (torch.ones(9, 3), 0.0, r"shape \(9, 3\), expected \(\(n\+1\)², n\+1, 2n\+1\)"),
        (torch.ones(8, 3, 5), 0.0, r"shape \(8, 3, 5\)"),
        (torch.full((9, 3, 5), math.nan), 0.0, "not finite"),
        (torch.ones(9, 3, 5), -1.0, "noise: found -1.0, expected a finite number of 0 or more"),
        (torch.ones(9, 3, 5), math.inf, "noise: found inf"),
    ],
)
def test_bad_fields(field: Tensor, noise: float, words: str) -> None:
    with refused(words):
        factor_light_field(field, noise)
