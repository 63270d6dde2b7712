"""Fit GGX lobes over a diffuse base to samples; `analytic.nonlinear` defines the objective.

The fit solves for unconstrained numbers: colours are their squares, α is an exponential and F0 a logistic function of
them. With b = F g the lobe of one colour (`analytic.ggx`), g = D G/(4 cosθi cosθo) and a = log α,

    ∂ log g/∂a = 2 − 4 α² cos²θh/(cos²θh (α² − 1) + 1) − (∂m/∂a)/m

with the masking m = cosθo √(cos²θi (1 − α²) + α²) + cosθi √(cos²θo (1 − α²) + α²), so derivatives are cheap to compute.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from homofact.brdf.analytic.common import MIN_COSINE
from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe
from homofact.brdf.analytic.nonlinear import CubeRoots, least
from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.linear.arrays import as_array

# Half widths of highlights in radians, from a mirror's to a rough paint's: every choice of them is a start.
WIDTHS = (0.03, 0.1, 0.3)
_LEAST, _MOST = 1e-4, 3.0


def fit_ggx(samples: Samples, lobes: int, seed: int, least_reflectance: float = 0.0) -> tuple[GgxBrdf, Report]:
    """Return (a diffuse base with `lobes` GGX lobes of F0 ≥ `least_reflectance`, the report of the fit)."""
    data = CubeRoots.of(samples, seed)
    sum_of_lobes = _Lobes.at(data.samples, lobes, least_reflectance)
    floor, root, target = data.floor, as_array(data.root), as_array(data.target)
    cosine = as_array(data.samples.wi[:, 2:])

    def residuals(x: np.ndarray) -> np.ndarray:
        return (root * (np.cbrt(sum_of_lobes.values(x) * cosine + floor) - target)).reshape(-1)

    def slopes(x: np.ndarray) -> np.ndarray:
        values, own = sum_of_lobes.values(x), sum_of_lobes.slopes(x)
        outer = root * cosine / (3 * np.cbrt(values * cosine + floor) ** 2)
        return (outer[..., None] * own).reshape(-1, len(x))

    x, report = least(residuals, slopes, starts(samples, [math.log(width) for width in WIDTHS], lobes, own=True), seed)
    channels = len(samples.channels)
    found = tuple(
        GgxLobe(colour(part[:channels]), _bounded(part[channels]), sum_of_lobes.reflectance(part)[0])
        for part in x[channels:].reshape(lobes, channels + 2)
    )
    return GgxBrdf(colour(x[:channels]), found, channels=samples.channels), report


@dataclass(frozen=True)
class _Lobes:
    """A diffuse base and lobes at pairs, by what of the pairs their values need (N,); `p` is (1 − cosθd)⁵.

    F0 is at least `least`.
    """

    lobes: int
    channels: int
    least: float
    p: np.ndarray
    ni: np.ndarray
    no: np.ndarray
    nh2: np.ndarray

    @classmethod
    def at(cls, samples: Samples, lobes: int, least: float = 0.0) -> "_Lobes":
        """At the pairs of samples."""
        wi, wo = as_array(samples.wi), as_array(samples.wo)
        middle = wi + wo
        square = np.maximum((middle**2).sum(1), MIN_COSINE**2)
        p = np.clip(1 - np.sqrt(square) / 2, 0, None) ** 5
        ni, no = (np.maximum(w[:, 2], MIN_COSINE) for w in (wi, wo))
        return cls(lobes, len(samples.channels), least, p, ni, no, middle[:, 2] ** 2 / square)

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values (N, C)."""
        total = np.broadcast_to(x[: self.channels] ** 2 / math.pi, (len(self.p), self.channels))
        for part in self._parts(x):
            total = total + self._lobe(part)[0][:, None] * part[: self.channels] ** 2
        return total

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """∂ values/∂x (N, C, P)."""
        count, own = self.channels, np.arange(self.channels)
        found = np.zeros((len(self.p), count, len(x)))
        found[:, own, own] = 2 * x[:count] / math.pi
        for number, part in enumerate(self._parts(x)):
            first = count + number * (count + 2)
            value, by_width, by_reflectance = self._lobe(part)
            found[:, own, first + own] = 2 * part[:count] * value[:, None]
            found[:, :, first + count] = by_width[:, None] * part[:count] ** 2
            found[:, :, first + count + 1] = by_reflectance[:, None] * part[:count] ** 2
        return found

    def reflectance(self, part: np.ndarray) -> tuple[float, float]:
        """(F0 of a lobe, its slope with the logistic function's argument)."""
        share = _logistic(part[self.channels + 1])
        return self.least + (1 - self.least) * share, (1 - self.least) * share * (1 - share)

    def _parts(self, x: np.ndarray) -> np.ndarray:
        return x[self.channels :].reshape(self.lobes, self.channels + 2)

    def _lobe(self, part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(the lobe of the colour 1, its slope with log α, its slope with the logistic function's argument)."""
        alpha, (f0, by_argument) = _bounded(part[self.channels]), self.reflectance(part)
        squared = alpha**2
        spread = self.nh2 * (squared - 1) + 1
        roots = [np.sqrt(n**2 * (1 - squared) + squared) for n in (self.ni, self.no)]
        masked = self.no * roots[0] + self.ni * roots[1]
        # Each is (∂m/∂a) of one direction.
        moved = squared * (self.no * (1 - self.ni**2) / roots[0] + self.ni * (1 - self.no**2) / roots[1])
        facets = squared / (2 * math.pi * spread**2 * masked)
        fresnel = f0 + (1 - f0) * self.p
        inside = _LEAST < alpha < _MOST
        by_width = fresnel * facets * (2 - 4 * squared * self.nh2 / spread - moved / masked) * inside
        return fresnel * facets, by_width, by_argument * (1 - self.p) * facets


def starts(samples: Samples, shapes: Sequence[float], lobes: int, own: bool) -> list[np.ndarray]:
    """Return start parameters (P,) per choice of `shapes`: base of half the median of f, ks = .1, F0 = .05.

    If `own` is set, each lobe has its own F0, stored after its shape. Otherwise all lobes share one F0, stored after
    the base.
    """
    median = np.quantile(as_array(samples.values), 0.5, axis=0, method="lower")
    base = np.sqrt(0.5 * math.pi * np.maximum(median, 1e-6))
    colours, f0 = np.full_like(base, math.sqrt(0.1)), np.array([math.log(0.05 / 0.95)])
    chosen = (
        combinations(shapes, lobes)
        if lobes <= len(shapes)
        else [tuple(shapes[k % len(shapes)] + 0.1 * (k // len(shapes)) for k in range(lobes))]
    )
    found = []
    for some in chosen:
        parts = [np.concatenate((colours, [shape], *([f0] if own else []))) for shape in some]
        found.append(np.concatenate((base, *([] if own else [f0]), *parts)))
    return found


def colour(x: np.ndarray) -> tuple[float, ...]:
    """Return the colour (C,) for its unconstrained numbers `x`: their squares."""
    return tuple((x**2).tolist())


def _bounded(x: float) -> float:
    """Return α of its free number."""
    return math.exp(min(max(x, math.log(_LEAST)), math.log(_MOST)))


def _logistic(x: float) -> float:
    """Return 1/(1 + exp(−x)), without overflow."""
    return 0.5 * (1 + math.tanh(0.5 * x))
