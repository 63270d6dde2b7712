"""Power spectra of environment maps: closed forms, Parseval, and what turning leaves alone."""

import math

import pytest
import torch
from refusals import refused

from homofact.rendering.light import EnvironmentMap
from homofact.scene.lighting import environment_coefficients, solid_angles, texel_directions
from homofact.theory.harmonics import energy_by_order, harmonics, orders
from homofact.theory.light_power import light_power


def sky(values: torch.Tensor, rows: int) -> EnvironmentMap:
    return EnvironmentMap(values.reshape(rows, 2 * rows, -1))


def test_uniform_light_has_order_0_alone() -> None:
    found = light_power(sky(torch.full((8 * 16,), 3.0, dtype=torch.float64), 8), 6)
    # L_00 = 3 ∫ Y_00 = 3 √4π; a zone that is constant leaks a little where P_l is taken at its middle.
    assert found[0] == pytest.approx(9 * 4 * math.pi)
    assert found[1:].max() < 1e-3 * found[0]


@pytest.mark.parametrize("order", [1, 5, 12])
def test_a_harmonic_lies_in_its_own_order(order: int) -> None:
    """Whatever its axis: the map's is y, the harmonics' z."""
    rows = 96
    w = texel_directions(rows, 2 * rows)
    values = harmonics(order, w)[:, order**2 + 1]
    values = torch.stack((4 + values, 4 - 3 * values), 1)
    given = sky(torch.cat((values, values[:, :1]), 1), rows)
    found = light_power(given, 14) * (2 * torch.arange(15) + 1)
    # Mean of three channels: (1 + 9 + 1)/3.
    assert found[order] == pytest.approx(11 / 3, rel=0.02)
    found[[0, order]] = 0
    assert found.max() < 0.01


def test_the_orders_together_are_the_mean_square() -> None:
    rows = 40
    w = texel_directions(rows, 2 * rows)
    values = torch.exp(4 * (w @ torch.tensor([0.6, 0.0, 0.8], dtype=torch.float64) - 1)) + 0.1
    found = light_power(sky(values, rows), 30) * (2 * torch.arange(31) + 1)
    assert found.sum() == pytest.approx(float((values**2 * solid_angles(rows, 2 * rows)).sum()), rel=2e-3)


def test_it_agrees_with_the_coefficients_and_no_turn_changes_it() -> None:
    rng = torch.Generator().manual_seed(2)
    given = EnvironmentMap(torch.rand(64, 128, 3, generator=rng, dtype=torch.float64) ** 4)
    by_sum = energy_by_order(environment_coefficients(given, 10)).mean(1) / (2 * torch.arange(11) + 1)
    assert torch.allclose(light_power(given, 10), by_sum, rtol=0.03)
    assert torch.allclose(light_power(given.turned(1.0), 10), light_power(given, 10))


def test_a_coarse_map_is_resolved_for_high_orders() -> None:
    """A map of 4 rows and the same map with each texel divided are one light."""
    given = EnvironmentMap(torch.rand(4, 8, 1, generator=torch.Generator().manual_seed(1), dtype=torch.float64))
    fine = EnvironmentMap(given.radiance.repeat_interleave(32, 0).repeat_interleave(32, 1))
    assert torch.allclose(light_power(given, 4), light_power(fine, 4), rtol=0.05)
    assert len(orders(4)[0]) == 25


def test_a_negative_order_is_refused() -> None:
    with refused(where="harmonics", found="order -1"):
        light_power(sky(torch.ones(8 * 16, dtype=torch.float64), 8), -1)
