"""Test the linear solvers on difficult systems, and compare each with the minimum-norm solution.

"The system" is what `LeastSquares.rows` stacks: samples, smoothing, ridge and gauge. Its condition number is that of
the normal matrix: the square of the condition number of the rows, which follows from their singular values. The
minimum-norm solution is also computed from the singular values, and refined with residuals in extended precision. Its
relative error is about 1e-19 times the condition number.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.linalg
import torch

from homofact.brdf.analytic import BlinnPhong
from homofact.brdf.log_transform import LogTransform
from homofact.errors import SolverFailure, Status
from homofact.factor.gauge import gauge_rows
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, domain_masks, inner_problem
from homofact.geometry.directions import draw_in_discs, to_spherical
from homofact.linear.least_squares import LeastSquares
from homofact.linear.solvers import SOLVERS, solve
from homofact.stability.problem import RADIUS_SQUARED, samples_at

# Condition numbers of normal matrices: up to the first every solver is to agree, beyond the second none can.
WELL_POSED = 1e8
AGREES = 1e-8
# On ill-posed systems: share of the texels' size within which an answer is the minimum-norm one.
AGREES_ILL = 1e-4
_SIZE = 8
_MODEL = BlinnPhong((0.35, 0.15), (0.4, 0.4), exponent=50, channels=("R", "G"))


class SolverOutcome(Enum):
    """The possible outcomes of a solver."""

    AGREES = "agrees"
    SAYS_SO = "differs and warns"
    SILENT = "silently differs"
    CRASHED = "crashed"


@dataclass(frozen=True)
class SolverCell:
    """A solver on a system: `difference` is the largest |y − y*|/|y*| of a channel, None without an answer."""

    system: str
    solver: str
    condition: float
    rank: int
    unknowns: int
    difference: float | None
    status: str
    answer: SolverOutcome
    message: str = ""

    @property
    def well_posed(self) -> bool:
        """Whether the system is well posed."""
        return self.condition <= WELL_POSED


@dataclass(frozen=True)
class System:
    """A named inner problem; `description` says what is wrong with it."""

    name: str
    description: str
    make: Callable[[int], LeastSquares]


def _system(
    names: tuple[str, ...] = ("wi", "h"),
    *,
    count: int = 3000,
    smoothing: float = 1e-3,
    gauged: bool = True,
    hole: float = 0.0,
    weights: float = 0.0,
    channels: float = 0.0,
    exponent: float = 50,
    epsilon: float = 1e-2,
) -> Callable[[int], LeastSquares]:
    """How to make the masked problem of a final solve; `weights` and `channels` are spreads in decades."""

    def make(seed: int) -> LeastSquares:
        generator = torch.Generator().manual_seed(seed)
        wi, wo = draw_in_discs(count, generator, RADIUS_SQUARED)
        keep = torch.rad2deg(to_spherical(wi)[0]) >= hole
        samples = samples_at(replace(_MODEL, exponent=exponent), wi[keep], wo[keep])
        spread = 10 ** (weights * (torch.rand(len(samples), dtype=torch.float64, generator=generator) - 0.5))
        factor = torch.tensor([10**channels, 10**-channels], dtype=torch.float64)
        samples = replace(samples, weights=spread)
        logs = LogSamples.of(samples, LogTransform.of(samples, epsilon))
        projections = tuple(fixed_projection(name, True) for name in names)
        shapes = ((_SIZE, _SIZE),) * len(names)
        masks = domain_masks(projections, shapes)
        problem = inner_problem(replace(logs, logs=logs.logs * factor), projections, shapes, smoothing, masks)
        return replace(problem, gauge=gauge_rows(projections, masks)) if gauged else problem

    return make


_FOUR = ("wi", "h", "d", "wo")
SYSTEMS = (
    System("plain", "two textures, 3000 samples, λ = 1e-3, gauge held", _system()),
    System("one texture", "no gauge to hold", _system(("h",))),
    System("heavy smoothing", "λ = 1e3", _system(smoothing=1e3)),
    System("far too much smoothing", "λ = 1e8", _system(smoothing=1e8)),
    System("four textures", "four projections, gauge held", _system(_FOUR)),
    System("scaled channels", "log values of one channel 1e8 times the other's", _system(channels=4.0)),
    System("near mirror", "exponent 1e6, ε = 1e-8", _system(exponent=1e6, epsilon=1e-8)),
    System("205 samples", "fewer samples than texels", _system(count=205)),
    System("gauge free", "the same with nothing to hold the gauge", _system(gauged=False)),
    System("four, gauge free", "four projections, constants and ramps free", _system(_FOUR, gauged=False)),
    System("no smoothing", "3000 samples, λ = 0", _system(smoothing=0.0)),
    System("205 samples, λ = 0", "fewer samples than texels, nothing between them", _system(count=205, smoothing=0.0)),
    System("hole, λ = 0", "no light within 50° of the normal, λ = 0", _system(smoothing=0.0, hole=50.0)),
    System("hole", "no light within 50° of the normal", _system(hole=50.0)),
    System("coincident", "three textures over h", _system(("h", "h", "h"))),
    System("coincident, λ = 0", "three textures over h, λ = 0, gauge free",
           _system(("h", "h", "h"), smoothing=0.0, gauged=False)),
    System("weights 1e±4", "sample weights over eight decades", _system(weights=8.0)),
    System("weights 1e±8, λ = 0", "sample weights over sixteen decades, λ = 0", _system(weights=16.0, smoothing=0.0)),
    System("weights 1e±12, λ = 0", "over twenty-four decades, fewer samples than texels, λ = 0",
           _system(weights=24.0, smoothing=0.0, count=205)),
)  # fmt: skip


def minimum_norm(problem: LeastSquares) -> tuple[torch.Tensor, float, int]:
    """Return (texels (T, C), condition number of the normal matrix, rank) of the system of `LeastSquares.rows`."""
    rows, targets = problem.rows()
    dense = np.asarray(rows.todense())
    left, sizes, right = scipy.linalg.svd(dense, full_matrices=False)
    sound = sizes > sizes[0] * max(dense.shape) * np.finfo(float).eps
    inverse = np.where(sound, 1 / np.where(sound, sizes, 1), 0)
    answer = right.T @ (inverse[:, None] * (left.T @ targets))
    exact, wanted = dense.astype(np.longdouble), targets.astype(np.longdouble)
    for _ in range(4):
        gradient = (exact.T @ (wanted - exact @ answer.astype(np.longdouble))).astype(float)
        answer = answer + right.T @ (inverse[:, None] ** 2 * (right @ gradient))
    condition = float((sizes[0] / sizes[-1]) ** 2) if sizes[-1] > 0 else float("inf")
    return problem.expand(torch.from_numpy(answer)), condition, int(sound.sum())


def classify_answer(difference: float, well_posed: bool, status: Status) -> SolverOutcome:
    """Classify an answer by its difference to the minimum-norm solution and by its status."""
    if difference <= (AGREES if well_posed else AGREES_ILL):
        return SolverOutcome.AGREES
    return SolverOutcome.SAYS_SO if status in (Status.FALLBACK, Status.BUDGET) else SolverOutcome.SILENT


def run_solvers(
    seed: int = 0, short: bool = False, started: Callable[[int, int, str], None] | None = None
) -> list[SolverCell]:
    """Run every solver on every system (`short`: on every third one)."""
    systems = SYSTEMS[::3] if short else SYSTEMS
    cells = []
    for done, system in enumerate(systems):
        if started is not None:
            started(done, len(systems), f"linear systems: {system.name}")
        problem = system.make(seed)
        expected, condition, rank = minimum_norm(problem)
        unknowns = int(problem.kept.sum())
        for name in SOLVERS:
            empty = SolverCell(system.name, name, condition, rank, unknowns, None, "", SolverOutcome.CRASHED)
            cells.append(_solve(empty, problem, expected))
    return cells


def _solve(empty: SolverCell, problem: LeastSquares, expected: torch.Tensor) -> SolverCell:
    try:
        solution = solve(problem, empty.solver)
    except SolverFailure as error:
        return replace(empty, answer=SolverOutcome.SAYS_SO, status="refused", message=str(error))
    except Exception as error:
        return replace(empty, message=f"{type(error).__name__}: {error}")
    # Each channel by itself, so that a small one counts as a large one does.
    difference = float(((solution.texels - expected).norm(dim=0) / expected.norm(dim=0)).max())
    answer = classify_answer(difference, empty.well_posed, solution.status)
    return replace(empty, difference=difference, status=solution.status.value, answer=answer)
