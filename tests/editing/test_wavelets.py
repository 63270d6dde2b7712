"""Daubechies 4 as the appendix prints it, and pictures by increments."""

import pytest
import torch

from homofact.editing.curves import banded
from homofact.editing.starts import beckmann, cosine_power
from homofact.editing.wavelets import HIGH, LOW, Incremental, largest, non_linear, transformed
from homofact.errors import BadInput

DRAW = torch.Generator().manual_seed(2)


def smooth_transport(pixels: int = 200, bands: int = 256, channels: int = 3) -> torch.Tensor:
    """T (P, C, J) of peaks at different places."""
    at = torch.rand(pixels, channels, 1, dtype=torch.float64, generator=DRAW)
    place = (torch.arange(bands, dtype=torch.float64) + 0.5) / bands
    return torch.exp(-(((place - at) / 0.05) ** 2)) + 0.1


def test_filters_are_those_of_the_appendix() -> None:
    printed = (0.4829629131445341, 0.8365163037378077, 0.2241438680420134, -0.1294095225512603)
    assert pytest.approx(printed, abs=1e-15) == LOW
    assert pytest.approx((printed[3], -printed[2], printed[1], -printed[0]), abs=1e-15) == HIGH


@pytest.mark.parametrize("length", [4, 32, 256])
def test_the_transform_is_orthonormal(length: int) -> None:
    matrix = transformed(torch.eye(length, dtype=torch.float64))
    assert torch.allclose(matrix @ matrix.T, torch.eye(length, dtype=torch.float64), atol=1e-13)
    values = torch.randn(3, length, dtype=torch.float64, generator=DRAW)
    assert torch.allclose(transformed(values) @ matrix.T, values, atol=1e-13)


def test_straight_lines_have_no_detail() -> None:
    """Two vanishing moments: the finest details of a ramp are 0, but where it jumps round the end."""
    found = transformed(torch.arange(64, dtype=torch.float64))
    assert float(found[32:63].abs().max()) < 1e-12
    assert float(found[63].abs()) > 1


def test_lengths_that_do_not_halve_are_refused() -> None:
    for length in (2, 100):
        with pytest.raises(BadInput, match="expected a power of two of at least 4"):
            transformed(torch.zeros(length))


def test_the_largest_are_chosen_and_nothing_is_not() -> None:
    assert largest(torch.tensor([0.0, -3.0, 1.0, 2.0]), 2).tolist() == [1, 3]
    assert largest(torch.tensor([0.0, -3.0, 0.0]), 5).tolist() == [1]


def test_increments_settle_at_the_full_sum() -> None:
    table = smooth_transport()
    made = Incremental.of(table, banded(beckmann(0.2, 3), 256).values)
    exact = torch.einsum("pcj,jc->pc", table, banded(beckmann(0.2, 3), 256).values)
    assert float((made.shown - exact).abs().max() / exact.abs().max()) < 1e-6
    for curve in (beckmann(0.3, 3), cosine_power(40, 3), beckmann(0.1, 3)):
        values = banded(curve, 256).values
        exact = torch.einsum("pcj,jc->pc", table, values)
        made.set_curve(values)
        errors, frames = [], 0
        while not made.settled:
            assert made.update(30) > 0
            errors.append(float((made.shown - exact).square().mean().sqrt()))
            frames += 1
        assert made.update(30) == 0
        assert frames <= 9
        assert errors[0] < errors[-1] * 1e9
        difference = (made.shown - exact).square().mean().sqrt() / exact.square().mean().sqrt()
        assert float(difference) < 1e-6


def test_a_local_edit_takes_few_terms_where_the_whole_curve_takes_many() -> None:
    """Figure 5: the budget goes to what changed; the non-linear approximation spends it on the peak."""
    table, before = smooth_transport(), banded(beckmann(0.05, 3), 256).values
    after = before.clone()
    bump = torch.exp(-(((torch.arange(256) - 180.0) / 6) ** 2)).double()
    after += 0.02 * float(before.max()) * bump[:, None] * torch.tensor([1.0, 0.2, 0.1]).double()
    exact = torch.einsum("pcj,jc->pc", table, after)
    made = Incremental.of(table, before)
    made.set_curve(after)
    assert made.update(30) == 30
    plain = non_linear(table, after, 30)
    errors = [float((found - exact).square().mean().sqrt()) for found in (made.shown, plain)]
    assert errors[0] < errors[1] / 5


def test_no_edit_no_work_and_refreshing_changes_nothing() -> None:
    table = smooth_transport(20)
    made = Incremental.of(table, banded(beckmann(0.2, 3), 256).values)
    shown = made.shown.clone()
    assert made.settled
    assert made.update() == 0
    made.refresh()
    assert torch.equal(made.shown, shown)
