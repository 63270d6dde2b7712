"""Cross-validation by subtraction against cross-validation by hand."""

import math

import pytest
import torch
from problems import dense

from homofact.brdf.samples import Samples
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, inner_problem
from homofact.geometry.directions import draw_in_discs, from_spherical
from homofact.linear.solvers import solve
from homofact.methods.effort import FitBudget
from homofact.methods.folded import Folded
from homofact.methods.validation import Partition, partitions_of, random_folds

PROJECTIONS = (fixed_projection("h", True), fixed_projection("wi", True))
SHAPES = ((6, 6), (5, 5))


def _noisy(noise: float, count: int = 900) -> LogSamples:
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_in_discs(count, generator, 0.98)
    smooth = torch.stack((3 * wi[:, 2] * wo[:, 2], wi[:, 0] + wo[:, 0]), 1)
    logs = smooth + noise * torch.randn(count, 2, dtype=torch.float64, generator=generator)
    return LogSamples(wi, wo, logs, torch.rand(count, dtype=torch.float64, generator=generator) + 0.5)


def test_folds_are_equal_sized_and_drawn_by_the_seed() -> None:
    folds = random_folds(103, 4, 1)
    assert sorted(torch.bincount(folds).tolist()) == [25, 26, 26, 26]
    assert torch.equal(folds, random_folds(103, 4, 1))
    assert not torch.equal(folds, random_folds(103, 4, 2))


def test_leaving_out_by_subtraction_is_leaving_out() -> None:
    samples = _noisy(0.3)
    folds = random_folds(900, 3, 0)
    found = Folded.of(samples, (Partition(folds, 1.0),), PROJECTIONS, SHAPES).error(0.05)
    total = 0.0
    for fold in range(3):
        rest, left = samples.select(folds != fold), samples.select(folds == fold)
        texels = solve(inner_problem(rest, PROJECTIONS, SHAPES, 0.05)).texels
        total += inner_problem(left, PROJECTIONS, SHAPES, 0.05).mean_error(texels) * float(left.weights.sum())
    assert found == pytest.approx(total / float(samples.weights.sum()), rel=1e-6)


def test_the_chosen_smoothing_is_the_best_nearby_and_grows_with_the_noise() -> None:
    chosen = []
    for noise in (0.01, 1.0):
        folded = Folded.of(_noisy(noise), (Partition(random_folds(900, 4, 0), 1.0),), PROJECTIONS, SHAPES)
        smoothing, error = folded.best_smoothing((1e-3, 1e-3), FitBudget())
        assert error == pytest.approx(folded.error(smoothing))
        assert smoothing[0] == smoothing[1]
        for factor in (10, 0.1):
            assert folded.error(tuple(value * factor for value in smoothing)) >= error
        each, lower = folded.best_each(smoothing, FitBudget())
        assert lower == pytest.approx(folded.error(each))
        assert lower <= error
        chosen.append(smoothing[0])
    assert chosen[0] < chosen[1]


def test_each_texture_may_have_its_own_smoothing() -> None:
    """One λ for all is the same as that λ for each; more on one texture only flattens that one."""
    samples = _noisy(0.5)
    one = solve(inner_problem(samples, PROJECTIONS, SHAPES, 0.1)).texels
    each = solve(inner_problem(samples, PROJECTIONS, SHAPES, (0.1, 0.1))).texels
    assert torch.allclose(one, each, atol=1e-12)
    first_flat = solve(inner_problem(samples, PROJECTIONS, SHAPES, (1e6, 0.1))).texels
    rough = dense(inner_problem(samples, PROJECTIONS, SHAPES, 1.0).roughness.rows)
    assert float((rough @ first_flat)[:36].abs().max()) < 1e-3 * float((rough @ one)[:36].abs().max())
    assert float((rough @ first_flat)[36:].abs().max()) > 0.1 * float((rough @ one)[36:].abs().max())


def _goniometer() -> Samples:
    theta_i = torch.arange(1, 8).double() * 0.17
    theta_o = torch.arange(0, 9).double() * 0.16
    phi = torch.linspace(0, 3, 11).double()
    a, b, c = torch.meshgrid(theta_i, theta_o, phi, indexing="ij")
    wi = from_spherical(a.reshape(-1), torch.zeros(a.numel()).double())
    wo = from_spherical(b.reshape(-1), c.reshape(-1))
    return Samples(wi, wo, torch.ones(a.numel(), 1), channels=("Y",), isotropic=True)


def test_a_gridded_set_is_judged_by_whole_inner_rings() -> None:
    samples = _goniometer()
    partitions = partitions_of(samples, 4, 0, rings=True)
    assert [partition.share for partition in partitions] == [0.5, 0.5]
    for partition, direction in zip(partitions, (samples.wi, samples.wo), strict=True):
        theta = torch.acos(direction[:, 2].clamp(-1, 1))
        ranks = torch.unique((theta * 1000).round(), return_inverse=True)[1]
        outer = (ranks == 0) | (ranks == ranks.max())
        assert bool((partition.folds[outer] == -1).all())
        for rank in range(1, int(ranks.max())):
            assert len(set(partition.folds[ranks == rank].tolist())) == 1
            if rank + 1 < int(ranks.max()):
                assert partition.folds[ranks == rank][0] != partition.folds[ranks == rank + 1][0]
    turned = samples.azimuth_copies(2, 0, mirrored=False)
    assert torch.equal(partitions_of(turned, 4, 0, rings=True)[0].folds, partitions[0].folds.repeat(2))


def test_four_rings_are_enough_and_leave_no_empty_fold() -> None:
    """Two inner rings of θi in three possible folds: a fold that nothing is in must not be judged."""
    whole = _goniometer()
    theta = torch.acos(whole.wi[:, 2].clamp(-1, 1))
    samples = whole.select(theta < 0.17 * 4.5)
    partitions = partitions_of(samples, 4, 0, rings=True)
    assert len(partitions) == 2
    assert len(set(partitions[0].folds.tolist()) - {-1}) == 2
    logs = LogSamples(samples.wi, samples.wo, samples.wi[:, :1] + samples.wo[:, 2:], samples.weights)
    assert 0 < Folded.of(logs, partitions, PROJECTIONS, SHAPES).error(1e-3) < 1
    # A look at one fold takes the first.
    assert 0 < Folded.of(logs, partitions, PROJECTIONS, SHAPES, 1).error(1e-3, 1) < 1


def test_other_sets_are_judged_at_random() -> None:
    scattered = Samples(
        *draw_in_discs(500, torch.Generator().manual_seed(0)), torch.ones(500, 1), channels=("Y",), isotropic=True
    )
    for samples, rings in ((scattered, True), (_goniometer(), False)):
        (partition,) = partitions_of(samples, 4, 0, rings=rings)
        assert partition.share == 1
        assert torch.equal(partition.folds, random_folds(len(samples), 4, 0))


def test_partitions_count_by_their_shares() -> None:
    samples = _noisy(0.3)
    even, thirds = random_folds(900, 2, 0), random_folds(900, 3, 1)
    # The second leaves out half of the samples only: shares, not weights, are what counts between partitions.
    thirds[450:] = -1

    def error(*partitions: Partition) -> float:
        return Folded.of(samples, partitions, PROJECTIONS, SHAPES).error((0.05, 0.02))

    one, other = error(Partition(even, 1.0)), error(Partition(thirds, 1.0))
    assert abs(one - other) > 1e-3 * one
    assert error(Partition(even, 0.8), Partition(thirds, 0.2)) == pytest.approx(0.8 * one + 0.2 * other, rel=1e-9)
    assert error(Partition(even, 0.1), Partition(thirds, 0.9)) == pytest.approx(0.1 * one + 0.9 * other, rel=1e-9)
    chosen = Partition(even, 0.8).select(torch.arange(10)).repeated(3)
    assert (chosen.share, len(chosen.folds)) == (0.8, 30)
    assert torch.equal(chosen.folds, even[:10].repeat(3))


def test_textures_that_differ_get_smoothing_that_differs() -> None:
    """One texture has texel after texel to follow, the other is a ramp: one λ for both is worse than one each."""
    generator = torch.Generator().manual_seed(0)
    wi, wo = draw_in_discs(3000, generator, 0.98)
    rough = torch.sin(9 * PROJECTIONS[0].place(wi, wo)[0]).sum(1)
    # Linear in the place: smoothing costs it nothing.
    ramp = 0.5 * sum(uv[:, 0] for uv in PROJECTIONS[1].place(wi, wo))
    noise = 0.5 * torch.randn(3000, dtype=torch.float64, generator=generator)
    samples = LogSamples(wi, wo, (rough + ramp + noise)[:, None], torch.ones(3000).double())
    folded = Folded.of(samples, (Partition(random_folds(3000, 4, 0), 1.0),), PROJECTIONS, ((10, 10), (10, 10)))
    alike, common = folded.best_smoothing((1e-2, 1e-2), FitBudget())
    each, error = folded.best_each(alike, FitBudget())
    assert alike[0] == alike[1]
    assert each[1] >= 10 * each[0]
    assert error < common
    for j, factor in ((0, 10), (0, 0.1), (1, 0.1)):
        other = tuple(value * (factor if k == j else 1) for k, value in enumerate(each))
        assert folded.error(other) > error


def test_smoothing_moves_in_decades_or_half_ones_and_stays_in_its_range() -> None:
    folded = Folded.of(_noisy(1.0), (Partition(random_folds(900, 4, 0), 1.0),), PROJECTIONS, SHAPES)
    for found, step in (
        (folded.best_smoothing((2e-3, 2e-3), FitBudget())[0], 1.0),
        (folded.best_each((2e-3, 2e-3), FitBudget())[0], 1.0),
        (folded.best_each((2e-3, 2e-3), FitBudget(), stride=1)[0], 0.5),
    ):
        steps = [math.log10(value / 2e-3) / step for value in found]
        assert steps == pytest.approx([round(each) for each in steps], abs=1e-9)
        assert any(round(each) != 0 for each in steps)
    half = [math.log10(value / 2e-3) * 2 for value in folded.best_each((2e-3, 2e-3), FitBudget(), stride=1)[0]]
    assert any(round(each) % 2 for each in half)


def test_smoothing_that_only_helps_ends_at_the_last_step_in_its_range() -> None:
    """Noise about a constant: the more smoothing the better, without end."""
    samples = _noisy(1.0)
    noise = torch.randn(900, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(4))
    flat = LogSamples(samples.wi, samples.wo, noise, torch.ones(900).double())
    folded = Folded.of(flat, (Partition(random_folds(900, 4, 0), 1.0),), PROJECTIONS, SHAPES)
    assert folded.error((200.0, 200.0)) < folded.error((20.0, 20.0)) < folded.error((2.0, 2.0))
    assert folded.best_smoothing((2.0, 2.0), FitBudget())[0] == pytest.approx((20.0, 20.0))
    assert max(folded.best_each((2.0, 2.0), FitBudget())[0]) <= 1e2
