"""Projections: orthonormal rows that fit the square, conjugates, warps, fixed names."""

import math

import numpy as np
import pytest
import torch

from homofact.errors import BadInput
from homofact.factor.fixed_projections import FIXED_PROJECTIONS
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.geometry.coordinates import COORDINATES
from homofact.geometry.directions import draw_in_discs
from homofact.geometry.rotation import Rotation
from homofact.linear.layout import CLAMPED, Axis

SEARCHED = [name for name, system in COORDINATES.items() if not system.periodic]
PAIRS = draw_in_discs(3000, torch.Generator().manual_seed(3))


def _random(coordinates: str, generator: torch.Generator, bound: str = "disc") -> Projection:
    rotation = Rotation.random(generator, COORDINATES[coordinates].dimension)
    return Projection.from_rotation(coordinates, rotation, True, bound)


@pytest.mark.parametrize("bound", ["disc", "cube"])
@pytest.mark.parametrize("coordinates", SEARCHED)
def test_rows_are_orthogonal_and_the_domain_just_fits(coordinates: str, bound: str) -> None:
    generator = torch.Generator().manual_seed(0)
    for _ in range(20):
        projection = _random(coordinates, generator, bound)
        assert abs(float(projection.matrix[0] @ projection.matrix[1])) < 1e-12
        for uv in projection.place(*PAIRS):
            assert float(uv.abs().max()) <= 1 + 1e-12
        if bound == "disc" and COORDINATES[coordinates].domain == "discs":
            for row in projection.matrix:
                rim = np.concatenate((row[:2] / np.linalg.norm(row[:2]), row[2:] / np.linalg.norm(row[2:])))
                assert float(row @ rim) == pytest.approx(1, abs=1e-12)
        if bound == "cube" or COORDINATES[coordinates].domain == "box":
            assert np.allclose(abs(projection.matrix).sum(1), 1)


@pytest.mark.parametrize("coordinates", SEARCHED)
def test_the_conjugate_swaps_the_directions(coordinates: str) -> None:
    projection = _random(coordinates, torch.Generator().manual_seed(1))
    wi, wo = PAIRS
    there, back = projection.place(wi, wo), projection.place(wo, wi)
    assert torch.allclose(there[0], back[-1], atol=1e-9)
    assert torch.allclose(there[-1], back[0], atol=1e-9)
    assert projection.lookups == (1 if coordinates in ("isotropic-half-diff", "isotropic-half-tilt") else 2)


def test_thesis_conjugate_matrices() -> None:
    """Section 3.2.3: (a b c d) becomes (c d a b) for in-out and (a b -c -d) for half-diff."""
    rows = torch.tensor([[1.0, 2, 3, 4], [5, 6, 7, 8]], dtype=torch.float64)
    in_out = Projection("in-out", rows, True).matrices()[1]
    half_diff = Projection("half-diff", rows, True).matrices()[1]
    assert in_out.tolist() == [[3, 4, 1, 2], [7, 8, 5, 6]]
    assert half_diff.tolist() == [[1, 2, -3, -4], [5, 6, -7, -8]]


def test_mccools_projections_need_three_lookups() -> None:
    assert [fixed_projection(name, True).lookups for name in ("wi", "h")] == [2, 1]
    assert fixed_projection("wi", False).lookups == 1


@pytest.mark.parametrize("name", FIXED_PROJECTIONS)
def test_fixed_projections_take_coordinates_as_they_are(name: str) -> None:
    projection = fixed_projection(name, False)
    uv = projection.place(*PAIRS)[0]
    axes = [int(row.argmax()) for row in projection.matrix if bool((row != 0).any())]
    x = projection.system.evaluate(*PAIRS)
    assert torch.equal(uv[:, : len(axes)], x[:, axes])


@pytest.mark.parametrize("coordinates", ["half-diff", "isotropic-half-diff"])
def test_a_warp_keeps_the_domain_and_spreads_the_peak(coordinates: str) -> None:
    system = COORDINATES[coordinates]
    x = system.evaluate(*PAIRS)
    warped = Warp(0.05).on(system, x)
    assert float(warped.abs().max()) <= 1 + 1e-12
    assert torch.equal(warped[:, -1], x[:, -1])

    def radius(width: float, rho: float) -> float:
        """Where the warp takes a radius of 0 … 1."""
        begin = (rho, 0.0) if coordinates == "half-diff" else (2 * rho - 1,)
        at = torch.zeros(1, system.dimension, dtype=torch.float64)
        at[0, : len(begin)] = torch.tensor(begin, dtype=torch.float64)
        found = float(Warp(width).on(system, at)[0, 0])
        return found if coordinates == "half-diff" else (found + 1) / 2

    assert [radius(0.05, 0), radius(0.05, 1)] == pytest.approx([0, 1], abs=1e-12)
    assert radius(0.05, 0.05) == pytest.approx(math.asinh(1) / math.asinh(20))
    assert radius(1e6, 0.3) == pytest.approx(0.3, rel=1e-9)


def test_which_axes_go_round_is_read_off_the_matrix() -> None:
    """θh runs along the columns, from the pole; φh along the rows, round."""
    assert fixed_projection("theta_h-phi_h", True).axes == (Axis.PERIODIC, Axis.POLAR)
    assert fixed_projection("theta_h-phi_h", True).lookups == 1
    assert fixed_projection("theta_h-theta_d", True).axes == CLAMPED
    rows = torch.eye(2, dtype=torch.float64)
    assert Projection("half-angles", rows.flip(0), True).axes == (Axis.POLAR, Axis.PERIODIC)
    # From the other end, θh has its pole at the last texel.
    assert Projection("half-angles", -rows, True).axes == (Axis.PERIODIC, Axis.CLAMPED)
    assert Projection("half-angles", torch.tensor([[1.0, 0], [0, 0]]), True).axes == CLAMPED


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Projection("half-angles", torch.tensor([[0.6, 0.4], [0, 1]]), True), "mixes or scales phi_h"),
        (lambda: Projection("half-angles", torch.tensor([[1.0, 0], [0, 0.5]]), True), "mixes or scales phi_h"),
        (lambda: fixed_projection("halfway", True), "projection: found 'halfway', expected one of wi, wo, h"),
        (lambda: Projection("polar", torch.zeros(2, 4), True), "coordinates: found 'polar'"),
        (lambda: Projection("in-out", torch.zeros(2, 3), True), r"shape \(2, 3\), expected \(2, 4\)"),
        (lambda: Projection("in-out", torch.full((2, 4), float("nan")), True), "not finite"),
        (lambda: Projection.from_rows("in-out", torch.eye(2, 4), True, "ball"), "bound: found 'ball'"),
        (
            lambda: Projection("in-out", torch.eye(2, 4), True, warp=Warp(0.1)).prepare(*PAIRS),
            "warp: found the coordinates u_i, v_i, u_o, v_o, expected some with a half vector",
        ),
    ],
)
def test_bad_projections_are_named(call, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        call()


@pytest.mark.parametrize("name", FIXED_PROJECTIONS)
def test_a_projection_is_one_way_where_swapped_directions_have_another_place(name: str) -> None:
    generator = torch.Generator().manual_seed(1)
    wi, wo = draw_in_discs(50, generator)
    alone, both = (fixed_projection(name, reciprocal=reciprocal) for reciprocal in (False, True))
    (place,), (other,) = (alone.place(*pair) for pair in ((wi, wo), (wo, wi)))
    assert alone.one_way == (not torch.allclose(place, other, atol=1e-9))
    assert not both.one_way
