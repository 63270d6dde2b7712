"""What a prior and samples tell, and what is chosen by it: laws of kriging, V-optimality, and the order of moves."""

import itertools

import numpy as np
import pytest
import torch

from homofact.brdf.samples import Samples
from homofact.geometry.directions import draw_in_discs, from_spherical
from homofact.measuring.aims import ALBEDO_WEIGHT, HIGHLIGHT_WEIGHT, measuring_aims
from homofact.measuring.choosing import Uncertainty, chosen_groups, chosen_rows
from homofact.measuring.completed import CompletedBrdf
from homofact.measuring.foretelling import aim_errors, foretold
from homofact.measuring.goniometer import Goniometer, directions_of, separations
from homofact.measuring.half_grid import HalfGrid
from homofact.measuring.posterior import NOISE, after_values, before_samples
from homofact.measuring.prior import EPSILON, BrdfPrior, read_prior
from homofact.measuring.rounds import chosen_angles, next_round, picture_change, remaining
from homofact.measuring.route import seconds, shortest_order

PRIOR = read_prior()


def drawn(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    return draw_in_discs(count, torch.Generator().manual_seed(seed), 0.7)


def material(seed: int) -> CompletedBrdf:
    """A material of the prior: near one of its centres."""
    chance = np.random.default_rng(seed)
    own = before_samples(PRIOR, 3)
    root = np.linalg.cholesky(PRIOR.covariance + 1e-9 * np.eye(PRIOR.grid.size))
    logs = own.centres[seed % len(own.centres)] + root @ chance.standard_normal(PRIOR.grid.size)
    one = after_values(PRIOR, PRIOR.grid.matrix(*drawn(2)), np.full((2, 3), 0.1))
    return CompletedBrdf(
        PRIOR.grid, type(one)(np.ones(1), logs[None], np.ones(1), own.covariance, own.ratios, own.colour_covariance),
        ("R", "G", "B"),
    )  # fmt: skip


def test_the_grid_reads_its_own_nodes_and_what_is_linear_in_between() -> None:
    grid = HalfGrid((6, 5, 4))
    wi, wo = drawn(200)
    matrix = grid.matrix(wi, wo)
    assert np.allclose(np.asarray(matrix.sum(1)), 1)
    assert (matrix.toarray() >= 0).all()
    for axis in range(3):
        assert np.allclose(matrix @ grid.nodes()[:, axis], grid.places(wi, wo)[:, axis], atol=1e-12)
    # Reciprocal, and the same for all azimuths.
    assert np.allclose((grid.matrix(wo, wi) - matrix).toarray(), 0, atol=1e-9)
    assert float(np.linalg.eigvalsh(grid.correlation((0.15, 0.25, 0.7))).min()) > -1e-12


def test_with_enough_samples_the_estimate_is_what_was_measured() -> None:
    truth = material(3)
    wi, wo = drawn(1500, 1)
    matrix = PRIOR.grid.matrix(wi, wo)
    values = truth.evaluate(wi, wo).numpy()
    known = after_values(PRIOR, matrix, values)
    off = np.log((known.values(matrix) + EPSILON) / (values + EPSILON))
    assert np.sqrt((off**2).mean()) < NOISE
    before = np.log((before_samples(PRIOR, 3).values(matrix) + EPSILON) / (values + EPSILON))
    assert np.sqrt((before**2).mean()) > 10 * NOISE


def test_one_sample_is_met_and_moves_its_neighbours() -> None:
    wi, wo = drawn(1)
    matrix = PRIOR.grid.matrix(wi, wo)
    values = np.array([[0.5, 0.3, 0.1]])
    known = after_values(PRIOR, matrix, values)
    assert known.values(matrix) == pytest.approx(values, rel=0.05)
    assert float(known.shares.sum()) == pytest.approx(1)
    assert known.ratios.mean(0) == pytest.approx(np.ones(PRIOR.grid.size))


def test_a_sample_never_makes_what_is_known_less_certain() -> None:
    values = material(5).evaluate(*drawn(12, 2)).numpy()
    matrix = PRIOR.grid.matrix(*drawn(12, 2))
    variances = [np.diag(PRIOR.covariance)]
    for count in (1, 3, 7, 12):
        variances.append(np.diag(after_values(PRIOR, matrix[:count], values[:count]).covariance))
    for before, after in itertools.pairwise(variances):
        assert (after <= before + 1e-12).all()
        assert after.sum() < before.sum()


def small(seed: int) -> tuple[list[Uncertainty], object]:
    from scipy.sparse import csr_matrix

    chance = np.random.default_rng(seed)
    blocks = []
    for _ in range(2):
        root, weights = chance.standard_normal((6, 6)), chance.standard_normal((4, 6))
        blocks.append(Uncertainty(root @ root.T, weights.T @ weights, 0.1))
    return blocks, csr_matrix(chance.random((9, 6)))


@pytest.mark.parametrize("seed", range(5))
def test_each_choice_is_the_best_of_all_by_brute_force(seed: int) -> None:
    blocks, matrix = small(seed)
    chosen = chosen_rows(blocks, matrix, 4)  # type: ignore[arg-type]
    assert len(set(chosen)) == 4
    for count in range(4):
        traces = []
        for row in range(9):
            own = [*chosen[:count], row]
            parts = [block.after(matrix[own]) for block in blocks]  # type: ignore[index]
            traces.append(sum(float((part.weights * part.covariance).sum()) for part in parts))
        traces = [np.inf if row in chosen[:count] else trace for row, trace in enumerate(traces)]
        assert int(np.argmin(traces)) == chosen[count]


def test_groups_are_chosen_by_what_they_tell_together() -> None:
    blocks, matrix = small(7)
    groups = [matrix[[0, 1]], matrix[[2]], matrix[[3, 4, 5]], matrix[[6]]]  # type: ignore[index]
    chosen = chosen_groups(blocks, groups, 3)
    first = int(np.argmax([sum(block.gain(group) for block in blocks) for group in groups]))
    assert chosen[0] == first
    assert len(set(chosen)) == 3
    # Single rows as groups are what single rows are.
    assert chosen_groups(blocks, [matrix[[row]] for row in range(9)], 4) == chosen_rows(blocks, matrix, 4)  # type: ignore


def test_the_gain_is_what_the_trace_loses() -> None:
    blocks, matrix = small(3)
    before, after = (float((each.weights * each.covariance).sum()) for each in (blocks[0], blocks[0].after(matrix)))  # type: ignore[arg-type]
    assert blocks[0].gain(matrix) == pytest.approx(before - after)  # type: ignore[arg-type]
    assert 0 < remaining(blocks, matrix) < 1


def test_the_weights_count_each_aim_as_said() -> None:
    known = before_samples(PRIOR, 3)
    weights = measuring_aims(PRIOR.grid).weights(known)
    assert float((weights * known.total).sum()) == pytest.approx(1 + ALBEDO_WEIGHT + HIGHLIGHT_WEIGHT)


@pytest.mark.parametrize("count", [1, 3])
def test_the_change_is_the_one_that_values_drawn_from_the_posterior_make(count: int) -> None:
    known = before_samples(PRIOR, 1)
    one = type(known)(
        np.ones(1), known.mean[None], np.ones(1), known.total / 100, known.ratios, known.colour_covariance
    )
    aims, chance = measuring_aims(PRIOR.grid), np.random.default_rng(1)
    matrix = PRIOR.grid.matrix(*drawn(count, 8))
    taken = Uncertainty(one.covariance, one.covariance, NOISE**2).taken(matrix)
    light = aims.light(one.values(aims.matrix))
    moved = []
    for _ in range(300):
        logs = one.mean + taken.T @ chance.standard_normal(count)
        other = aims.light(one.values(aims.matrix, logs))
        pairs = [pair for kind in ("lamp", "sky") for pair in zip(other[kind], light[kind], strict=True)]
        moved.append(np.mean([np.abs(a - b).sum() / b.sum() for a, b in pairs]))
    assert picture_change(aims, one, taken) == pytest.approx(np.mean(moved), rel=0.15)


def test_what_is_chosen_depends_on_what_was_measured_and_beats_chance() -> None:
    goniometer = Goniometer()
    start = before_samples(PRIOR, 3)
    angles = chosen_angles(PRIOR, start, goniometer, 5)
    rest, off = set(), {"chosen": [], "chance": []}
    aims = measuring_aims(PRIOR.grid)
    for seed in (4, 40, 80):
        truth = material(seed)
        whole = truth.evaluate(aims.wi, aims.wo).numpy()
        for name, pair in (("chosen", directions_of(angles)), ("chance", drawn(5, seed))):
            known = after_values(PRIOR, PRIOR.grid.matrix(*pair), truth.evaluate(*pair).numpy())
            off[name].append(aim_errors(aims, whole, known.values(aims.matrix)).psnr)
            if name == "chosen":
                rest.add(str(chosen_angles(PRIOR, known, goniometer, 5)))
    assert len(rest) > 1
    assert np.mean(off["chosen"]) > np.mean(off["chance"]) + 3


@pytest.mark.slow
def test_the_intervals_cover_materials_of_the_prior() -> None:
    aims, goniometer = measuring_aims(PRIOR.grid), Goniometer()
    pair = directions_of(chosen_angles(PRIOR, before_samples(PRIOR, 3), goniometer, 8))
    inside, above = [], []
    for seed in range(8):
        truth = material(10 * seed + 1)
        known = after_values(PRIOR, PRIOR.grid.matrix(*pair), truth.evaluate(*pair).numpy())
        told = foretold(PRIOR, known, aims)
        was = aim_errors(aims, truth.evaluate(aims.wi, aims.wo).numpy(), known.values(aims.matrix))
        inside += (np.abs(was.albedo) <= np.log(told.albedo_factor)).tolist()
        above.append(was.psnr >= told.psnr_least)
    assert np.mean(inside) > 0.8
    assert np.mean(above) > 0.7


def test_nothing_is_off_against_itself_and_a_factor_is_its_logarithm() -> None:
    aims = measuring_aims(PRIOR.grid)
    values = material(2).evaluate(aims.wi, aims.wo).numpy()
    assert aim_errors(aims, values, values).psnr == np.inf
    twice = aim_errors(aims, values, 2 * values)
    assert twice.albedo == pytest.approx([np.log(2)] * 5)
    assert twice.highlight == pytest.approx([np.log(2)] * 5)
    assert twice.psnr < 25


def test_a_white_surface_reflects_pi_times_its_value() -> None:
    aims = measuring_aims(PRIOR.grid)
    light = aims.light(np.full((len(aims.wi), 1), 0.8 / np.pi))
    assert light["albedo"][0][:, 0] == pytest.approx([0.8] * 5, rel=0.01)
    assert (light["highlight"][0] < light["albedo"][0]).all()


@pytest.mark.parametrize("seed", range(6))
def test_the_order_is_of_all_places_and_no_longer_than_the_given_one(seed: int) -> None:
    angles = np.random.default_rng(seed).random((2 + 5 * seed, 3)) * 80
    goniometer = Goniometer(settle=seed)
    moves, first = goniometer.moves(angles), goniometer.first_moves(angles)
    order = shortest_order(moves, first)
    assert sorted(order) == list(range(len(angles)))
    assert seconds(order, moves, first) <= seconds(list(range(len(angles))), moves, first) + 1e-9
    if len(angles) <= 7:
        best = min(seconds(list(each), moves, first) for each in itertools.permutations(range(len(angles))))
        assert seconds(order, moves, first) <= 1.15 * best


def test_places_on_a_line_are_visited_along_it() -> None:
    angles = np.array([[40.0, 0, 0], [10, 0, 0], [30, 0, 0], [20, 0, 0]])
    goniometer = Goniometer(speed=10, settle=1)
    moves, first = goniometer.moves(angles), goniometer.first_moves(angles)
    assert shortest_order(moves, first) == [1, 3, 2, 0]
    # Four moves of one axis, 10° each in a second, and a second to settle.
    assert seconds([1, 3, 2, 0], moves, first) == pytest.approx(8)
    assert shortest_order(moves[:1, :1], first[:1]) == [0]


def test_the_goniometer_keeps_to_its_limits() -> None:
    own = Goniometer(theta_i=(10, 60), theta_o=(5, 70), phi=(30, 180), separation=12, resolution=0.5)
    for angles in (own.directions(), *own.incidences()):
        assert len(angles)
        for axis, (low, high) in enumerate((own.theta_i, own.theta_o, own.phi)):
            assert angles[:, axis].min() >= low
            assert angles[:, axis].max() <= high
        assert separations(angles).min() >= 12 - 1e-6
    single = own.directions()
    assert np.allclose(single / 0.5, np.round(single / 0.5))
    assert len(np.unique(single, axis=0)) == len(single)
    assert len(Goniometer().directions()) > 1000


def test_a_goniometer_reaches_as_far_as_the_samples_unless_it_is_told() -> None:
    theta = torch.tensor([10.0, 60.0, 84.6]).deg2rad()
    zero = torch.zeros(3)
    samples = Samples(from_spherical(theta / 2, zero), from_spherical(theta, zero + 1), torch.ones(3, 3))
    assert Goniometer.reaching(samples).theta_i == (0, 80)
    assert Goniometer.reaching(samples).theta_o == (0, 84)
    assert Goniometer.reaching(samples, theta_o=(5, 70), settle=2) == Goniometer(theta_o=(5, 70), settle=2)
    assert Goniometer.reaching(None) == Goniometer()


def test_candidates_hold_the_mirror_direction_and_its_neighbours() -> None:
    angles = Goniometer().directions()
    wi, wo = directions_of(angles)
    half = (wi + wo) / (wi + wo).norm(dim=1, keepdim=True)
    theta = torch.acos(half[:, 2].clamp(-1, 1)).rad2deg().numpy()
    for level in (0, 0.25, 0.5, 1, 2):
        assert (np.abs(theta - level) < 0.13).sum() >= 5


@pytest.mark.slow
def test_equal_samples_give_equal_bits() -> None:
    wi, wo = drawn(6)
    values = material(9).evaluate(wi, wo).numpy()
    rounds = [
        next_round(PRIOR, after_values(PRIOR, PRIOR.grid.matrix(wi, wo), values), Goniometer(), directions=3)
        for _ in range(2)
    ]
    assert np.array_equal(rounds[0].angles, rounds[1].angles)
    assert rounds[0].foretold == rounds[1].foretold
    assert (rounds[0].change, rounds[0].change_by_rings) == (rounds[1].change, rounds[1].change_by_rings)


@pytest.mark.slow
def test_more_measurements_leave_less_to_change() -> None:
    truth, goniometer = material(11), Goniometer(rings=20, azimuths=45)
    ring = np.concatenate(goniometer.incidences()[::3])
    changes = []
    for angles in (ring[::12], ring):
        wi, wo = directions_of(angles)
        known = after_values(PRIOR, PRIOR.grid.matrix(wi, wo), truth.evaluate(wi, wo).numpy())
        changes.append(next_round(PRIOR, known, goniometer, directions=1).change_by_rings)
    assert changes[1] < changes[0] / 2


def test_the_table_comes_back_from_its_record() -> None:
    again = BrdfPrior.from_record(PRIOR.record())
    for name in ("mean", "vectors", "scores", "rest", "colour", "colour_rest"):
        own, other = getattr(PRIOR, name), getattr(again, name)
        assert np.abs(own - other).max() <= np.abs(own).max() / 100
    assert again.widening == PRIOR.widening


def test_the_statistics_describe_the_materials_they_are_made_of() -> None:
    chance = np.random.default_rng(0)
    grid = HalfGrid((4, 3, 2))
    logs = chance.standard_normal((30, 2)) @ chance.standard_normal((2, grid.size)) + 3
    made = BrdfPrior.of(grid, logs, np.ones((30, 3, grid.size)))
    assert made.mean == pytest.approx(logs.mean(0))
    assert made.mean + made.scores @ made.vectors == pytest.approx(logs)
    assert made.colour_rest == pytest.approx(np.full(grid.size, 0.1))
