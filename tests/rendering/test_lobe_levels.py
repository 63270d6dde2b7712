"""The measure of lobes: a known potential, shares that no others beat, and a level found where a lobe stands on it."""

import math

import numpy as np
import pytest
import torch
from scipy.optimize import minimize
from skies import Planted
from torch import Tensor

from homofact.rendering import lobe_levels
from homofact.rendering.chain_kernels import cosine_power, ggx_kernels
from homofact.rendering.lobe_levels import POINTS, _between, energy, potentials, pull_of, shared
from homofact.rendering.sky_chain import own_kernels
from homofact.rendering.split_sum import response_of

SIDE = 64


def test_far_from_a_narrow_lobe_its_potential_is_the_green_s_function() -> None:
    """−(ln((1 − cosγ)/2) + 1)/4π, whose mean over the sphere is 0."""
    known = potentials(own_kernels(256))
    gamma = math.pi * (np.arange(POINTS) / (POINTS - 1)) ** 2
    far = gamma > 0.2
    expected = -(np.log((1 - np.cos(gamma[far])) / 2) + 1) / (4 * math.pi)
    assert known.potential[0][far] == pytest.approx(expected, abs=2e-5)
    # And of the overlap of two wide ones the mean is 0 too.
    for each in (known.potential[3], known.overlap[4, 2]):
        assert np.trapezoid(each * np.sin(gamma), gamma) == pytest.approx(0, abs=1e-5)


def test_an_overlap_is_the_potential_s_mean_over_the_other_lobe() -> None:
    known, alphas = potentials(own_kernels(SIDE)), own_kernels(SIDE).alphas
    generator = np.random.default_rng(0)
    # Directions of the lobe of level 1 round z: 1 − cosᵖ⁺¹γ is even.
    cosine = generator.random(200_000) ** (1 / (alphas[1] ** -2 + 1))
    phi, sine = generator.random(200_000) * 2 * math.pi, np.sqrt(1 - cosine**2)
    for angle in (0.0, 0.3, 1.2):
        seen = cosine * math.cos(angle) + sine * np.cos(phi) * math.sin(angle)
        place = np.sqrt(np.arccos(seen.clip(-1, 1)) / math.pi) * (POINTS - 1)
        mean = np.interp(place, np.arange(POINTS), known.potential[2]).mean()
        assert _between(known.overlap[1], 2.0, math.cos(angle)) == pytest.approx(mean, abs=3e-4)


def test_the_pull_is_the_potential_at_every_angle_times_the_flux() -> None:
    """Behind the axis too, and at a level between two."""
    known, rng = potentials(own_kernels(SIDE)), np.random.default_rng(2)
    wi = rng.normal(size=(400, 3))
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    axis, flux = wi[0], rng.random((400, 2))
    wi[1] = -axis
    place = np.sqrt(np.arccos((wi @ axis).clip(-1, 1)) / math.pi) * (POINTS - 1)
    low, high = (np.interp(place, np.arange(POINTS), known.potential[k]) for k in (1, 2))
    assert pull_of(axis, 1.25, wi, flux, known.potential) == pytest.approx((0.75 * low + 0.25 * high) @ flux, rel=1e-6)


def test_an_engine_s_chain_is_judged_by_small_lamps_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """An even spectrum adds the kernel itself to its potential, but for its mean over the sphere."""
    kernels = ggx_kernels((0.5, 0.8, 1.0), 0.02)
    gamma = math.pi * (np.arange(POINTS) / (POINTS - 1)) ** 2
    both = potentials.__wrapped__(kernels).potential
    monkeypatch.setattr(lobe_levels, "FLAT", 0.0)
    natural = potentials.__wrapped__(kernels).potential
    flat = (both - natural) / 1e-3
    inside = gamma < 1.3
    for level in range(2):
        assert flat[level][inside] == pytest.approx(
            kernels.at(level, gamma[inside]) - 1 / (4 * math.pi), rel=0.03, abs=1e-3
        )


def test_shares_are_the_best_of_all_that_add_up() -> None:
    generator = np.random.default_rng(3)
    for _ in range(30):
        root = generator.normal(size=(3, 3))
        between, pull, whole = root @ root.T + 0.1 * np.eye(3), generator.normal(size=3), generator.random() + 0.1

        def value(w, between=between, pull=pull):
            return w @ between @ w - 2 * w @ pull

        best, shares = shared(between, pull, whole, False)
        assert (shares >= 0).all()
        assert shares.sum() == pytest.approx(whole)
        assert best == pytest.approx(value(shares))
        sums = {"type": "eq", "fun": lambda w, whole=whole: w.sum() - whole}
        found = minimize(value, np.full(3, whole / 3), bounds=[(0, None)] * 3, constraints=sums, method="SLSQP")
        assert best <= found.fun + 1e-6


def test_the_energy_is_least_at_the_lobe_that_it_is_asked_for() -> None:
    """Flux of level 1.5 round a leaning direction: no other level or lean is as good, and all goes to that lobe."""
    known, generator = potentials(own_kernels(SIDE)), np.random.default_rng(1)
    alphas = own_kernels(SIDE).alphas
    mirror = np.array([-math.sin(0.6), 0.0, math.cos(0.6)])
    axis = mirror + np.array([0, 0, 0.2])
    axis /= np.linalg.norm(axis)
    x = generator.normal(size=(40_000, 3))
    wi = x / np.linalg.norm(x, axis=1, keepdims=True)
    gamma = np.arccos((wi @ axis).clip(-1, 1))
    density = (cosine_power(alphas[1], gamma) + cosine_power(alphas[2], gamma)) / 2 * (4 * math.pi / len(wi))
    flux = np.ascontiguousarray(np.stack((0.5 * density, 0.2 * density), 1))
    matte = pull_of(np.array([0.0, 0.0, 1.0]), len(alphas) - 1.0, wi, flux, known.potential)

    def at(level: float, tilt: float):
        tilted = mirror + np.array([0, 0, tilt])
        axes = (tilted / np.linalg.norm(tilted))[None, None]
        return energy(axes, np.array([level]), wi, flux[None], np.stack((flux.sum(0), matte)), *known, False)

    best, shares = at(1.5, 0.2)
    assert shares[0] == pytest.approx([0.5, 0.2], rel=0.05)
    assert shares[1] == pytest.approx([0, 0], abs=0.02)
    for level, tilt in ((1.2, 0.2), (1.8, 0.2), (1.5, 0.1), (1.5, 0.3)):
        assert at(level, tilt)[0] > best


@pytest.mark.parametrize("lobes", [1, 2])
def test_a_material_made_of_a_level_is_put_on_it(lobes: int) -> None:
    alpha = own_kernels(SIDE).alphas[1]

    def value(wi: Tensor, wo: Tensor) -> Tensor:
        gamma = torch.acos((wi * wo * wo.new_tensor((-1, -1, 1))).sum(1).clamp(-1, 1))
        return 0.7 * torch.from_numpy(cosine_power(alpha, gamma.numpy())) / wi[:, 2].clamp_min(1e-6)

    found = response_of(Planted(value), own_kernels(SIDE), lobes)
    steep = slice(30, None)
    used = found.shares[steep, :lobes, 0] > 0.05
    assert used.any(1).all()
    assert found.lobes[steep, :, 0][used].tolist() == pytest.approx([1.0] * int(used.sum()), abs=0.12)
    assert found.lobes[30:60, :, 1][used[:30]].tolist() == pytest.approx([0.0] * int(used[:30].sum()), abs=0.02)
    assert found.shares[steep, -1].abs().max() < 0.02
    assert found.shares[steep].sum(1).flatten().tolist() == pytest.approx([0.7] * (64 - 30), rel=0.02)
