"""The reduced objective and its variable-projection gradient."""

import pytest
import torch
from problems import CATALOGUE, Problem

from homofact.brdf.log_transform import LogTransform
from homofact.factor import textures
from homofact.factor.objective import Objective
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.factor.textures import LogSamples
from homofact.geometry.directions import draw_in_discs, half_difference
from homofact.linear.normal import gradient, gradient_torch
from homofact.methods.kinds import make


def _log_samples(count: int, seed: int = 0) -> LogSamples:
    wi, wo = draw_in_discs(count, torch.Generator().manual_seed(seed), 0.98)
    h, d = half_difference(wi, wo)
    logs = torch.stack((torch.sin(3 * h[:, 0]) + d[:, 2] ** 2, -4 * (1 - h[:, 2]) + 0.3 * d[:, 0] ** 2), 1)
    return LogSamples(wi, wo, logs, torch.rand(count, dtype=torch.float64, generator=torch.Generator().manual_seed(1)))


MIXES = {
    "in-out": ("in-out",),
    "half-diff beside a fixed h": ("h", "half-diff"),
    "both isotropic": ("isotropic-half-diff", "isotropic-in-out"),
    "two half-diff and a line": ("half-diff", "theta_i", "half-diff"),
}


def _objective(mix: tuple[str, ...], samples: LogSamples, reciprocal: bool = True) -> Objective:
    generator = torch.Generator().manual_seed(4)
    projections = tuple(make(kind, reciprocal, Warp(0.3), generator, "disc") for kind in mix)
    shapes = tuple((1 if kind == "theta_i" else 6, 6) for kind in mix)
    return Objective(samples, projections, shapes, 1e-2)


@pytest.mark.parametrize("reciprocal", [True, False])
@pytest.mark.parametrize("mix", MIXES.values(), ids=MIXES)
def test_the_gradient_is_the_slope_away_from_the_kinks(mix: tuple[str, ...], reciprocal: bool) -> None:
    """Central differences with a step so small that hardly a sample changes its cell."""
    objective = _objective(mix, _log_samples(400), reciprocal)
    vector = objective.start()
    slope = objective.evaluate(vector).gradient
    generator = torch.Generator().manual_seed(9)
    for _ in range(3):
        direction = torch.randn(len(vector), dtype=torch.float64, generator=generator)
        step = 1e-7
        ahead, behind = (objective.error(vector + sign * step * direction) for sign in (1, -1))
        assert float(slope @ direction) == pytest.approx((ahead - behind) / (2 * step), rel=2e-4, abs=2e-7)


@pytest.mark.parametrize("reciprocal", [True, False])
@pytest.mark.parametrize("mix", MIXES.values(), ids=MIXES)
def test_the_problem_at_a_vector_is_that_of_the_projections_there(mix: tuple[str, ...], reciprocal: bool) -> None:
    samples = _log_samples(60)
    objective = _objective(mix, samples, reciprocal)
    generator = torch.Generator().manual_seed(3)
    vector = objective.start() + 0.3 * torch.randn(len(objective.start()), dtype=torch.float64, generator=generator)
    shapes = tuple((1 if kind == "theta_i" else 6, 6) for kind in mix)
    expected = textures.inner_problem(samples, objective.projections(vector), shapes, 1e-2)
    for found in (objective.problem(vector), objective.problem(vector)):
        assert torch.equal(found.coordinates, expected.coordinates)
        for one, other in zip(found.lookups, expected.lookups, strict=True):
            assert (one.start, one.shape, one.offset) == (other.start, other.shape, other.offset)
            assert torch.equal(one.matrix, other.matrix)


def test_values_of_both_paths_agree_and_the_length_of_a_quaternion_does_not_matter() -> None:
    objective = _objective(("half-diff", "in-out"), _log_samples(500))
    vector = objective.start()
    evaluation = objective.evaluate(vector)
    assert evaluation.value == pytest.approx(objective.error(vector), rel=1e-9)
    assert evaluation.error < evaluation.value
    assert objective.error(1.7 * vector) == pytest.approx(evaluation.value, rel=1e-9)
    assert float(evaluation.gradient[:4] @ vector[:4]) == pytest.approx(0, abs=1e-10)
    assert objective.evaluations == 3


def test_q_and_minus_q_are_one_projection() -> None:
    objective = _objective(("half-diff",), _log_samples(300))
    vector = objective.start()
    flipped = torch.cat((-vector[:4], -vector[4:]))
    assert objective.error(flipped) == pytest.approx(objective.error(vector), rel=1e-12)
    turned = torch.cat((-vector[:4], vector[4:]))  # −P: the texture turned by half a circle
    assert objective.error(turned) == pytest.approx(objective.error(vector), rel=1e-9)


def test_fixed_projections_alone_have_an_empty_gradient() -> None:
    objective = Objective(_log_samples(300), (fixed_projection("h", True),), ((6, 6),), 1e-2)
    assert objective.start().shape == (0,)
    assert objective.evaluate(objective.start()).gradient.shape == (0,)


def test_projections_come_back_from_their_vector() -> None:
    objective = _objective(("half-diff", "theta_i", "isotropic-in-out"), _log_samples(50))
    again = objective.projections(objective.start())
    wi, wo = draw_in_discs(20, torch.Generator().manual_seed(0))
    generator = torch.Generator().manual_seed(4)
    for projection, kind in zip(again, ("half-diff", "theta_i", "isotropic-in-out"), strict=True):
        expected = make(kind, True, Warp(0.3), generator, "disc")
        assert isinstance(projection, Projection)
        for found, wanted in zip(projection.place(wi, wo), expected.place(wi, wo), strict=True):
            assert torch.allclose(found, wanted)


@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.name)
def test_compiled_and_automatic_derivatives_agree(case: Problem) -> None:
    problem = case.problem
    generator = torch.Generator().manual_seed(3)
    texels = torch.randn(problem.unknowns, problem.targets.shape[1], dtype=torch.float64, generator=generator)
    arguments = (problem.coordinates, problem.lookups, problem.targets, problem.weights, texels)
    found, value = gradient(*arguments)
    expected, expected_value = gradient_torch(*arguments)
    assert value == pytest.approx(expected_value, rel=1e-11)
    assert torch.allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_chunks_give_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    wi, wo = draw_in_discs(1000, torch.Generator().manual_seed(0))
    projection = make("half-diff", True, Warp(0.1), torch.Generator().manual_seed(1), "disc")
    whole = projection.prepare(wi, wo)
    monkeypatch.setattr(textures, "CHUNK", 300)
    sizes: list[int] = []

    def counted(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        sizes.append(len(a))
        return projection.prepare(a, b)

    found = torch.full_like(whole, torch.nan)
    textures.in_chunks(counted, wi, wo, found)
    assert torch.equal(found, whole)
    assert sizes == [300, 300, 300, 100]


def test_log_samples_follow_the_transform() -> None:
    samples = _log_samples(10)
    transform = LogTransform(0.1, torch.tensor([1.0, 2.0], dtype=torch.float64))
    assert torch.allclose(transform.forward(transform.inverse(samples.logs.clamp_min(-2))), samples.logs.clamp_min(-2))
    picked = samples.select(torch.tensor([3, 1]))
    assert torch.equal(picked.logs, samples.logs[[3, 1]])
    assert torch.equal(picked.weights, samples.weights[[3, 1]])
