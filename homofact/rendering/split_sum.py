"""What a material reflects, put on the levels of a sky's chain: its table over the viewer's angle.

    ∫ f cosθi L dωi ≈ Σk Sk(θo) P(mk, ℓk) + D(θo) E(n)/π,    mk = norm(r + tk(θo) n),    r = 2 (n·ωo) n − ωo,

P(m, ℓ) the chain at the fractional level ℓk(θo) (`rendering.sky_chain`); S and D are the shares of the channels, ℓk and
tk are common to them. S and D are ≥ 0 and add up to the albedo of every θo and channel: where light is the same from
everywhere, the sum is exact. Engines have one such lobe, round r, of a level that no angle changes (Karis 2013).

Levels, leans and shares make E of `rendering.lobe_levels` least, the mean square error under skies as they are: for
given ℓ and t the shares are known, ℓ and t are searched by Nelder and Mead's simplex at every θo from those of its
neighbour, once downwards from the normal and once upwards from the horizon; kept is what is better on the whole. A
small price on change keeps lobes that have no share from straying.

What is lost: lobes that are not round, as all are at grazing angles, those of brushed metals most, whose azimuth the
table does not know; what is narrower than the chain's first level; the horizon, which cuts the true lobe.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.lobe_levels import Potentials, energy, potentials, pull_of
from homofact.rendering.sky_chain import SIDE, check_side
from homofact.rendering.surface import ToRgb, shader

COLUMNS, LOBES = 64, 2
GRAZING = math.radians(89.0)  # what stands for θo = 90°, where nothing is seen
_NODES = (64, 32)
_AZIMUTHS = 8
_LEAST_TILT, _MOST_TILT = -0.5, 2.0
# Levels of the lobes at first, as parts of the last level.
_STARTS = {1: ((0.1,), (0.4,), (0.7,)), 2: ((0.1, 0.4), (0.4, 0.7), (0.2, 0.8), (0.6, 0.9))}
_SMOOTH = 1e-3
_FIRST_STEPS, _STEPS = 250, 90
_SIMPLEX = (0.15, 0.03)  # first steps of level and tilt
_CLOSE = 1e-3


class Response(NamedTuple):
    """A material's table at even steps of cosθo from 0 to 1, for the chain whose first faces have `side` texels.

    `lobes` (COLUMNS, K, 2) are ℓk and tk, `shares` (COLUMNS, K + 1, C) Sk and last D.
    """

    lobes: Tensor
    shares: Tensor
    side: int


class _Seen(NamedTuple):
    """What one viewer sees, as `energy` wants it: r (3,), ωi (M, 3), f cosθi dω (M, C), albedo and matte pull (C,)."""

    mirror: np.ndarray
    wi: np.ndarray
    flux: np.ndarray
    albedo: np.ndarray
    matte: np.ndarray


def response_of(
    reflectance: Reflectance, side: int = SIDE, lobes: int = LOBES, to_rgb: ToRgb | None = None
) -> Response:
    """The table of a material, of an anisotropic one the mean over the viewer's azimuths; `lobes` 1 or 2.

    Raises BadInput for channels that do not fit, values that are not finite and a side that no chain has.
    """
    check_side(side)
    shade = shader(reflectance, to_rgb)
    turns = 1 if find_symmetry(reflectance).isotropic else _AZIMUTHS
    known = potentials(side)
    seen = [_seen(shade, min(math.acos(k / (COLUMNS - 1)), GRAZING), turns, known) for k in range(COLUMNS)]
    tracks = [_tracked(seen, order, lobes, known) for order in (range(COLUMNS)[::-1], range(COLUMNS))]
    _, places, shares = min(tracks, key=lambda track: track[0])
    return Response(torch.from_numpy(places), torch.from_numpy(shares), side)


def _seen(shade, theta: float, turns: int, known: Potentials) -> _Seen:
    """What viewers at θo see: the mean of all azimuths, in the frame where the viewer is at azimuth 0."""
    turn = torch.arange(turns, dtype=torch.float64) * (2 * math.pi / turns)
    wo = from_spherical(torch.full_like(turn, theta), turn)
    wi, angles = hemisphere_nodes(wo, *_NODES)
    f = shade(wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3)).clamp_min(0)
    weight = angles * wi[..., 2].clamp_min(0)
    # Nodes turn with the viewer, and all that is asked of one is its angle to a direction in the plane of incidence:
    # flux of all azimuths and of both sides of the plane is added.
    flux = (f.reshape(*angles.shape, -1) * weight[..., None]).mean(0).reshape(-1, _NODES[1], f.shape[-1])
    side = _NODES[1] // 2
    flux = (flux[:, :side] + flux[:, side:].flip(1)).reshape(-1, f.shape[-1]).contiguous().numpy()
    towards = wi[0].reshape(-1, _NODES[1], 3)[:, :side].reshape(-1, 3).contiguous().numpy()
    mirror = np.array([-math.sin(theta), 0.0, math.cos(theta)])
    matte = pull_of(np.array([0.0, 0.0, 1.0]), len(known.potential) - 1.0, towards, flux, known.potential)
    return _Seen(mirror, towards, flux, flux.sum(0), matte)


def _tracked(
    seen: list[_Seen], order: Iterable[int], lobes: int, known: Potentials
) -> tuple[float, np.ndarray, np.ndarray]:
    """(the sum of E over albedo², lobes (COLUMNS, K, 2), shares (COLUMNS, K + 1, C)), one viewer after another."""
    # The last level's few texels are too coarse for its kernel: of that the irradiance is left.
    last = len(known.potential) - 2
    places = np.empty((len(seen), lobes, 2))
    shares = np.empty((len(seen), lobes + 1, seen[0].flux.shape[1]))
    total, x = 0.0, None
    for k in order:
        # Of a black material nothing depends on it.
        scale = float((seen[k].albedo ** 2).sum()) * known.overlap[-1, -1, 0] or 1.0

        def value(tried: np.ndarray, k: int = k, scale: float = scale, x: np.ndarray | None = x) -> float:
            misfit = energy(tried.reshape(-1, 2), *seen[k], *known)[0] / scale
            level, tilt = tried[::2], tried[1::2]
            beyond = np.abs(level - level.clip(0, last)).sum()
            beyond += np.abs(tilt - tilt.clip(_LEAST_TILT, _MOST_TILT)).sum()
            moved = 0.0 if x is None else ((level - x[::2]) ** 2 + 100 * (tilt - x[1::2]) ** 2).sum()
            return float(misfit + beyond + _SMOOTH * moved)

        x = _first(value, lobes, last) if x is None else _next(value, x)
        x = x.reshape(-1, 2).clip((0, _LEAST_TILT), (last, _MOST_TILT)).reshape(-1)
        places[k] = x.reshape(-1, 2)
        misfit, shares[k] = energy(places[k], *seen[k], *known)
        total += misfit / scale
    return total, places, shares


def _first(value, lobes: int, last: int) -> np.ndarray:
    """Levels and tilts (2 K,) from the best of some starts."""
    solutions = []
    for start in _STARTS[lobes]:
        x = np.array([number for part in start for number in (part * last, 0.0)])
        solutions.append(_simplex(value, x, _FIRST_STEPS))
    return min(solutions, key=value)


def _next(value, x: np.ndarray) -> np.ndarray:
    """Levels and tilts from those of the neighbour."""
    return _simplex(value, x, _STEPS)


def _simplex(value, x: np.ndarray, steps: int) -> np.ndarray:
    corners = np.vstack([x, x + np.diag(np.tile(_SIMPLEX, len(x) // 2))])
    options = {"maxfev": steps, "initial_simplex": corners, "xatol": _CLOSE, "fatol": 1e-7}
    return minimize(value, x, method="Nelder-Mead", options=options).x
