"""Inner problems with known answers: the table that solvers are held to."""

from dataclasses import dataclass, replace

import scipy.sparse
import torch
from torch import Tensor

from homofact.linear.laplacian import laplacian
from homofact.linear.least_squares import LeastSquares, Roughness
from homofact.linear.normal import Lookup


@dataclass(frozen=True)
class Problem:
    """An inner problem and the fitted values (N, C) at its own samples.

    `singular` ones hold directions of the texels that no sample sees: only the ridge does.
    """

    name: str
    problem: LeastSquares
    values: Tensor
    singular: bool = False


def planted(
    name: str,
    *,
    samples: int = 600,
    shapes: tuple[tuple[int, int], ...] = ((5, 5),),
    shared: bool = False,
    smoothing: float = 0.0,
    channels: int = 2,
    seed: int = 0,
) -> Problem:
    """Texels drawn at random, looked up through random projections: the fit must give the values back."""
    generator = torch.Generator().manual_seed(seed)
    coordinates = torch.rand(samples, 4, dtype=torch.float64, generator=generator) * 2 - 1
    lookups, offset = [], 0
    for shape in shapes:
        for _ in range(2 if shared else 1):
            matrix = torch.randn(2, 4, dtype=torch.float64, generator=generator)
            lookups.append(Lookup(0, matrix / matrix.abs().sum(1, keepdim=True), shape, offset))
        offset += shape[0] * shape[1]
    texels = torch.randn(offset, channels, dtype=torch.float64, generator=generator)
    rough = Roughness(blocks(*(laplacian(torch.ones(shape, dtype=torch.bool)) for shape in shapes)))
    weights = torch.rand(samples, dtype=torch.float64, generator=generator) + 0.5
    empty = LeastSquares(
        coordinates,
        tuple(lookups),
        torch.zeros(samples, channels, dtype=torch.float64),
        weights,
        torch.ones(offset, dtype=torch.bool),
        rough,
        smoothing,
    )
    targets = dense_rows(empty) @ texels
    problem = LeastSquares(coordinates, tuple(lookups), targets, weights, empty.kept, empty.roughness, smoothing)
    return Problem(name, problem, targets)


def blocks(*matrices: scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
    """Sparse matrices along the diagonal of one."""
    return scipy.sparse.csr_matrix(scipy.sparse.block_diag(matrices))


def dense(matrix: scipy.sparse.csr_matrix) -> Tensor:
    """A sparse matrix written out."""
    return torch.from_numpy(matrix.toarray())


def dense_rows(problem: LeastSquares) -> Tensor:
    """B (N, T) written out by hand: a tent function of each texel's distance, texel by texel."""
    result = torch.zeros(problem.coordinates.shape[0], problem.unknowns, dtype=torch.float64)
    for lookup in problem.lookups:
        k = lookup.matrix.shape[1]
        uv = problem.coordinates[:, lookup.start : lookup.start + k] @ lookup.matrix.T
        rows, columns = lookup.shape
        for row in range(rows):
            for column in range(columns):
                across = (uv[:, 0].clamp(-1, 1) + 1) * (columns - 1) / 2 - column
                up = (uv[:, 1].clamp(-1, 1) + 1) * (rows - 1) / 2 - row
                tent = (1 - across.abs()).clamp_min(0) * (1 - up.abs()).clamp_min(0)
                result[:, lookup.offset + row * columns + column] += tent
    return result


CATALOGUE = (
    planted("one texture"),
    planted("one texture looked up twice", shared=True),
    planted("two textures", shapes=((5, 5), (4, 4))),
    planted("two textures looked up twice, three channels", shapes=((4, 4), (4, 4)), shared=True, channels=3),
    planted("a one-dimensional texture beside a square one", shapes=((4, 4), (1, 6))),
    planted("three textures", samples=2000, shapes=((4, 4), (4, 4), (5, 5))),
)


def twice(case: Problem) -> Problem:
    """Its first texture a second time under the same projection: the two can trade anything."""
    problem = case.problem
    rows, columns = problem.lookups[0].shape
    count = rows * columns
    doubled = replace(
        problem,
        lookups=(*problem.lookups, replace(problem.lookups[0], offset=problem.unknowns)),
        kept=torch.cat((problem.kept, torch.ones(count, dtype=torch.bool))),
        roughness=Roughness(blocks(problem.roughness.rows, laplacian(torch.ones(rows, columns, dtype=torch.bool)))),
    )
    return Problem("the same texture twice", doubled, case.values, singular=True)


def unweighted(case: Problem) -> Problem:
    """All samples but a few without weight: many texels are read by none that counts."""
    weights = case.problem.weights.clone()
    weights[10:] = 0
    return Problem("ten samples that count", replace(case.problem, weights=weights), case.values, singular=True)


SINGULAR = (
    twice(planted("one texture", shapes=((4, 4),))),
    replace(planted("fewer samples than texels", samples=12, shapes=((5, 5), (4, 4))), singular=True),
    unweighted(planted("one texture")),
    replace(planted("one sample", samples=1), singular=True),
)
