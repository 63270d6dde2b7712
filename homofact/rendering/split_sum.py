"""The reflection of a material, expressed by the levels of a sky's chain: a table over the viewer's angle.

    ∫ f cosθi L dωi ≈ Σk Sk(θo) P(mk, ℓk) + D(θo) E(n)/π,    mk = norm(rk + tk(θo) n),
    rk = 2 (hk·ωo) hk − (hk·hk) ωo,    hk = n + ak(θo) g,

P(m, ℓ) is the chain at the fractional level ℓk(θo), interpolated linearly between two levels. g is a direction in the
surface, across the grain of an anisotropic material. Half vectors spread along g, and rk is ωo mirrored at one of them.
For an isotropic material all ak are 0 and rk is the mirror direction. S and D are given per channel; the other
parameters are common to all channels. S and D add up to the albedo for every θo and channel, so the sum is exact under
uniform light. On homofact's own chain they are ≥ 0. On the chain of an engine they may be negative, to compensate for
the long tails of GGX, and the sum is clipped at 0. Engines themselves use one such lobe, round r, with a level that
does not depend on the angle (Karis 2013).

Levels, tilts, spreads and shares minimise E of `rendering.lobe_levels`, the mean square error under natural skies. For
given lobes the shares follow directly. Nelder and Mead's simplex searches the lobes at every θo, starting from those of
the neighbouring angle (`rendering.lobe_search`): once downwards from the normal and once upwards from the horizon. The
better of the two tables is kept. A small penalty on changes keeps lobes without a share from drifting. An anisotropic
material has three lobes: one in the middle, and two equal ones on both sides of it.

The approximation loses four things: the shape of lobes that are not round, as at grazing angles; effects of the
viewer's azimuth on an anisotropic material other than through g; detail narrower than the first level of the chain; and
the horizon, which cuts the true lobe.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.directions import from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.rendering.chain_kernels import ChainKernels
from homofact.rendering.lobe_levels import Potentials, potentials, pull_of
from homofact.rendering.lobe_search import Bounds, Seen, lobes_of, reflected, simplex, value_of
from homofact.rendering.surface import ToRgb, shader

COLUMNS, LOBES = 64, 2
GRAZING = math.radians(89.0)  # what stands for θo = 90°, where nothing is seen
_STEEP = 1e-4  # radians
_NODES = (64, 32)
_AZIMUTHS = 4  # of half a turn: the other half is alike where lobes are
_LEAST_TILT, _MOST_TILT, _MOST_SPREAD = -0.5, 2.0, 2.0
# Levels of the lobes at first, as parts of the last level.
_STARTS = {
    1: ((0.1,), (0.4,), (0.7,)),
    2: ((0.1, 0.4), (0.4, 0.7), (0.2, 0.8), (0.6, 0.9)),
    3: ((0.1, 0.3, 0.6), (0.3, 0.5, 0.8), (0.1, 0.5, 0.9), (0.6, 0.8, 0.9)),
}
_SPREADS = (0.1, 0.3)
# Steps of the search at first and from a neighbour, of each number.
_FIRST_STEPS, _STEPS = 62, 22
_SIMPLEX = (0.15, 0.03, 0.03)  # first steps of level, tilt and spread
_FAINT = 1e-4  # of the flux, which is left out


class Response(NamedTuple):
    """A material's table at even steps of cosθo from 0 to 1, for a chain with these `kernels`.

    `lobes` (COLUMNS, K, 3) are ℓk, tk and ak, and `shares` (COLUMNS, K + 1, C) are the Sk followed by D. `across` is
    the azimuth of g in radians, None for isotropic materials.
    """

    lobes: Tensor
    shares: Tensor
    kernels: ChainKernels
    across: float | None = None


def response_of(
    reflectance: Reflectance, kernels: ChainKernels, lobes: int = LOBES, to_rgb: ToRgb | None = None
) -> Response:
    """Compute the table of a material with `lobes` lobes, 1 to 3; anisotropic materials always have 3.

    Raises BadInput for channels that do not fit, and values that are not finite.
    """
    shade = shader(reflectance, to_rgb)
    isotropic = find_symmetry(reflectance).isotropic
    known = potentials(kernels)
    across = None if isotropic else widest_azimuth(shade)
    seen = [_seen(shade, min(math.acos(k / (COLUMNS - 1)), GRAZING), across, known) for k in range(COLUMNS)]
    layout = _Layout(lobes if isotropic else 3, not isotropic, bool(kernels.ggx))
    # Many azimuths take their time: once for those.
    orders = (range(COLUMNS)[::-1], range(COLUMNS))[: 1 + isotropic]
    tracks = [_tracked(seen, order, layout, known) for order in orders]
    _, places, shares = min(tracks, key=lambda track: track[0])
    return Response(torch.from_numpy(places), torch.from_numpy(shares), kernels, across)


def widest_azimuth(shade) -> float:
    """Return the azimuth in [0, π) of the axis along which light spreads widest for a viewer at the normal."""
    wo = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    wi, angles = hemisphere_nodes(wo, *_NODES)
    wi = wi.reshape(-1, 3)
    f = shade(wi, wo.expand_as(wi)).clamp_min(0).mean(1)
    flux = f * angles.reshape(-1) * wi[:, 2].clamp_min(0)
    x, y = wi[:, 0], wi[:, 1]
    # Half the direction of ∫ (x + i y)² dF.
    return math.atan2(float((2 * x * y * flux).sum()), float(((x * x - y * y) * flux).sum())) / 2 % math.pi


def _seen(shade, theta: float, across: float | None, known: Potentials) -> Seen:
    """What viewers at θo see; of what is isotropic one viewer."""
    turns = 1 if across is None else _AZIMUTHS
    turn = torch.arange(turns, dtype=torch.float64) * (math.pi / turns)
    # At the normal itself a viewer has no azimuth for the nodes to turn with.
    wo = from_spherical(torch.full_like(turn, theta if across is None else max(theta, _STEEP)), turn)
    wi, angles = hemisphere_nodes(wo, *_NODES)
    f = shade(wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3)).clamp_min(0)
    weight = angles * wi[..., 2].clamp_min(0)
    flux = f.reshape(*angles.shape, -1) * weight[..., None]
    # Nodes turn with the viewer.
    towards = wi[0]
    if across is None:
        # All that is asked of a node is its angle to directions in the plane of incidence: both sides of it are added.
        side = _NODES[1] // 2
        flux = flux.reshape(1, -1, _NODES[1], f.shape[-1])
        flux = (flux[:, :, :side] + flux[:, :, side:].flip(2)).reshape(1, -1, f.shape[-1])
        towards = towards.reshape(-1, _NODES[1], 3)[:, :side].reshape(-1, 3)
        grains = np.array([[1.0, 0.0, 0.0]])
    else:
        apart = across - turn.numpy()
        grains = np.stack((np.cos(apart), np.sin(apart), np.zeros(turns)), 1)
    albedo = flux.sum(1).mean(0).numpy()
    whole = flux.mean((0, 2))
    bright = whole > _FAINT * whole.sum() / len(whole)
    towards, flux = (each.contiguous().numpy() for each in (towards[bright], flux[:, bright]))
    up = np.array([0.0, 0.0, 1.0])
    matte = pull_of(up, len(known.potential) - 1.0, towards, np.ascontiguousarray(flux.mean(0)), known.potential)
    return Seen(theta, grains, towards, flux, np.stack((albedo, matte)))


@dataclass(frozen=True)
class _Layout:
    """The mapping of the searched numbers to `count` lobes: separate levels and tilts, or a middle lobe and a pair.

    If `signed`, shares may be negative.
    """

    count: int
    paired: bool
    signed: bool

    def starts(self, last: int) -> list[np.ndarray]:
        """Where the search begins, for a chain whose last level that is used is `last`."""
        if self.paired:
            return [
                np.array([low * last, 0.0, high * last, 0.0, spread]) for low, high in _STARTS[2] for spread in _SPREADS
            ]
        return [np.array([number for part in start for number in (part * last, 0.0)]) for start in _STARTS[self.count]]

    @property
    def kinds(self) -> tuple[int, ...]:
        """Return the kind of each searched number: 0 for a level, 1 for a tilt, 2 for a spread."""
        return (0, 1, 0, 1, 2) if self.paired else (0, 1) * self.count


def _tracked(
    seen: list[Seen], order: Iterable[int], layout: _Layout, known: Potentials
) -> tuple[float, np.ndarray, np.ndarray]:
    """(the sum of E over albedo², lobes (COLUMNS, K, 3), shares (COLUMNS, K + 1, C)), one viewer after another."""
    # The last level's few texels are too coarse for its kernel: of that the irradiance is left.
    last = len(known.potential) - 2
    kinds = np.array(layout.kinds)
    least, most = (np.array(each)[kinds] for each in ((0.0, _LEAST_TILT, 0.0), (last, _MOST_TILT, _MOST_SPREAD)))
    bounds = Bounds(least, most, np.array((1.0, 100.0, 100.0))[kinds], layout.paired, layout.signed)
    first = np.array(_SIMPLEX)[kinds]
    places = np.empty((len(seen), layout.count, 3))
    shares = np.empty((len(seen), layout.count + 1, seen[0].flux.shape[2]))
    total, x = 0.0, np.zeros(0)
    for k in order:
        # Of a black material nothing depends on it.
        scale = float((seen[k].whole[0] ** 2).sum()) * known.overlap[-1, -1, 0] or 1.0
        given = x, scale, seen[k], known, bounds
        if len(x) == 0:
            found = [simplex(start, first, _FIRST_STEPS * len(start), *given) for start in layout.starts(last)]
            x = min(found, key=lambda each, given=given: value_of(each, *given))
        else:
            x = simplex(x, first, _STEPS * len(x), *given)
        x = x.clip(least, most)
        places[k] = lobes_of(x, layout.paired)
        misfit, shares[k] = reflected(x, seen[k], known, bounds)
        total += misfit / scale
    return total, places, shares
