"""Define the quantities to measure for: pictures of a sphere, albedo and highlight, as integrals of f.

* pictures: a sphere of `PIXELS`² pixels under lamps at `LAMPS` degrees from the viewer, and `PLACES` normals of a
  sphere under the sky of `rendering.fixed_lights`. Errors are differences of displayed values, as in
  `evaluation.appearance`. The 99th percentile sets the exposure of a lamp's picture, which uses the sRGB curve. The
  median sets the exposure of the sky's picture, which uses the filmic curve.
* albedo: the light reflected at the incidences of `DEGREES`.
* highlight: the part of the albedo whose half vectors lie within `HIGHLIGHT` degrees of the normal.

The displayed or relative error of each quantity is linear in small errors δ of the logarithms L: e = J δ. If L has the
covariance Σ, the expected squared error is tr(W Σ), where W is the mean of Jᵀ J over probable materials.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import torch

from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import from_cosine, from_spherical
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.measuring.half_grid import HalfGrid
from homofact.measuring.posterior import BrdfPosterior
from homofact.measuring.prior import EPSILON
from homofact.rendering.fixed_lights import sky
from homofact.rendering.surface import seen_surface, sphere_frames
from homofact.rendering.tonemap import MIDDLE, PERCENTILE, TARGET

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix
    from torch import Tensor

LAMPS = (15.0, 45.0, 75.0, 105.0)
PIXELS, PLACES = 24, 40
DEGREES = (5.0, 20.0, 40.0, 60.0, 75.0)
HIGHLIGHT = 6.0
# How much the mean relative variance of each counts, pictures 1.
ALBEDO_WEIGHT, HIGHLIGHT_WEIGHT = 0.35, 0.15
# Guesses of the material that W is a mean over: the mean, and the most probable centres.
_GUESSES = 6
_SKY_NODES, _ALBEDO_NODES = (10, 6), (24, 12)
_VIEW = (0.0, 0.0, 1.0)
# Darker pixels count as one of this displayed linear value: the slope of the curve has no bound.
_DARK = 3e-3


@dataclass(frozen=True)
class Aim:
    """Q integrals of the values at the pairs `part` of `MeasuringAims`; the matrix `sums` (Q, pairs) computes them.

    `kind` is "lamp", "sky", "albedo" or "highlight".
    """

    kind: str
    part: slice
    sums: "csr_matrix"

    def exposure(self, light: np.ndarray) -> float:
        """Return the exposure, the factor before the tone curve, of a picture with the radiance `light` (Q,)."""
        if self.kind == "lamp":
            return TARGET / max(float(np.percentile(light, PERCENTILE)), 1e-12)
        return MIDDLE / max(float(np.median(light)), 1e-12)

    def displayed(self, light: np.ndarray, exposure: float) -> np.ndarray:
        """Return the displayed values of radiances."""
        return _srgb(light * exposure if self.kind == "lamp" else _filmic(light * exposure))

    def slope(self, light: np.ndarray) -> np.ndarray:
        """Return the derivative of the error by `light` (Q,): the slope of the tone curve, or 1/light."""
        if self.kind in ("albedo", "highlight"):
            return 1 / np.maximum(light, 1e-12)
        exposure, step = self.exposure(light), 1e-4
        level = np.maximum(light, _DARK / exposure)
        above, below = (self.displayed(level + sign * step / exposure, exposure) for sign in (1, -1))
        return (above - below) / (2 * step) * exposure


@dataclass(frozen=True)
class MeasuringAims:
    """The pairs of directions (P, 3) of all aims and their integrals; `matrix` (P, n) interpolates nodes to pairs."""

    matrix: "csr_matrix"
    wi: "Tensor"
    wo: "Tensor"
    aims: tuple[Aim, ...]

    def light(self, values: np.ndarray) -> dict[str, list[np.ndarray]]:
        """Return the integrals (Q, C) of values (P, C), by kind."""
        found: dict[str, list[np.ndarray]] = {}
        for aim in self.aims:
            found.setdefault(aim.kind, []).append(np.asarray(aim.sums @ values[aim.part]))
        return found

    def weights(self, posterior: BrdfPosterior) -> np.ndarray:
        """Return W (n, n), each kind divided by its variance: tr(W Σ) = 1 + ALBEDO_WEIGHT + HIGHLIGHT_WEIGHT."""
        order = np.argsort(-posterior.shares, kind="stable")[:_GUESSES]
        guesses = [posterior.mean, *posterior.centres[order]]
        parts = np.array([1.0, *posterior.shares[order]])
        count = len(posterior.mean)
        found = {kind: np.zeros((count, count)) for kind in ("picture", "albedo", "highlight")}
        for logs, share in zip(guesses, parts / parts.sum(), strict=True):
            for aim, rows in self.slopes(logs):
                kind = aim.kind if aim.kind in found else "picture"
                found[kind] += (rows.T @ rows).toarray() * (share / (rows.shape or (1, 1))[0])
        weights = {"picture": 1.0, "albedo": ALBEDO_WEIGHT, "highlight": HIGHLIGHT_WEIGHT}
        total = posterior.total
        return sum(
            (weights[kind] / max(float((each * total).sum()), 1e-300) * each for kind, each in found.items()),
            np.zeros((count, count)),
        )

    def slopes(self, logs: np.ndarray, *, of_light: bool = False) -> list[tuple[Aim, "csr_matrix"]]:
        """Return J (Q, n) of each aim at L (n,); `of_light`: of its radiance before the tone curve."""
        from scipy.sparse import csr_matrix, diags

        level = np.exp(self.matrix @ logs)
        found = []
        for aim in self.aims:
            own = level[aim.part]
            light = np.asarray(aim.sums @ np.maximum(own - EPSILON, 0))
            scale = np.ones_like(light) if of_light else aim.slope(light)
            found.append((aim, csr_matrix(diags(scale) @ aim.sums @ diags(own) @ self.matrix[aim.part])))
        return found


@lru_cache(maxsize=2)
def measuring_aims(grid: HalfGrid) -> MeasuringAims:
    """Return the aims on a grid."""
    parts = [*_lamps(), _under_sky(), *_reflected()]
    wi, wo = torch.cat([part[1] for part in parts]), torch.cat([part[2] for part in parts])
    aims, start = [], 0
    for kind, lights, _, sums in parts:
        aims.append(Aim(kind, slice(start, start + len(lights)), sums))
        start += len(lights)
    return MeasuringAims(grid.matrix(wi, wo), wi, wo, tuple(aims))


_Part = tuple[str, "Tensor", "Tensor", "csr_matrix"]


def _lamps() -> list[_Part]:
    from scipy.sparse import csr_matrix

    _, surface = seen_surface(PIXELS, _VIEW)
    found: list[_Part] = []
    for degrees in LAMPS:
        away = math.sin(math.radians(degrees)) / math.sqrt(2)
        lamp = torch.tensor([away, away, math.cos(math.radians(degrees))], dtype=torch.float64)
        wi = surface.frame @ lamp
        lit = (wi[:, 2] > 0).nonzero()[:, 0]
        wi = wi[lit]
        cosine = (math.pi * wi[:, 2]).numpy()
        shape = (len(surface.wo), len(wi))
        found.append(
            ("lamp", wi, surface.wo[lit], csr_matrix((cosine, (lit.numpy(), np.arange(len(wi)))), shape=shape))
        )
    return found


def _under_sky() -> _Part:
    number = torch.arange(PLACES, dtype=torch.float64)
    normal = from_cosine((1 - (number + 0.5) / PLACES).sqrt(), number * (math.pi * (3 - math.sqrt(5))))
    frames, wo = sphere_frames(normal, torch.tensor(_VIEW, dtype=torch.float64))
    wi, solid = hemisphere_nodes(wo, *_SKY_NODES)
    weight = sky(wi @ frames) * solid * wi[..., 2]
    return "sky", wi.reshape(-1, 3), wo[:, None].expand_as(wi).reshape(-1, 3), _summed(weight)


def _reflected() -> list[_Part]:
    theta = torch.tensor(DEGREES, dtype=torch.float64).deg2rad()
    fixed = from_spherical(theta, torch.zeros_like(theta))
    wo, solid = hemisphere_nodes(fixed, *_ALBEDO_NODES)
    weight = solid * wo[..., 2]
    wi, wo = fixed[:, None].expand_as(wo).reshape(-1, 3), wo.reshape(-1, 3)
    near = rusinkiewicz_angles(wi, wo)[0].reshape(weight.shape) <= math.radians(HIGHLIGHT)
    return [("albedo", wi, wo, _summed(weight)), ("highlight", wi, wo, _summed(weight * near))]


def _summed(weight: "Tensor") -> "csr_matrix":
    """The matrix (Q, Q · M) that sums M values each, weighted by (Q, M)."""
    from scipy.sparse import csr_matrix

    count, each = weight.shape
    rows = np.repeat(np.arange(count), each)
    return csr_matrix((weight.numpy().reshape(-1), (rows, np.arange(count * each))), shape=(count, count * each))


def _srgb(linear: np.ndarray) -> np.ndarray:
    linear = linear.clip(0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _filmic(linear: np.ndarray) -> np.ndarray:
    x = linear.clip(0)
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
