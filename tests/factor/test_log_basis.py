"""A basis of log textures, and the gauge that makes textures comparable: laws."""

import pytest
import torch

from homofact.errors import BadInput
from homofact.factor.factorization import Term, sum_of_terms
from homofact.factor.gauge import gauge_rows, in_gauge, null_space
from homofact.factor.log_basis import LogBasis
from homofact.factor.projection import fixed_projection, layout_of
from homofact.factor.textures import LogSamples, domain_masks, inner_problem
from homofact.geometry.directions import draw_uniform

PROJECTIONS = (fixed_projection("theta_h-theta_d", True), fixed_projection("theta_i-theta_o", True))
SHAPES = ((4, 5), (3, 4))
LAYOUT = layout_of(PROJECTIONS, SHAPES)
MASKS = domain_masks(PROJECTIONS, SHAPES)


def drawn(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


STACK = drawn(6, LAYOUT.unknowns, 3)


def values(texels: torch.Tensor) -> torch.Tensor:
    """The sum of the textures at pairs, (N, C)."""
    parts = zip(PROJECTIONS, LAYOUT.split(texels), MASKS, strict=True)
    terms = tuple(Term(projection, texture, mask) for projection, texture, mask in parts)
    return sum_of_terms(terms, *draw_uniform(300, torch.Generator().manual_seed(1)))


def test_the_gauge_changes_no_value_and_makes_equal_sums_equal_texels() -> None:
    fixed = in_gauge(STACK[0], PROJECTIONS, MASKS)
    torch.testing.assert_close(values(fixed), values(STACK[0]), rtol=0, atol=1e-12)
    assert (gauge_rows(PROJECTIONS, MASKS).T @ fixed).abs().max() < 1e-12
    null = null_space(PROJECTIONS, MASKS)
    assert null.shape[1] >= 1
    moved = STACK[0] + null @ drawn(null.shape[1], 3, seed=2)
    assert (moved - STACK[0]).abs().max() > 0.1
    torch.testing.assert_close(in_gauge(moved, PROJECTIONS, MASKS), fixed, rtol=0, atol=1e-12)


def test_one_direction_less_than_materials_gives_every_texture_back() -> None:
    basis = LogBasis.of(STACK, len(STACK) - 1)
    for texels in STACK:
        torch.testing.assert_close(basis.texels(basis.projected(texels)), texels, rtol=0, atol=1e-12)
    # Fewer leave what the variances beyond say, and the first are the first.
    variances = torch.linalg.svdvals((STACK - STACK.mean(0)).flatten(1)).square()
    for count in (1, 3):
        few = LogBasis.of(STACK, count)
        left = sum(float((few.texels(few.projected(each)) - each).square().sum()) for each in STACK)
        assert left == pytest.approx(float(variances[count:].sum()))
        assert torch.equal(few.directions, basis.first(count).directions)


def test_coefficients_of_samples_are_the_least_squares_ones() -> None:
    basis = LogBasis.of(STACK, 3)
    wi, wo = draw_uniform(300, torch.Generator().manual_seed(1))
    weights = torch.rand(300, dtype=torch.float64, generator=torch.Generator().manual_seed(3)) + 0.1

    def equations(logs: torch.Tensor):
        return inner_problem(LogSamples(wi, wo, logs, weights), PROJECTIONS, SHAPES, 0.0).data

    planted = drawn(3, seed=4)
    found = basis.solved(equations(values(basis.texels(planted))))
    torch.testing.assert_close(found, planted, rtol=0, atol=1e-7)
    # Of samples that no basis meets, against the dense solve.
    logs = drawn(300, 3, seed=5)
    columns = torch.stack([values(each).flatten() for each in basis.directions], 1)
    root = weights.sqrt().repeat_interleave(3)
    dense = torch.linalg.lstsq(
        columns * root[:, None], ((logs - values(basis.mean)).flatten() * root)[:, None]
    ).solution
    torch.testing.assert_close(basis.solved(equations(logs)), dense[:, 0], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("count", [0, 6])
def test_more_directions_than_materials_bear_are_refused(count: int) -> None:
    with pytest.raises(BadInput, match=f"basis: found {count} for 6 materials, expected 1 to 5"):
        LogBasis.of(STACK, count)
