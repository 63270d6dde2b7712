"""The compiled search for lobes: where scipy's simplex ends, and numbers that stand for lobes and their directions."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from homofact.rendering.lobe_levels import potentials
from homofact.rendering.lobe_search import (
    CLOSE,
    FLAT_ENOUGH,
    SMOOTH,
    Bounds,
    Seen,
    axes_of,
    lobes_of,
    reflected,
    simplex,
    value_of,
)
from homofact.rendering.sky_chain import own_kernels

KNOWN = potentials(own_kernels(32))
BOUNDS = Bounds(np.array([0.0, -0.5] * 2), np.array([2.0, 2.0] * 2), np.array([1.0, 100.0] * 2), False, False)
X = np.array([0.4, 0.1, 1.5, 0.0])


def seen(seed: int = 0) -> Seen:
    """Light from 60 directions near the mirror direction of a viewer at 0.6 radians, some elsewhere."""
    rng = np.random.default_rng(seed)
    towards = rng.normal(size=(60, 3)) * 0.3 + (-math.sin(0.6), 0, math.cos(0.6))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    flux = rng.random((1, 60, 2)) / 60
    return Seen(0.6, np.array([[1.0, 0, 0]]), towards, flux, np.stack((flux[0].sum(0), [0.01, 0.02])))


def test_numbers_are_lobes_or_a_middle_one_and_a_pair() -> None:
    assert lobes_of(X, False).tolist() == [[0.4, 0.1, 0], [1.5, 0, 0]]
    paired = lobes_of(np.array([0.4, 0.1, 1.5, 0.2, 0.3]), True)
    assert paired.tolist() == [[0.4, 0.1, 0], [1.5, 0.2, 0.3], [1.5, 0.2, -0.3]]


def test_lobes_stand_round_mirror_directions_at_their_half_vectors() -> None:
    grains = np.array([[1.0, 0, 0], [math.cos(0.5), math.sin(0.5), 0]])
    lobes = np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.2]])
    found, viewer = axes_of(0.6, grains, lobes), np.array([math.sin(0.6), 0, math.cos(0.6)])
    for turn, grain in enumerate(grains):
        for k, (_, tilt, spread) in enumerate(lobes):
            half = np.array([0, 0, 1]) + spread * grain
            expected = 2 * (half @ viewer) * half - (half @ half) * viewer + (0, 0, tilt)
            assert found[turn, k] == pytest.approx(expected / np.linalg.norm(expected))


@pytest.mark.parametrize("before", [np.zeros(0), np.array([0.5, 0.0, 1.2, 0.1])], ids=["alone", "neighbour"])
def test_what_is_minimised_is_the_energy_with_what_it_costs_to_leave_the_bounds_or_the_neighbour(before) -> None:
    x = np.array([-0.2, 0.1, 2.5, 0.0])
    energy = reflected(x, seen(), KNOWN, BOUNDS)[0] / 3
    moved = 0.0 if len(before) == 0 else SMOOTH * (BOUNDS.price * (x - before) ** 2).sum()
    assert value_of(x, before, 3.0, seen(), KNOWN, BOUNDS) == pytest.approx(energy + 0.7 + moved, rel=1e-9)


@pytest.mark.parametrize("most", [20, 48, 400])
def test_the_simplex_ends_where_scipy_s_does(most: int) -> None:
    first, before = np.array([0.15, 0.03] * 2), X + 0.1
    for seed in range(4):
        given = before, 0.1, seen(seed), KNOWN, BOUNDS
        options = {
            "maxfev": most, "initial_simplex": np.vstack([X, X + np.diag(first)]), "xatol": CLOSE, "fatol": FLAT_ENOUGH,
        }  # fmt: skip
        expected = minimize(value_of, X, given, method="Nelder-Mead", options=options)
        found = simplex(X, first, most, *given)
        assert value_of(found, *given) <= expected.fun + 1e-9
        if most == 400:
            assert found == pytest.approx(expected.x, abs=1e-6)
