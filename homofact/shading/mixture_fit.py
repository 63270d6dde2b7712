"""Fit a mixture to a reflectance: the table with the least noise in importance sampling.

With q = f cosθi/∫ f cosθi dωi, f the mean of the channels, the relative variance of the estimator f cosθi/p with one
direction is ∫ q²/p dωi − 1. The fit minimises the mean over viewers of log ∫ q²/p, the Rényi divergence of order 2 of q
from p. Because of the logarithm, a viewer with high variance does not outweigh all others. If the integrals of the
table are 1, p is linear in the table, so ∫ q²/p is convex. L-BFGS over the logarithms of the table finds the minimum
from any start. It starts at q, averaged around each node. The integrals are midpoint sums over v and φ, whose cells
have the same edges as those of p. σ is the best of `_SCALES`; each is tried with a few steps.

The grain A of an anisotropic material is the matrix square root of the shape Σ of its lobe, scaled to determinant 1.
With half-vector slopes s, weighted by q², Σ solves Σ ∝ E[s sᵀ/(1 + sᵀΣ⁻¹s)], an estimator that is robust to tails
(Tyler 1987, Kent and Tyler 1991). The size of Σ is that of the lobe.

- Tyler 1987: a distribution-free M-estimator of multivariate scatter. Annals of Statistics 15.
- Kent and Tyler 1991: redescending M-estimates of multivariate location and scatter. Annals of Statistics 19.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.expression import Let, variable
from homofact.geometry.interpret import interpret
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.geometry.torch_functions import TORCH
from homofact.shading.lobe_coordinates import (
    PHIS,
    RADII,
    THETAS,
    found_statements,
    ray_statements,
    viewer_statements,
)
from homofact.shading.lobe_mixture import LEAST, ROUND, LobeMixture, halves

_SCALES = (3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)
# Viewers between two values of θo and their azimuths; nodes in φ on each side, and in v.
_LEVELS, _AZIMUTHS = {True: 3, False: 2}, {True: 1, False: 4}
_TURNS, _RADII = 18, 64
_TRIED, _STEPS, _TOLERANCE = 10, 160, 1e-7
_SHARE = -2.0  # logit of the cosine's share at the start
# Logarithms of numbers of which half floats have all digits.
_LOWEST, _HIGHEST = math.log(2**-14), math.log(2**14)
_BATCH = 1 << 17
# The longer axis of a grain over the shorter, below which it is none.
_ROUND = 1.05
_SHAPE_STEPS, _SHAPE_VIEWERS = 40, (6, 5)


def fitted_mixtures(reflectances: Sequence[Reflectance]) -> tuple[LobeMixture, ...]:
    """Fit the mixtures of layers; if one layer is anisotropic, all use the coordinates of anisotropic materials."""
    grained = not all(find_symmetry(each).isotropic for each in reflectances)
    return tuple(fitted_mixture(each, grained) for each in reflectances)


def fitted_mixture(reflectance: Reflectance, grained: bool = False) -> LobeMixture:
    """Fit the mixture of a reflectance with about 3·10⁵ evaluations of it (10⁶ if it is anisotropic).

    With `grained`, the coordinates are those of anisotropic materials for any reflectance. If the reflectance is zero
    or not finite, the density is cosine-weighted. The function raises no errors.
    """
    isotropic = find_symmetry(reflectance).isotropic
    grain = ROUND if isotropic else _grain(reflectance)
    grained = grained or grain != ROUND
    problems = [_Problem(reflectance, grain, grained, scale, isotropic) for scale in _SCALES]
    if not all(len(problem.target) for problem in problems):
        even = torch.ones(THETAS, PHIS, RADII, dtype=torch.float64)
        return LobeMixture(even, even[..., 0].clone(), even[:, 0, 0].clone(), 1.0, ROUND, grained)
    tried = [problem.solved(problem.start(), _TRIED) for problem in problems]
    best = min(range(len(_SCALES)), key=lambda k: tried[k][1])
    lobe, turns, cosine = problems[best].tables(torch.from_numpy(problems[best].solved(tried[best][0], _STEPS)[0]))
    return LobeMixture(halves(lobe), halves(turns), halves(cosine), _SCALES[best], grain, grained)


def viewers(heights: Tensor, azimuths: int) -> Tensor:
    """Return viewers (levels · azimuths, 3) in float64 at these cosθo; successive levels are rotated in azimuth."""
    z = heights.to(torch.float64)
    first = torch.arange(len(z), dtype=torch.float64) * ((math.sqrt(5) - 1) / 2)
    phi = (first[:, None] + torch.arange(azimuths, dtype=torch.float64)) * (2 * math.pi / azimuths)
    z = z[:, None].expand_as(phi)
    radius = torch.sqrt(1 - z**2)
    return torch.stack((radius * torch.cos(phi), radius * torch.sin(phi), z), 2).reshape(-1, 3)


def _heights(isotropic: bool) -> Tensor:
    """cosθo of the viewers: next to the normal, and evenly between the table's values of θo."""
    a = np.linspace(0, 1, 4001)
    count = (THETAS - 1) * _LEVELS[isotropic]
    middles = np.interp((np.arange(count) + 0.5) / count, (a + a**9) / 2, a)
    return 1 - torch.from_numpy(np.concatenate(([5e-3], middles))) ** 2


def _light(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    """f cosθi (V, M) ≥ 0 of directions (V, M, 3) for viewers (V, 3), f the mean of the channels."""
    pairs = wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3)
    parts = zip(*(directions.split(_BATCH) for directions in pairs), strict=True)
    values = torch.cat([reflectance.evaluate(*part).to(torch.float64).mean(1) for part in parts])
    return values.reshape(wi.shape[:2]).clamp_min(0) * wi[..., 2]


def _grain(reflectance: Reflectance) -> tuple[float, float, float]:
    """A (xx, xy, yy) of the module's head; the identity where the lobe is round or there is none."""
    wo = viewers((torch.arange(_SHAPE_VIEWERS[0]) + 1.5) / (_SHAPE_VIEWERS[0] + 1), _SHAPE_VIEWERS[1])
    wi, angles = hemisphere_nodes(wo, 24, 16)
    light = _light(reflectance, wi, wo) * angles
    whole = light.sum(1, keepdim=True)
    seen = (torch.isfinite(whole) & (whole > 0))[:, 0]
    half = wi[seen] + wo[seen][:, None]
    slopes = (half[..., :2] / half[..., 2:]).reshape(-1, 2)
    weights = ((light[seen] / whole[seen]).square() / angles[seen]).reshape(-1)
    if not len(weights):
        return ROUND
    shape = torch.eye(2, dtype=torch.float64) * 0.1
    for _ in range(_SHAPE_STEPS):
        far = ((slopes @ torch.linalg.inv(shape)) * slopes).sum(1)
        own = weights / (1 + far)
        shape = 3 * (slopes.T * own) @ slopes / weights.sum() + 1e-12 * torch.eye(2, dtype=torch.float64)
    lengths, axes = torch.linalg.eigh(shape)
    ratio = float((lengths[1] / lengths[0]).sqrt())
    if not ratio >= _ROUND:
        return ROUND
    grown = axes @ torch.diag((lengths / lengths.prod().sqrt()).sqrt()) @ axes.T
    # As the shaders print it; the determinant stays 1.
    xx, xy = float(np.float32(grown[0, 0])), float(np.float32(grown[0, 1]))
    return xx, xy, (1 + xy * xy) / xx


class _Problem:
    """The mean log ∫ q²/p and its slope over the logarithms of the table, for one σ."""

    def __init__(
        self,
        reflectance: Reflectance,
        grain: tuple[float, float, float],
        grained: bool,
        scale: float,
        isotropic: bool,
    ) -> None:
        wo = viewers(_heights(isotropic), _AZIMUTHS[isotropic])
        around = (torch.arange(_TURNS, dtype=torch.float64) + 0.5) * ((PHIS - 1) / _TURNS)
        share = (torch.arange(_RADII, dtype=torch.float64) + 0.5) / _RADII
        side = torch.tensor([-1.0, 1.0], dtype=torch.float64)
        values: dict[str, Any] = {
            "wo": list(wo[:, None, None, None].unbind(-1)),
            "side": [side[:, None, None]],
            "around": [around[:, None]],
            "share": [share],
            "scale": [torch.tensor(scale, dtype=torch.float64)],
            "grain": [*grain],
        }
        place = Let("place", variable("share", 1) * variable("limit", 1))
        interpret(
            [*viewer_statements(grained), *ray_statements(grained), place, *found_statements(grained)], values, TORCH
        )
        wi = torch.stack(torch.broadcast_tensors(*values["found"]), -1)
        shape = wi.shape[:-1]
        limit = torch.as_tensor(values["limit"][0], dtype=torch.float64).expand(*shape[:3], 1)[..., 0]
        # The measure of a node in v and φ; dω is that times the spread.
        step = limit[..., None] / RADII / _RADII * (math.pi / _TURNS)
        light = _light(reflectance, wi.reshape(len(wo), -1, 3), wo).reshape(shape) * values["spread"][0]
        whole = (light * step).sum((1, 2, 3), keepdim=True)
        seen = (torch.isfinite(whole) & (whole > 0)).reshape(-1)
        self.mean = (light * step)[seen] / whole[seen]
        self.target = light[seen].square() * step[seen] / whole[seen].square()
        self.cosine = (wi[..., 2] / math.pi * values["spread"][0])[seen]
        self.levels = _hats(values["level"][0].reshape(-1)[seen], THETAS)
        self.turns = _hats(around, PHIS)
        place = values["place"][0].expand(shape)[seen]
        self.cell = place.floor().clamp(0, RADII - 1).long()
        self.part = place - self.cell
        beyond = (limit[seen][..., None] - torch.arange(RADII + 1)).clamp(-1, 1)
        self.sums = 0.5 + beyond - beyond * beyond.abs() / 2

    def start(self) -> np.ndarray:
        """q at each node, averaged with the hats; its sums over v at each φ."""
        shape = (*self.mean.shape[:3], RADII + 1)
        radial = torch.zeros(shape, dtype=torch.float64)
        radial.scatter_add_(3, self.cell, self.mean * (1 - self.part)).scatter_add_(
            3, self.cell + 1, self.mean * self.part
        )
        radial = radial[..., 1:].sum(1)
        lobe = torch.einsum("av,amt,mp->vpt", self.levels, radial, self.turns)
        turns = lobe.sum(2) / self.turns.sum(0)
        lobe = lobe / lobe.amax(2, keepdim=True).clamp_min(1e-300)
        turns = turns / turns.amax(1, keepdim=True).clamp_min(1e-300)
        parts = (
            lobe.clamp_min(1e-4).log().ravel(),
            turns.clamp_min(1e-4).log().ravel(),
            lobe.new_full((THETAS,), _SHARE),
        )
        return torch.cat(parts).numpy()

    def tables(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """g (THETAS, PHIS, RADII), m (THETAS, PHIS) and c (THETAS,) of the unknowns."""
        lobe, turns, cosine = x.split([THETAS * PHIS * RADII, THETAS * PHIS, THETAS])
        lobe, turns = (each.clamp(_LOWEST, _HIGHEST).exp() for each in (lobe, turns))
        cosine = LEAST + (1 - LEAST) * torch.sigmoid(cosine)
        return lobe.reshape(THETAS, PHIS, RADII), turns.reshape(THETAS, PHIS), cosine

    def value(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """The objective and its slope."""
        unknown = torch.tensor(x, requires_grad=True)
        lobe, turns, cosine = self.tables(unknown)
        mixed = (self.levels @ lobe.reshape(THETAS, -1)).reshape(-1, PHIS, RADII)
        # Rows of each viewer and φ, the node of value 0 in front.
        rows = torch.nn.functional.pad(self.turns @ mixed, (1, 0))
        wide = rows[:, None].expand(-1, 2, -1, -1)
        value = wide.gather(3, self.cell) * (1 - self.part) + wide.gather(3, self.cell + 1) * self.part
        whole = (wide * self.sums).sum(3, keepdim=True)
        share = self.levels @ turns
        total = share.sum(1) - (share[:, 0] + share[:, -1]) / 2
        share = (share @ self.turns.T / total[:, None])[:, None, :, None]
        cosine = (self.levels @ cosine)[:, None, None, None]
        gain = (1 - cosine) * (RADII * (PHIS - 1) / (2 * math.pi))
        density = cosine * self.cosine + gain * share * value / whole
        mean = (self.target / density).sum((1, 2, 3)).log().mean()
        mean.backward()
        assert unknown.grad is not None
        return mean.item(), unknown.grad.numpy()

    def solved(self, x: np.ndarray, steps: int) -> tuple[np.ndarray, float]:
        """(the unknowns after so many steps of L-BFGS, the objective there)."""
        bounds = [(_LOWEST, _HIGHEST)] * len(x)
        options = {"maxiter": steps, "ftol": _TOLERANCE}
        minimum = minimize(self.value, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        return minimum.x, float(minimum.fun)


def _hats(places: Tensor, count: int) -> Tensor:
    """The shares (N, count) of even nodes 0, 1, … in what is linear between them."""
    return (1 - (places[:, None] - torch.arange(count, dtype=torch.float64)).abs()).clamp_min(0)
