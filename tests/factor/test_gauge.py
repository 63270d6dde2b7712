"""The gauge: the null space is what the closed form says, no more and no less, and a solve stays out of it."""

from dataclasses import replace

import pytest
import torch
from problems import dense
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.factor.factorization import Term, sum_of_terms
from homofact.factor.gauge import gauge_rows, null_space
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.factor.textures import LogSamples, centred, inner_problem, solve_terms, texture_shape
from homofact.geometry.coordinates import coordinate_system
from homofact.geometry.directions import draw_cosine_weighted
from homofact.geometry.rotation import Rotation
from homofact.linear.normal import stencil_rows

SIZE = 5


def searched(
    seed: int, coordinates: str = "half-diff", reciprocal: bool = True, warp: Warp | None = None
) -> Projection:
    generator = torch.Generator().manual_seed(seed)
    rotation = Rotation.random(generator, coordinate_system(coordinates).dimension)
    return Projection.from_rotation(coordinates, rotation, reciprocal, warp=warp)


def fixed(*names: str, reciprocal: bool = True) -> tuple[Projection, ...]:
    return tuple(fixed_projection(name, reciprocal) for name in names)


# The dimension by hand: J − 1 constants, 2J − k ramps where the textures' planes meet, products by quadratic forms.
SETS: dict[str, tuple[tuple[Projection, ...], int]] = {
    "one texture": (fixed("theta_h-theta_d"), 0),
    "mccool": (fixed("wi", "h"), 1),
    "the same twice": (fixed("h", "h"), 4),
    "one shared axis": (fixed("theta_h-theta_d", "theta_h-phi_d"), 1 + 1),
    "1D beside 2D": (fixed("theta_h", "theta_h-theta_d"), 1 + 1),
    "two searched in R4, not reciprocal": ((searched(0, reciprocal=False), searched(1, reciprocal=False)), 1),
    "three searched in R4, not reciprocal": (tuple(searched(s, reciprocal=False) for s in range(3)), 2 + 2),
    # The conjugate cancels the difference vector: two rows a texture live in the plane of h.
    "two searched in R4, reciprocal": ((searched(0), searched(1)), 1 + 2),
    "two searched in R3": ((searched(0, "isotropic-in-out", False), searched(1, "isotropic-in-out", False)), 1 + 1),
    "warps apart": ((searched(0, "half-diff", False), searched(1, "half-diff", False, Warp(0.1))), 1),
    "one warped, the other axis shared": (
        (fixed_projection("theta_h-theta_d", True, Warp(0.1)), fixed_projection("theta_d-phi_d", True)),
        1 + 1,
    ),
    "five searched in R4, reciprocal": (tuple(searched(s) for s in range(5)), 4 + 8),
    # A ramp does not close round a circle: of θh-φh only the one in θh is left, which θh-θd shares.
    "round": (fixed("theta_h-phi_h"), 0),
    "round, a shared axis": (fixed("theta_h-phi_h", "theta_h-theta_d"), 1 + 1),
    "round twice": (fixed("theta_h-phi_h", "theta_h-phi_h"), 1 + 1),
    "round, warped apart": (
        (fixed_projection("theta_h-phi_h", True, Warp(0.1)), fixed_projection("theta_h-theta_d", True)),
        1,
    ),
    "round and in the disc": (fixed("theta_h-phi_h", "h"), 1),
    # u v and v u are one function: what adds up is the symmetric part of the outer product.
    "axes exchanged": (
        (
            fixed_projection("h", False),
            Projection("half-diff", fixed_projection("h", False).matrix[::-1].copy(), False, "exchanged"),
        ),
        1 + 2 + 1,
    ),
    "axes exchanged, searched": (
        (
            searched(0, reciprocal=False),
            Projection("half-diff", searched(0, reciprocal=False).matrix[::-1].copy(), False, "exchanged"),
        ),
        1 + 2 + 1,
    ),
    "different coordinates": ((searched(0, "in-out", False), searched(1, "half-diff", False)), 1),
}


def problem_of(projections: tuple[Projection, ...], count: int = 8000):
    wi, wo = draw_cosine_weighted(count, torch.Generator().manual_seed(3))
    logs = torch.zeros(count, 1, dtype=torch.float64)
    samples = LogSamples(wi, wo, logs, torch.ones(count, dtype=torch.float64))
    shapes = tuple(texture_shape(p, SIZE) for p in projections)
    return inner_problem(samples, projections, shapes, 1.0), tuple(torch.ones(s, dtype=torch.bool) for s in shapes)


def null_of(rows: Tensor) -> Tensor:
    # R has the rows' null space, and is square.
    _, values, right = torch.linalg.svd(torch.linalg.qr(rows).R)
    rank = int((values > 1e-9 * values[0]).sum())
    return right[rank:].T


@pytest.mark.parametrize("name", SETS)
def test_the_basis_is_the_null_space_of_samples_and_smoothing(name: str) -> None:
    projections, dimension = SETS[name]
    problem, masks = problem_of(projections)
    basis = null_space(projections, masks)
    numbers, values = stencil_rows(problem.coordinates, problem.lookups)
    design = torch.zeros(len(numbers), problem.unknowns, dtype=torch.float64).scatter_add_(1, numbers, values)
    null = null_of(torch.cat((design, dense(problem.roughness.rows) * 10)))
    assert basis.shape[1] == null.shape[1]
    assert torch.allclose(basis.T @ basis, torch.eye(basis.shape[1], dtype=torch.float64), atol=1e-10)
    # The same space, not only the same dimension.
    assert torch.allclose(basis @ (basis.T @ null), null, atol=1e-7)
    # As many rows hold it, and none of its directions escapes them.
    rows = gauge_rows(projections, masks)
    assert rows.shape[1] == basis.shape[1]
    assert basis.shape[1] == 0 or float(torch.linalg.svdvals(rows.T @ basis).min()) > 1e-3
    assert basis.shape[1] >= dimension
    if "reciprocal" not in name.replace("not reciprocal", ""):
        assert basis.shape[1] == dimension


def test_a_solve_stays_out_of_the_null_space_and_keeps_the_sum() -> None:
    projections, _ = SETS["three searched in R4, not reciprocal"]
    problem, masks = problem_of(projections)
    basis = gauge_rows(projections, masks)
    generator = torch.Generator().manual_seed(0)
    targets = torch.randn(problem.targets.shape, dtype=torch.float64, generator=generator)
    free = replace(problem, targets=targets)
    held = replace(free, gauge=basis)
    answers = [torch.linalg.solve(matrix, rhs) for matrix, rhs in (each.normal() for each in (free, held))]
    # What is left is the ridge's pull.
    assert float((basis.T @ answers[1]).abs().max()) < 1e-8
    assert torch.allclose(free.residuals(answers[0]), held.residuals(answers[1]), atol=1e-6)
    assert torch.linalg.cond(held.normal()[0]) < 1e-2 * torch.linalg.cond(free.normal()[0])


def test_constants_do_not_depend_on_the_order_of_magnitude_of_the_data() -> None:
    """A factor on the data moves the first texture by its logarithm, and no other."""
    wi, wo = draw_cosine_weighted(4000, torch.Generator().manual_seed(1))
    values = (0.1 + (wi[:, 2:] * wo[:, 2:]) ** 3).double()
    transform = LogTransform(1e-5, torch.ones(1, dtype=torch.float64))
    projections = (searched(0), searched(1))
    fits = []
    for factor in (1.0, 100.0):
        logs = transform.forward(values * factor)
        samples = LogSamples(wi, wo, logs, torch.ones(len(wi), dtype=torch.float64))
        fits.append(solve_terms(samples, projections, ((8, 8), (8, 8)), 1e-3, "cholesky").terms)
    for j, (one, two) in enumerate(zip(*fits, strict=True)):
        moved = (two.texture - one.texture)[one.mask]
        expected = torch.log(torch.tensor(100.0)).item() / one.projection.lookups if j == 0 else 0.0
        assert torch.allclose(moved, torch.full_like(moved, expected), atol=1e-3)


def test_the_first_texture_is_the_one_that_keeps_its_mean() -> None:
    projections, _ = SETS["three searched in R4, not reciprocal"]
    _, masks = problem_of(projections)
    rows = gauge_rows(projections, masks)
    count = SIZE * SIZE
    for j in range(3):
        constant = torch.zeros(3 * count, dtype=torch.float64)
        constant[j * count : (j + 1) * count] = 1 / SIZE
        assert float((rows.T @ constant).norm()) == pytest.approx(0 if j == 0 else 1, abs=1e-9)


def test_gathering_the_constants_leaves_the_sum_alone() -> None:
    """A texture that is looked up twice brings its mean twice, and the first one takes it in halves."""
    generator = torch.Generator().manual_seed(0)
    whole = torch.ones(SIZE, SIZE, dtype=torch.bool)
    projections = (searched(0), *fixed("theta_i-theta_o", "h"), searched(1))
    assert len({projection.lookups for projection in projections}) == 2
    terms = tuple(
        Term(p, 1 + k + torch.rand(SIZE, SIZE, 2, dtype=torch.float64, generator=generator), whole)
        for k, p in enumerate(projections)
    )
    moved = centred(terms)
    wi, wo = draw_cosine_weighted(200, generator)
    assert torch.allclose(sum_of_terms(moved, wi, wo), sum_of_terms(terms, wi, wo), atol=1e-12)
    for term in moved[1:]:
        assert float(term.texture.mean((0, 1)).abs().max()) < 1e-12
