"""The response of a material to smooth light, given by Zernike's polynomials on the projected hemisphere.

A direction ω = (x, y, z) of the hemisphere lies at (x, y) on the unit disc, and dx dy = cosθ dω: an integral of
radiance against a cosine is one over the disc. On it Zernike's polynomials (1934) are orthonormal,

    Z_nm = √((2 − δ_m0)(n + 1)/π) R_nm(r) cos mφ  or  sin mφ,    n − m even, n ≤ order,

so that incident light has the coefficients c_j = ∫ L(ωi) Z_j cosθi dωi. Its smooth part Σ c_j Z_j sends Σ c_j h_j(ωo)
to a viewer, h_j(ωo) = ∫ f(ωi, ωo) Z_j(ωi) cosθi dωi. For a matt material only h_0 is not 0: it is a(ωo)/√π, with a the
albedo.
"""

import math

import numpy as np
import torch

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes
from homofact.relighting.factors import texel_points

_RADII, _AZIMUTHS, _LEVELS = 24, 16, 12
_RINGS, _SPOKES = 64, 48
# Nodes over half vectors end at the horizon itself.
_STEEPEST = math.radians(89.0)


def modes(order: int) -> list[tuple[int, int]]:
    """(n, m) of the polynomials up to an order, m below 0 for sines; the constant first."""
    return [(n, m) for n in range(order + 1) for m in range(-n, n + 1, 2)]


def zernike(w: np.ndarray, order: int) -> np.ndarray:
    """Z (J, N) of directions (N, 3) of the upper hemisphere, in the order of `modes`."""
    r, phi = np.hypot(w[:, 0], w[:, 1]).clip(0, 1), np.arctan2(w[:, 1], w[:, 0])
    return np.stack([_radial(n, abs(m), r) * _turned(m, phi) for n, m in modes(order)])


def mean_albedo(reflectance: Reflectance) -> np.ndarray:
    """Return the share (C,) of uniform light that is reflected into all directions: ∫∫ f cosθi dωi cosθo dωo/π."""
    theta, weights = disc_nodes(_LEVELS)
    found = np.real(_responses(reflectance, theta.numpy(), 0)[:, :, 0]) * math.sqrt(math.pi)
    return (found.mean(1) * weights.numpy()[:, None]).sum(0)


def smooth_response(reflectance: Reflectance, order: int, size: int) -> np.ndarray:
    """Return h (J, M, M, C) float32 on parabolic maps of `size` texels; beyond the rim, the value of the rim."""
    values = _responses(reflectance, np.minimum(2 * np.arctan(np.linspace(0, 1, _RADII)), _STEEPEST), order)
    azimuths = values.shape[1]
    u, v = texel_points(size).numpy().transpose(2, 0, 1)
    phi = np.arctan2(v, u)
    ring, turn = np.clip(np.hypot(u, v), 0, 1) * (_RADII - 1), phi / (2 * math.pi) % 1 * azimuths
    i, k = np.minimum(ring.astype(int), _RADII - 2), turn.astype(int) % azimuths
    a, b = (ring - i)[..., None, None], (turn - np.floor(turn))[..., None, None]
    one, other = (values[i, at] * (1 - a) + values[i + 1, at] * a for at in (k, (k + 1) % azimuths))
    found = one * (1 - b) + other * b
    # The polynomial's own turn with the viewer's azimuth, taken off before and put back here.
    parts = [found[:, :, j] * np.exp(1j * abs(m) * phi)[..., None] for j, (_, m) in enumerate(modes(order))]
    return np.stack([p.imag if m < 0 else p.real for p, (_, m) in zip(parts, modes(order), strict=True)]).astype(
        np.float32
    )


def _responses(reflectance: Reflectance, theta: np.ndarray, order: int) -> np.ndarray:
    """Return ∫ f |Z| exp(i m (φi − φo)) cosθi dωi (A, Q, J, C) for views at θo `theta` (A,) and Q azimuths."""
    azimuths = 1 if find_symmetry(reflectance).isotropic else _AZIMUTHS
    columns, angles = [], torch.from_numpy(theta)
    for k in range(azimuths):
        phi = 2 * math.pi * k / azimuths
        wo = from_spherical(angles, torch.full_like(angles, phi))
        rows = []
        for view in wo:
            wi, solid = (each[0] for each in hemisphere_nodes(view[None], _RINGS, _SPOKES))
            f = reflectance.evaluate(wi, view.expand_as(wi)).double().numpy()
            flux = f * (solid * wi[:, 2]).numpy()[:, None]
            x, y = wi[:, 0].numpy(), wi[:, 1].numpy()
            r, turn = np.hypot(x, y).clip(0, 1), np.arctan2(y, x) - phi
            rows.append(np.stack([_radial(n, abs(m), r) * np.exp(1j * abs(m) * turn) @ flux for n, m in modes(order)]))
        columns.append(np.stack(rows))
    return np.stack(columns, 1)


def _radial(n: int, m: int, r: np.ndarray) -> np.ndarray:
    """Return the normalized radial Zernike polynomial √((2 − δ_m0)(n + 1)/π) R_nm(r)."""
    total = np.zeros_like(r)
    for k in range((n - m) // 2 + 1):
        top = (-1) ** k * math.factorial(n - k)
        below = math.factorial(k) * math.factorial((n + m) // 2 - k) * math.factorial((n - m) // 2 - k)
        total += top / below * r ** (n - 2 * k)
    return math.sqrt((1 if m == 0 else 2) * (n + 1) / math.pi) * total


def _turned(m: int, phi: np.ndarray) -> np.ndarray:
    return np.sin(-m * phi) if m < 0 else np.cos(m * phi)
