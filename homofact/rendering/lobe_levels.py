"""The error of lobes under natural skies, which chooses the levels of a chain for a material's lobes.

In natural surroundings light of angular frequency l has variances that fall as 1/(l (l + 1)) (Dror et al. 2004: as l⁻²
and a little more). Under such skies the mean square of what a difference Δ of two lobes of equal flux reflects is

    E(Δ) = Σ Δlm²/(l (l + 1)) = ∫∫ Δ(ω) G(ω·ω') Δ(ω') dω dω',   G(cosγ) = Σ_{l ≥ 1} (2l + 1)/(4π l (l + 1)) Pl(cosγ),

where G is the Green's function of the sphere. A lobe that is rotated by much less than its width then has a small
error; the plain integral of Δ² would penalise it. Lamps are smaller than this spectrum assumes. For the chains of
engines, whose shares may be negative, `FLAT` is therefore added to 1/(l (l + 1)): the flat spectrum of point lights.
With the Legendre coefficients kl of the chain's kernels K (`rendering.chain_kernels`)

    potential  φk(γ) = ∫ G K dω = Σ (2l + 1)/(4π l (l + 1)) kl Pl(cosγ),
    overlap    Qjk(γ) = Σ (2l + 1)/(4π l (l + 1)) jl kl Pl(cosγ)

are functions of one angle each. They are tabulated at γ = π (i/(POINTS − 1))².
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from homofact.linear.kernels import kernel
from homofact.rendering.chain_kernels import ChainKernels

POINTS, RIDGE, FLAT = 1024, 1e-4, 1e-3
_NODES = 8000
_BANDS = 20  # times 1/α of the narrowest kernel, whose coefficients are nothing there


class Potentials(NamedTuple):
    """Tables for the L kernels of a chain: `potential` (L, POINTS) φ, and `overlap` (L, L, POINTS) Q."""

    potential: np.ndarray
    overlap: np.ndarray


@lru_cache(maxsize=8)
def potentials(kernels: ChainKernels) -> Potentials:
    """Those of a chain with these kernels."""
    gamma = (np.arange(_NODES) + 0.5) * (math.pi / 2 / _NODES)
    count = len(kernels.alphas)
    flux = np.stack([kernels.at(level, gamma) for level in range(count)]) * np.sin(gamma)
    flux /= flux.sum(1, keepdims=True)
    x, y = np.cos(gamma), np.cos(_angles())
    before, now, seen_before, seen = np.ones_like(x), x, np.ones_like(y), y
    potential, overlap = np.zeros((count, POINTS)), np.zeros((count, count, POINTS))
    flat = FLAT if kernels.ggx else 0.0
    for band in range(1, math.ceil(_BANDS / kernels.narrowest)):
        own = flux @ now
        gain = (2 * band + 1) / (4 * math.pi) * (1 / (band * (band + 1)) + flat) * seen
        potential += own[:, None] * gain
        overlap += (own[:, None] * own)[..., None] * gain
        before, now = now, ((2 * band + 1) * x * now - band * before) / (band + 1)
        seen_before, seen = seen, ((2 * band + 1) * y * seen - band * seen_before) / (band + 1)
    return Potentials(potential, overlap)


def _angles() -> np.ndarray:
    return math.pi * (np.arange(POINTS) / (POINTS - 1)) ** 2


@kernel(nogil=True, inline="always")
def _between(table, level, cosine):  # pragma: no cover (compiled)
    """A tabulated function of a level and of an angle, given by its cosine: linear between two of either."""
    low = max(min(int(level), len(table) - 2), 0)
    up = level - low
    place = math.sqrt(math.acos(min(max(cosine, -1.0), 1.0)) / math.pi) * (POINTS - 1)
    k = min(int(place), POINTS - 2)
    part = place - k
    here, above = table[low], table[low + 1]
    return (1 - up) * ((1 - part) * here[k] + part * here[k + 1]) + up * ((1 - part) * above[k] + part * above[k + 1])


@kernel(nogil=True, fastmath=True)
def pull_of(axis, level, wi, flux, potential):  # pragma: no cover (compiled)
    """Return ∫∫ K G f cosθi (C,) of a level's kernel around an axis (3,) and the flux (M, C) from `wi` (M, 3).

    The angle is found by a polynomial (Abramowitz and Stegun 1964, 4.4.46), to 2e-8 radians: a loop without calls and
    branches takes several nodes at once.
    """
    low = max(min(int(level), len(potential) - 2), 0)
    up = level - low
    row = (1 - up) * potential[low] + up * potential[low + 1]
    values = np.empty(len(wi))
    for m in range(len(wi)):
        cosine = min(max(wi[m, 0] * axis[0] + wi[m, 1] * axis[1] + wi[m, 2] * axis[2], -1.0), 1.0)
        x = abs(cosine)
        series = -0.0012624911 * x + 0.0066700901
        series = series * x - 0.0170881256
        series = series * x + 0.0308918810
        series = series * x - 0.0501743046
        series = series * x + 0.0889789874
        series = series * x - 0.2145988016
        angle = math.sqrt(1 - x) * (series * x + 1.5707963050)
        angle = angle if cosine >= 0 else math.pi - angle
        place = math.sqrt(angle * (1 / math.pi)) * (POINTS - 1)
        # Unsigned places need no test for those counted from the end.
        k = np.uint64(min(np.int32(place), np.int32(POINTS - 2)))
        values[m] = row[k] + (place - k) * (row[k + np.uint64(1)] - row[k])
    return values @ flux


@kernel(nogil=True)
def energy(axes, levels, wi, flux, whole, potential, overlap, signed):  # pragma: no cover (compiled)
    """Return (E minus a constant, best shares (K + 1, C)) of lobes at `levels` (K,), and of the last level at n.

    E is the mean over T azimuths of the viewer, at each of which the lobes have unit `axes` (T, K, 3), and the
    material's own flux (T, M, C) comes from `wi` (M, 3). `whole` (2, C) has two means over all azimuths: the sum of the
    flux, which is the albedo, and the result of `pull_of` for the last level around n. The shares add up to the albedo
    in every channel; they are ≥ 0 unless `signed`.
    """
    turns, lobes = axes.shape[0], axes.shape[1]
    count, channels, last = lobes + 1, flux.shape[2], len(potential) - 1.0
    own = np.empty(count)
    for k in range(lobes):
        own[k] = min(max(levels[k], 0.0), last)
    own[lobes] = last
    pull, between = np.zeros((count, channels)), np.zeros((count, count))
    for turn in range(turns):
        for k in range(count):
            if k < lobes:
                # Number by number here: numba takes seconds to compile an assignment of a row.
                pulled = pull_of(axes[turn, k], own[k], wi, flux[turn], potential)
                for channel in range(channels):
                    pull[k, channel] += pulled[channel] / turns
            low = max(min(int(own[k]), len(potential) - 2), 0)
            part = own[k] - low
            for j in range(k + 1):
                if k < lobes:
                    cosine = (
                        axes[turn, j, 0] * axes[turn, k, 0]
                        + axes[turn, j, 1] * axes[turn, k, 1]
                        + axes[turn, j, 2] * axes[turn, k, 2]
                    )
                else:
                    cosine = axes[turn, j, 2] if j < lobes else 1.0
                lower = (1 - part) * _between(overlap[low], own[j], cosine)
                between[j, k] += (lower + part * _between(overlap[low + 1], own[j], cosine)) / turns
                between[k, j] = between[j, k]
    total, shares = 0.0, np.zeros((count, channels))
    for channel in range(channels):
        pull[lobes, channel] = whole[1, channel]
        value, best = shared(between, pull[:, channel], whole[0, channel], signed)
        total += value
        for k in range(count):
            shares[k, channel] = best[k]
    return total, shares


@kernel(nogil=True)
def shared(between, pull, whole, signed):  # pragma: no cover (compiled)
    """Return (minimum of w·Q w − 2 w·b with the sum of w equal to `whole`, w), by trying all sets of w > 0.

    If `signed`, w may be negative, and `RIDGE` Σ Qkk wk² is added, so that two nearly equal lobes do not get large
    weights of opposite sign.
    """
    count = len(pull)
    best, best_shares = math.inf, np.zeros(count)
    for chosen in range((1 << count) - 1 if signed else 1, 1 << count):
        place, size = np.empty(count, np.int64), 0
        for k in range(count):
            if chosen >> k & 1:
                place[size] = k
                size += 1
        # Lagrange's conditions, by elimination.
        system = np.zeros((size + 1, size + 2))
        for i in range(size):
            for j in range(size):
                system[i, j] = between[place[i], place[j]]
            system[i, i] += (RIDGE if signed else 1e-9) * between[place[i], place[i]]
            system[i, size] = system[size, i] = 1.0
            system[i, size + 1] = pull[place[i]]
        system[size, size + 1] = whole
        if not _eliminated(system):
            continue
        shares, value, allowed = np.zeros(count), 0.0, True
        for i in range(size):
            allowed = allowed and (signed or system[i, size + 1] >= 0)
            shares[place[i]] = system[i, size + 1]
        if not allowed:
            continue
        for i in range(count):
            for j in range(count):
                value += shares[i] * between[i, j] * shares[j]
            value -= 2 * shares[i] * pull[i]
            value += RIDGE * between[i, i] * shares[i] ** 2 if signed else 0.0
        if value < best:
            best, best_shares = value, shares
    return best, best_shares


@kernel(nogil=True)
def _eliminated(system):  # pragma: no cover (compiled)
    """Solve (n, n + 1) in place, the solution in its last column; whether there is one."""
    count = len(system)
    for column in range(count):
        pivot = column
        for row in range(column + 1, count):
            if abs(system[row, column]) > abs(system[pivot, column]):
                pivot = row
        if abs(system[pivot, column]) < 1e-14:
            return False
        for k in range(count + 1):
            system[column, k], system[pivot, k] = system[pivot, k], system[column, k]
        for row in range(count):
            if row == column:
                continue
            factor = system[row, column] / system[column, column]
            for k in range(column, count + 1):
                system[row, k] -= factor * system[column, k]
    for row in range(count):
        system[row, count] /= system[row, row]
    return True
