"""The grid of half vectors of a lobe's table: nodes and places are inverse, and nodes are fitted to interpolation."""

import math

import pytest
import torch

from homofact.relighting.slope_grid import FARTHEST, fitted, node_slopes, places_of

WIDTH = 0.1


@pytest.mark.parametrize("whole", [False, True], ids=["half", "whole"])
def test_places_of_the_nodes_are_even(whole: bool) -> None:
    slopes = node_slopes(9, 17, WIDTH, whole)
    along, around = places_of(slopes.reshape(-1, 2), WIDTH, whole)
    first, second = torch.linspace(0, 1, 9).double(), torch.linspace(0, 1, 17).double()
    assert torch.allclose(along.reshape(9, 17), first[:, None].expand(9, 17), atol=1e-12)
    # The peak has no place around, and a whole circle ends where it begins.
    last = 16 if whole else 17
    assert torch.allclose(around.reshape(9, 17)[1:, :last], second[:last].expand(8, last), atol=1e-12)
    assert torch.allclose(slopes[:, 0], slopes[:, -1], atol=1e-12) is whole
    assert float(slopes[-1].norm(dim=1).max()) == pytest.approx(FARTHEST)
    assert float(places_of(torch.tensor([[3 * FARTHEST, 0.0]]).double(), WIDTH, whole)[0]) == 1.0


@pytest.mark.parametrize("whole", [False, True], ids=["half", "whole"])
def test_places_around_rise_with_the_angle(whole: bool) -> None:
    angle = torch.linspace(1e-6, (2 if whole else 1) * math.pi - 1e-6, 200, dtype=torch.float64)
    around = places_of(torch.stack((angle.cos(), angle.sin()), 1), WIDTH, whole)[1]
    steps = around.diff()
    assert float(steps.min()) > 0
    assert float(steps.max() / steps.min()) < 2.01
    assert float(around[0]) == pytest.approx(0, abs=1e-5)
    assert float(around[-1]) == pytest.approx(1, abs=1e-5)
    below = places_of(torch.tensor([[0.3, -0.4], [0.3, 0.4]]).double(), WIDTH, whole)[1]
    assert bool(below[0] == below[1]) is not whole


@pytest.mark.parametrize("whole", [False, True], ids=["half", "whole"])
def test_nodes_are_fitted_to_linear_interpolation(whole: bool) -> None:
    """A wave around errs between the nodes by half of what its samples would, at the ends of the circle too."""
    place = torch.linspace(0, 1, 13, dtype=torch.float64)
    turns, start = (2, 0.7) if whole else (1, 0.0)
    samples = (3 + torch.cos(math.pi * turns * place + start)).expand(5, 13)[..., None]
    held, fine = fitted(samples, whole), torch.linspace(0, 1, 1201, dtype=torch.float64)
    exact = 3 + torch.cos(math.pi * turns * fine + start)

    def between(values: torch.Tensor) -> torch.Tensor:
        at = fine * 12
        low = at.long().clamp_max(11)
        return values[2, low, 0] * (1 - at + low) + values[2, low + 1, 0] * (at - low)

    before, after = (float((between(each) - exact).norm()) for each in (samples, held))
    assert after < 0.45 * before
    # Every node is fitted, those at both ends as those between.
    expected = (2 * math.cos(math.pi * turns / 12) - 2) / 12 * torch.cos(math.pi * turns * place + start)
    assert torch.allclose((samples - held)[2, :, 0], expected, atol=1e-12)


def test_along_the_slope_nodes_are_fitted_too_but_never_below_half() -> None:
    place = torch.linspace(0, 1, 9, dtype=torch.float64)
    parabola = (2 - place**2)[:, None, None].expand(9, 4, 1)
    assert torch.allclose((fitted(parabola, False) - parabola)[1:-1], torch.tensor(2 / 64 / 12).double())
    steep = torch.exp(-40 * place**2)[:, None, None].expand(9, 4, 1)
    assert (fitted(steep, False) >= steep / 2).all()
