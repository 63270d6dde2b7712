"""A mixture fitted to a reflectance: the lobes and weights from which light is drawn with the least noise.

With q = f cosθi/∫ f cosθi dωi, f the mean of the channels, the relative variance of the estimator f cosθi/p with one
direction is ∫ q²/p dωi − 1. The mixture minimises the mean over viewers, even over the hemisphere, of log ∫ q²/p, the
Rényi divergence of order 2 of q from p: a viewer whose light is hard to find does not outweigh all others. It is fitted
by L-BFGS over the logarithms of α and the weights' logits, the integrals on the nodes of `geometry.quadrature`.
"""

import math
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from homofact.brdf.reflectance import Reflectance
from homofact.brdf.symmetry import find_symmetry
from homofact.geometry.interpret import interpret
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.geometry.torch_functions import TORCH
from homofact.shading.lobe_mixture import LEAST, NARROWEST, NODES, WIDEST, LobeMixture, density_statements, parameters

LOBES = 2
_VIEWERS, _ANISOTROPIC_VIEWERS = (12, 1), (8, 5)  # levels, azimuths
_RINGS, _SPOKES = 24, 16
_STEPS = 60
_BATCH, _TOLERANCE = 1 << 17, 1e-6
_STARTS = (0.02, 0.1, 0.4)
# Grain that is turned by less than this many radians from the tangent is taken to lie along it.
_ALONG = math.radians(0.5)


def fitted_mixture(reflectance: Reflectance, lobes: int = LOBES) -> LobeMixture:
    """The mixture of at least one lobe for a reflectance, from 10⁴ evaluations of it (3·10⁴ if it is anisotropic).

    Of nothing, or nothing finite, the cosine alone: all weights 0. Raises nothing.
    """
    isotropic = find_symmetry(reflectance).isotropic
    wi, wo, angles, target = _targets(reflectance, isotropic)
    if not len(target):
        return LobeMixture(((WIDEST, WIDEST),) * lobes, ((0.0,) * NODES,) * lobes)
    turn = 0.0 if isotropic else _turn(wi, wo, target * angles)
    problem = _Problem(wi, wo, angles, target, lobes, isotropic, turn)
    # The integrals are dear next to the sums: a short run from every start, the best to its end.
    starts = [problem.solved(problem.start(narrow), _STEPS // 6) for narrow in _STARTS]
    best = min(starts, key=lambda solved: solved[1])[0]
    return problem.mixture(problem.solved(best, _STEPS)[0])


def viewers(levels: int, azimuths: int) -> Tensor:
    """Viewers (levels · azimuths, 3) float64: even in cosθo, each level turned against the one below."""
    z = (torch.arange(levels, dtype=torch.float64) + 0.5) / levels
    first = torch.arange(levels, dtype=torch.float64) * ((math.sqrt(5) - 1) / 2)
    phi = (first[:, None] + torch.arange(azimuths, dtype=torch.float64)) * (2 * math.pi / azimuths)
    z = z[:, None].expand_as(phi)
    radius = torch.sqrt(1 - z**2)
    return torch.stack((radius * torch.cos(phi), radius * torch.sin(phi), z), 2).reshape(-1, 3)


def _targets(reflectance: Reflectance, isotropic: bool) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """(ωi (V, M, 3), ωo (V, 3), solid angles (V, M), q (V, M)) of the viewers that see light."""
    wo = viewers(*(_VIEWERS if isotropic else _ANISOTROPIC_VIEWERS))
    wi, angles = hemisphere_nodes(wo, _RINGS, _SPOKES)
    pairs = wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3)
    parts = zip(*(directions.split(_BATCH) for directions in pairs), strict=True)
    values = torch.cat([reflectance.evaluate(*part).to(torch.float64).mean(1) for part in parts])
    target = values.reshape(angles.shape).clamp_min(0) * wi[..., 2]
    total = (target * angles).sum(1)
    seen = torch.isfinite(total) & (total > 0)
    return wi[seen], wo[seen], angles[seen], target[seen] / total[seen, None]


def _turn(wi: Tensor, wo: Tensor, light: Tensor) -> float:
    """About the azimuth of the wide axis of the half vectors' slopes, from second moments weighted by light (V, M)."""
    half = wi + wo[:, None]
    slope = half[..., :2] / half[..., 2:]
    # Tails would decide otherwise.
    near = light / (1 + (slope**2).sum(-1) / 0.05) ** 3
    xx, yy = ((near * slope[..., k] ** 2).sum() for k in (0, 1))
    xy = (near * slope[..., 0] * slope[..., 1]).sum()
    turn = 0.5 * math.atan2(2 * float(xy), float(xx - yy))
    return 0.0 if abs(math.sin(2 * turn)) < math.sin(2 * _ALONG) else turn


class _Problem:
    """The mean log ∫ q²/p and its slope over (log α of every lobe and axis, logits of the weights, the turn)."""

    def __init__(
        self, wi: Tensor, wo: Tensor, angles: Tensor, target: Tensor, lobes: int, isotropic: bool, turn: float
    ) -> None:
        self.shape = angles.shape
        self.pairs = wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3)
        self.squared = target**2 * angles
        self.lobes, self.axes = lobes, 1 if isotropic else 2
        # The turn is an unknown where there is one.
        self.turn = [turn] if turn else []
        self.statements = density_statements(lobes, bool(turn))

    def start(self, narrow: float) -> np.ndarray:
        """Lobes of roughness `narrow`, three times that, and so on, all weights alike."""
        alphas = [math.log(min(narrow * 3.0**k, 0.9 * WIDEST)) for k in range(self.lobes) for _ in range(self.axes)]
        return np.array([*alphas, *[0.0] * (self.lobes * NODES), *self.turn])

    def parts(self, x: Any) -> tuple[Any, Any]:
        """(alphas (K, 2), weights (K, NODES)) of the unknowns."""
        count = self.lobes * self.axes
        alphas = x[:count].exp().reshape(self.lobes, self.axes).expand(-1, 2)
        logits = x[count : count + self.lobes * NODES].reshape(self.lobes, NODES)
        return alphas, (1 - LEAST) * torch.softmax(torch.cat((logits, logits.new_zeros(1, NODES))), 0)[:-1]

    def value(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """The objective and its slope."""
        unknown = torch.tensor(x, dtype=torch.float64, requires_grad=True)
        alphas, weights = self.parts(unknown)
        turn = [number for angle in unknown[-1:] for number in (angle.cos(), angle.sin())] if self.turn else (1.0, 0.0)
        wi, wo = self.pairs
        given = {"wi": list(wi.unbind(1)), "wo": list(wo.unbind(1)), **parameters(alphas, weights, turn)}
        density = interpret(self.statements, given, TORCH)["density"][0].reshape(self.shape)
        mean = (self.squared / density.clamp_min(1e-300)).sum(1).log().mean()
        mean.backward()
        assert unknown.grad is not None
        return mean.item(), unknown.grad.numpy()

    def solved(self, x: np.ndarray, steps: int) -> tuple[np.ndarray, float]:
        """(the unknowns after so many steps of L-BFGS, the objective there)."""
        count = self.lobes * self.axes
        bounds = [(math.log(NARROWEST), math.log(WIDEST))] * count + [(-12.0, 12.0)] * (self.lobes * NODES)
        bounds += [(-10.0, 10.0)] * len(self.turn)
        minimum = minimize(
            self.value, x, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": steps, "ftol": _TOLERANCE}
        )
        return minimum.x, float(minimum.fun)

    def mixture(self, x: np.ndarray) -> LobeMixture:
        """The unknowns as a mixture, narrow lobes first."""
        alphas, weights = self.parts(torch.from_numpy(x))
        order = alphas.log().sum(1).argsort().tolist()
        # Seven digits, as the shaders print.
        alphas, weights = (tensor.to(torch.float32).to(torch.float64).tolist() for tensor in (alphas, weights))
        pairs = tuple((alphas[k][0], alphas[k][1]) for k in order)
        return LobeMixture(pairs, tuple(tuple(weights[k]) for k in order), float(x[-1]) if self.turn else 0.0)
