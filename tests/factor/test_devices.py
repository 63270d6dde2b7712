"""A fit of tensors on another device stays there, and gives what the CPU gives."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import torch
from elsewhere import DEVICE, back, elsewhere, moved

from homofact.brdf.analytic import Ward
from homofact.brdf.log_transform import LogTransform
from homofact.brdf.samples import Samples
from homofact.factor.confidence import with_deviations
from homofact.factor.energy import Flux, keep_light
from homofact.factor.factorization import Factorization
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.factor.quantize import quantized_terms
from homofact.factor.textures import LogSamples, inner_problem, solve_terms
from homofact.geometry.directions import draw_in_discs
from homofact.geometry.rotation import Rotation
from homofact.linear.laplacian import laplacian
from homofact.linear.normal import accumulate, accumulate_torch
from homofact.linear.solvers import SOLVERS, solve
from homofact.methods.folded import Folded
from homofact.methods.validation import Partition, random_folds

GENERATOR = torch.Generator().manual_seed(0)
PROJECTIONS = (
    fixed_projection("theta_h-phi_h", True, Warp(0.1)),
    fixed_projection("theta_h-theta_d", True, Warp(0.1)),
    Projection.from_rotation("half-diff", Rotation.random(GENERATOR), True),
    Projection.from_rotation("isotropic-in-out", Rotation.random(GENERATOR, 3), True),
)
SHAPES = ((8, 6), (5, 5), (6, 6), (4, 4))
SMOOTHING = (1e-3, 2e-3, 1e-3, 1e-2)


def _samples() -> Samples:
    wi, wo = draw_in_discs(900, torch.Generator().manual_seed(1), 0.98)
    values = Ward((0.15, 0.1), (0.2, 0.2), alpha_x=0.2, alpha_y=0.5, channels=("R", "G")).evaluate(wi, wo)
    return Samples(wi, wo, values, channels=("R", "G"), isotropic=False)


HERE = _samples()


@pytest.fixture
def there() -> Iterator[Samples]:
    with elsewhere():
        yield replace(
            HERE, wi=moved(HERE.wi), wo=moved(HERE.wo), values=moved(HERE.values), weights=moved(HERE.weights)
        )


def logs_of(samples: Samples) -> LogSamples:
    return LogSamples.of(samples, LogTransform.of(samples, 1e-3))


def test_the_device_refuses_a_stray_tensor() -> None:
    with elsewhere():
        made = torch.zeros(3, device=DEVICE)
        assert torch.equal(back(made + 1), torch.ones(3))
        with pytest.raises(RuntimeError, match=r"add.Tensor: a CPU tensor of shape \(3,\)"):
            _ = made + torch.zeros(3)
        with pytest.raises(RuntimeError, match="a CPU tensor"):
            torch.cat((made, torch.zeros(1)))
        with pytest.raises((RuntimeError, TypeError)):
            made.numpy()
        assert torch.equal(made.cpu(), torch.zeros(3))
        assert float(made.sum()) == 0


def test_accumulation_and_laplacian(there: Samples) -> None:
    problem = inner_problem(logs_of(there), PROJECTIONS, SHAPES, SMOOTHING)
    arguments = (problem.lookups, problem.targets, problem.weights, problem.unknowns)
    found = accumulate(problem.coordinates, *arguments)
    same = inner_problem(logs_of(HERE), PROJECTIONS, SHAPES, SMOOTHING)
    expected = accumulate_torch(same.coordinates, same.lookups, same.targets, same.weights, same.unknowns)
    assert torch.allclose(back(found.matrix), expected.matrix)
    assert torch.allclose(back(found.rhs), expected.rhs)
    mask = torch.rand(7, 6, generator=torch.Generator().manual_seed(0)) > 0.3
    axes = PROJECTIONS[0].axes
    assert np.array_equal(laplacian(moved(mask), axes).toarray(), laplacian(mask, axes).toarray())


def test_the_objective_and_its_gradient(there: Samples) -> None:
    here, other = (Objective(logs_of(each), PROJECTIONS, SHAPES, SMOOTHING) for each in (HERE, there))
    start = here.start()
    one, two = here.evaluate(start), other.evaluate(start)
    assert two.value == pytest.approx(one.value, rel=1e-9)
    assert torch.allclose(two.gradient, one.gradient, atol=1e-9)
    assert torch.allclose(back(two.texels), one.texels, atol=1e-7)
    assert other.error(start) == pytest.approx(one.value, rel=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver(solver: str, there: Samples) -> None:
    found, expected = (
        solve(inner_problem(logs_of(each), PROJECTIONS[:2], SHAPES[:2], 1e-2), solver) for each in (there, HERE)
    )
    assert torch.allclose(back(found.texels), expected.texels, atol=1e-5)


def test_the_masked_solve_and_what_comes_of_it(there: Samples) -> None:
    fits = []
    for samples in (HERE, there):
        logs = logs_of(samples)
        solved = solve_terms(logs, PROJECTIONS, SHAPES, SMOOTHING, "cholesky")
        terms = with_deviations(logs, solved.terms, SMOOTHING)
        fits.append(Factorization(terms, LogTransform.of(samples, 1e-3), samples.channels))
    for one, two in zip(fits[0].terms, fits[1].terms, strict=True):
        assert np.array_equal(two.mask, one.mask)
        assert np.allclose(two.texture, one.texture, atol=1e-6)
        assert one.deviation is not None
        assert two.deviation is not None
        assert np.allclose(two.deviation, one.deviation, rtol=1e-3, atol=1e-6)
    assert torch.allclose(
        back(fits[1].evaluate(there.wi, there.wo)), fits[0].evaluate(HERE.wi, HERE.wo), rtol=1e-5, atol=1e-9
    )


def test_keeping_the_light_and_quantizing(there: Samples) -> None:
    found = []
    for samples in (HERE, there):
        logs, transform = logs_of(samples), LogTransform.of(samples, 1e-3)
        solved = solve_terms(logs, PROJECTIONS[:2], SHAPES[:2], 1e-2, "cholesky")
        terms, account = keep_light(logs, solved.terms, 1e-2, Flux.of(samples, transform, "both"))
        rounded = quantized_terms(logs, terms, 1e-2, 255)
        found.append((account["after"], rounded))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-5)
    for one, two in zip(found[0][1], found[1][1], strict=True):
        # Rounding may tip at a half.
        assert float((back(two.texture) - one.texture).abs().median()) < 1e-6


def test_cross_validation(there: Samples) -> None:
    partition = Partition(random_folds(len(HERE), 3, 0), 1.0)
    errors = [
        Folded.of(logs_of(samples), (partition,), PROJECTIONS[:3], SHAPES[:3]).error(SMOOTHING[:3])
        for samples in (HERE, there)
    ]
    assert errors[1] == pytest.approx(errors[0], rel=1e-7)
