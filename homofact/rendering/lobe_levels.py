"""How like two lobes are under skies as they are: the measure by which a material's lobes are put on a chain's levels.

In natural surroundings light of angular frequency l has variances that fall as 1/(l (l + 1)) (Dror et al. 2004: as l⁻²
and a little more). Under such skies the mean square of what a difference Δ of two lobes of equal flux reflects is

    E(Δ) = Σ Δlm²/(l (l + 1)) = ∫∫ Δ(ω) G(ω·ω') Δ(ω') dω dω',   G(cosγ) = Σ_{l ≥ 1} (2l + 1)/(4π l (l + 1)) Pl(cosγ),

G the Green's function of the sphere. A lobe that is turned by much less than its width is then nearly right, which the
plain square of Δ would not see. With the Legendre coefficients kl of the chain's kernels K (`rendering.sky_chain`)

    potential  φk(γ) = ∫ G K dω = Σ (2l + 1)/(4π l (l + 1)) kl Pl(cosγ),
    overlap    Qjk(γ) = Σ (2l + 1)/(4π l (l + 1)) jl kl Pl(cosγ)

are functions of one angle each. They are tabulated at γ = π (i/(POINTS − 1))².
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from homofact.linear.kernels import kernel
from homofact.rendering.sky_chain import alphas_of, lobe

POINTS = 1024
_NODES = 8000
_BANDS = 20  # times 1/α of the narrowest kernel, whose coefficients are nothing there


class Potentials(NamedTuple):
    """Of a chain's L kernels: `potential` (L, POINTS) φ, and `overlap` (L, L, POINTS) Q."""

    potential: np.ndarray
    overlap: np.ndarray


@lru_cache(maxsize=8)
def potentials(side: int) -> Potentials:
    """Those of the chain that begins with faces of so many texels."""
    alphas = alphas_of(side)
    gamma = (np.arange(_NODES) + 0.5) * (math.pi / 2 / _NODES)
    flux = np.stack([lobe(alpha, gamma) for alpha in alphas]) * np.sin(gamma)
    flux /= flux.sum(1, keepdims=True)
    x, y = np.cos(gamma), np.cos(_angles())
    before, now, seen_before, seen = np.ones_like(x), x, np.ones_like(y), y
    count = len(alphas)
    potential, overlap = np.zeros((count, POINTS)), np.zeros((count, count, POINTS))
    for band in range(1, math.ceil(_BANDS / alphas[0])):
        own = flux @ now
        gain = (2 * band + 1) / (4 * math.pi * band * (band + 1)) * seen
        potential += own[:, None] * gain
        overlap += (own[:, None] * own)[..., None] * gain
        before, now = now, ((2 * band + 1) * x * now - band * before) / (band + 1)
        seen_before, seen = seen, ((2 * band + 1) * y * seen - band * seen_before) / (band + 1)
    return Potentials(potential, overlap)


def _angles() -> np.ndarray:
    return math.pi * (np.arange(POINTS) / (POINTS - 1)) ** 2


@kernel(nogil=True, inline="always")
def _at(row, cosine):  # pragma: no cover (compiled)
    """A tabulated function at an angle given by its cosine."""
    place = math.sqrt(math.acos(min(max(cosine, -1.0), 1.0)) / math.pi) * (POINTS - 1)
    low = min(int(place), POINTS - 2)
    part = place - low
    return (1 - part) * row[low] + part * row[low + 1]


@kernel(nogil=True, inline="always")
def _between(table, level, cosine):  # pragma: no cover (compiled)
    """One that is tabulated for every level, linear between two."""
    low = max(min(int(level), len(table) - 2), 0)
    part = level - low
    return (1 - part) * _at(table[low], cosine) + part * _at(table[low + 1], cosine)


@kernel(nogil=True)
def pull_of(axis, level, wi, flux, potential):  # pragma: no cover (compiled)
    """∫∫ K G f cosθi of the kernel at a level round an axis (3,) and of the flux (M, C) from `wi` (M, 3): (C,)."""
    pull = np.zeros(flux.shape[1])
    for m in range(len(wi)):
        value = _between(potential, level, wi[m, 0] * axis[0] + wi[m, 1] * axis[1] + wi[m, 2] * axis[2])
        for channel in range(flux.shape[1]):
            pull[channel] += value * flux[m, channel]
    return pull


@kernel(nogil=True)
def energy(lobes, mirror, wi, flux, albedo, matte, potential, overlap):  # pragma: no cover (compiled)
    """(E less a constant, the best shares (K + 1, C)) of lobes (K, 2), level and tilt, and of the last level round n.

    The lobes stand round norm(r + tilt n), r the `mirror` direction; the material's own flux (M, C) comes from `wi`
    (M, 3), and is `albedo` (C,) in all; `matte` (C,) is its `pull` on the last level round n. The shares are ≥ 0 and
    add up to the albedo in every channel.
    """
    count, channels, last = len(lobes) + 1, flux.shape[1], len(potential) - 1.0
    axes, levels = np.empty((count, 3)), np.empty(count)
    for k in range(count - 1):
        z = mirror[2] + lobes[k, 1]
        length = math.sqrt(mirror[0] ** 2 + mirror[1] ** 2 + z * z)
        axes[k, 0], axes[k, 1], axes[k, 2] = mirror[0] / length, mirror[1] / length, z / length
        levels[k] = min(max(lobes[k, 0], 0.0), last)
    axes[-1, 0], axes[-1, 1], axes[-1, 2] = 0.0, 0.0, 1.0
    levels[-1] = last
    pull, between = np.zeros((count, channels)), np.empty((count, count))
    for k in range(count):
        pull[k] = pull_of(axes[k], levels[k], wi, flux, potential) if k < count - 1 else matte
        for j in range(k + 1):
            cosine = axes[j, 0] * axes[k, 0] + axes[j, 1] * axes[k, 1] + axes[j, 2] * axes[k, 2]
            low = max(min(int(levels[j]), len(potential) - 2), 0)
            part = levels[j] - low
            lower = (1 - part) * _between(overlap[low], levels[k], cosine)
            between[j, k] = between[k, j] = lower + part * _between(overlap[low + 1], levels[k], cosine)
    total, shares = 0.0, np.zeros((count, channels))
    for channel in range(channels):
        value, own = _shared(between, pull[:, channel], albedo[channel])
        total += value
        shares[:, channel] = own
    return total, shares


@kernel(nogil=True)
def _shared(between, pull, whole):  # pragma: no cover (compiled)
    """(the least w·Q w − 2 w·b over w ≥ 0 with the sum `whole`, w): the best of all sets of shares that are not 0."""
    count = len(pull)
    best, best_shares = math.inf, np.zeros(count)
    for chosen in range(1, 1 << count):
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
            system[i, i] += 1e-9 * between[place[i], place[i]]
            system[i, size] = system[size, i] = 1.0
            system[i, size + 1] = pull[place[i]]
        system[size, size + 1] = whole
        if not _eliminated(system):
            continue
        shares, value, allowed = np.zeros(count), 0.0, True
        for i in range(size):
            allowed = allowed and system[i, size + 1] >= 0
            shares[place[i]] = system[i, size + 1]
        if not allowed:
            continue
        for i in range(count):
            for j in range(count):
                value += shares[i] * between[i, j] * shares[j]
            value -= 2 * shares[i] * pull[i]
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
