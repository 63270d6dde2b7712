"""The search of few angles against the search of all of them, on sums with one minimum each."""

from collections.abc import Callable

import numpy as np
import pytest

from homofact.brdf.quality.least_angle import COARSE, DRAWS, FINE, LeastAngle, steps_round

BLOCKS = 6
LIMIT = 0.6


def bowls(centres: np.ndarray, floor: float = 0.1) -> Callable[[float], np.ndarray]:
    """Sums (2, 2 BLOCKS) whose ratio is least at `centres` (2 BLOCKS,), block by block."""

    def sums(degrees: float) -> np.ndarray:
        return np.stack(((degrees - centres) ** 2 + floor, np.ones(len(centres))))

    return sums


def lowest(at: np.ndarray, sums: np.ndarray) -> float:
    """The vertex of the parabola through the least ratio of sums (K, 2) and its neighbours, one by one."""
    ratio = sums[:, 0] / sums[:, 1]
    k = int(np.argmin(ratio))
    if k in (0, len(at) - 1):
        return float(at[k])
    curve, slope, _ = np.polyfit(at[k - 1 : k + 2] - at[k], ratio[k - 1 : k + 2], 2)
    return float(at[k] - slope / (2 * curve))


def of_all(sums: Callable[[float], np.ndarray]) -> tuple[float, tuple[float, float], float]:
    """The answer with every angle of the grid evaluated."""
    steps = steps_round(0.0, LIMIT, COARSE, LIMIT)
    best = min(steps, key=lambda degrees: np.divide(*sums(degrees).sum(1)))
    at = np.array(sorted({*steps, *steps_round(best, 2 * COARSE, FINE, LIMIT)}))
    table = np.stack([sums(degrees) for degrees in at.tolist()])
    near, others = table[:, :, :BLOCKS], table[:, :, BLOCKS:]
    draws = np.random.default_rng(0).integers(0, BLOCKS, (DRAWS, BLOCKS))
    spread = [lowest(at, (near + others)[:, :, draw].sum(2)) for draw in draws]
    low, high = np.quantile(spread, (0.025, 0.975)).tolist()
    return lowest(at, table.sum(2)), (low, high), lowest(at, near.sum(2))


def found(
    sums: Callable[[float], np.ndarray], guess: float = 0.0
) -> tuple[tuple[float, tuple[float, float], float], list[float]]:
    """The answer of the search, and the angles at which it asked for sums."""
    asked: list[float] = []

    def counted(degrees: float) -> np.ndarray:
        asked.append(degrees)
        return sums(degrees)

    search = LeastAngle(counted, {})
    steps = steps_round(0.0, LIMIT, COARSE, LIMIT)
    best = search.best_of(steps, guess)
    grid = sorted({*steps, *steps_round(best, 2 * COARSE, FINE, LIMIT)})
    return search.answer(grid, best), asked


def apart(spread: float, centre: float, near: float = 0.0, seed: int = 0) -> np.ndarray:
    """Minima of blocks round `centre`, the first half moved by `near`."""
    centres = centre + spread * np.random.default_rng(seed).normal(size=2 * BLOCKS)
    return centres + near * (np.arange(2 * BLOCKS) < BLOCKS)


@pytest.mark.parametrize("guess", [-0.5, 0.0, 0.3])
@pytest.mark.parametrize(
    "centres",
    [apart(0.01, 0.23), apart(0.1, -0.31), apart(0.3, 0.0), apart(0.02, 0.1, near=-0.4), apart(0.02, 0.58)],
    ids=["sure", "unsure", "lost", "another angle in the plane", "at the end"],
)
def test_few_angles_answer_as_all_of_them_do(centres: np.ndarray, guess: float) -> None:
    (degrees, interval, near), asked = found(bowls(centres), guess)
    expected = of_all(bowls(centres))
    assert degrees == pytest.approx(expected[0], abs=1e-9)
    assert interval == pytest.approx(expected[1], abs=1e-9)
    assert near == pytest.approx(expected[2], abs=1e-9)
    assert len(asked) == len(set(asked))


def test_a_sure_angle_takes_few_evaluations() -> None:
    _, asked = found(bowls(apart(0.01, 0.23)), guess=0.2)
    assert len(asked) <= 9


def test_parabolas_are_met_at_their_vertices() -> None:
    centres = np.full(2 * BLOCKS, 0.1234)
    (degrees, (low, high), near), _ = found(bowls(centres))
    assert [degrees, low, high, near] == pytest.approx([0.1234] * 4, abs=1e-9)


def test_what_falls_to_the_end_of_the_grid_ends_there() -> None:
    (degrees, interval, near), _ = found(lambda degrees: np.array([[2.0 - degrees] * 12, [1.0] * 12]))
    assert (degrees, interval, near) == (LIMIT, (LIMIT, LIMIT), LIMIT)


def test_equal_ratios_end_the_search() -> None:
    (degrees, _, _), _ = found(lambda _: np.ones((2, 2 * BLOCKS)))
    assert abs(degrees) <= LIMIT


def test_steps_meet_the_middle_and_keep_within_the_limit() -> None:
    steps = steps_round(0.55, 0.1, 0.05, 0.6)
    assert steps == [0.45, 0.5, 0.55, 0.6]
    assert 0.0 in steps_round(0.0, 0.6, 0.05, 0.6)
