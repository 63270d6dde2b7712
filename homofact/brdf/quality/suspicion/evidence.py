"""The evidence that every check uses: a few thousand samples, and a smooth reciprocal BRDF fitted to their logarithms.

The fit is linear and assumes no material model: log f is a sum of hat functions of log θh, each times a low polynomial
of cosθd and of the squared tilt (cosθi − cosθo)², and of a few terms for the grazing edge and for retro-reflection. All
of these are the same for (ωi, ωo) and (ωo, ωi), and continuous on the sphere. For a real BRDF the residual of this fit
is a few per cent. It is far larger if the data violate reciprocity or smoothness. Each suspected fault adds columns to
the fit, and their coefficients measure its size. The solver is least squares reweighted for outliers (Cauchy).

Dark samples, whose logarithms are noisy, have the weight f²/(f² + (0.01 median)²); zeros have weight 0.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from homofact.brdf.samples import Samples

MOST_SAMPLES = 2500
LEAST_SAMPLES = 200
DARK = 1e-2
_KNOTS = 11
_NARROW = 0.003  # radians: θh finer than this is not told apart
_LEAST_COSINE = 1e-3
_RIDGE = 1e-4
_ROUNDS = 3
_CAUCHY = 3.0
_NORMAL_MAD = 1.4826


@dataclass(frozen=True)
class SmoothFit:
    """A fit of log f: `further` (K,) are the coefficients of the added columns, `residual` (N,), `scale` its MAD."""

    further: np.ndarray
    residual: np.ndarray
    scale: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """N samples as arrays: directions (N, 3), values (N, C), and `place` (N,) in the file, from −1 to 1."""

    wi: np.ndarray
    wo: np.ndarray
    values: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, samples: Samples, seed: int = 0) -> "Evidence":
        """Return at most `MOST_SAMPLES` of the samples, drawn by `seed`, in the order of the file."""
        order = torch.randperm(len(samples), generator=torch.Generator().manual_seed(seed))
        index = order[:MOST_SAMPLES].sort().values
        place = 2 * index.double() / max(len(samples) - 1, 1) - 1
        chosen = (samples.wi[index], samples.wo[index], samples.values[index], place)
        return cls(*(tensor.cpu().numpy() for tensor in chosen))

    def samples(self) -> Samples:
        """Return the evidence as isotropic `Samples`; their weights are `place` + 2, so it follows row selections."""
        wi, wo, values, place = (torch.from_numpy(array) for array in (self.wi, self.wo, self.values, self.place))
        channels = tuple(str(c) for c in range(values.shape[1]))
        return Samples(wi, wo, values, channels=channels, isotropic=True, weights=place + 2)

    def with_directions(self, wi: np.ndarray, wo: np.ndarray) -> "Evidence":
        """Return the same values at other directions (N, 3)."""
        return Evidence(wi, wo, self.values, self.place)

    def __len__(self) -> int:
        """N."""
        return len(self.values)

    @cached_property
    def brightness(self) -> np.ndarray:
        """The mean over the channels (N,)."""
        return self.values.mean(1)

    @cached_property
    def cosines(self) -> tuple[np.ndarray, np.ndarray]:
        """cosθi and cosθo (N,), kept off zero."""
        return np.maximum(self.wi[:, 2], _LEAST_COSINE), np.maximum(self.wo[:, 2], _LEAST_COSINE)

    @cached_property
    def half_angles(self) -> tuple[np.ndarray, np.ndarray]:
        """θh and θd in radians (N,)."""
        total, difference = self.wi + self.wo, self.wi - self.wo
        theta_h = np.arctan2(np.hypot(total[:, 0], total[:, 1]), total[:, 2])
        return theta_h, np.arctan2(np.linalg.norm(difference, axis=1), np.linalg.norm(total, axis=1))

    @cached_property
    def logs(self) -> tuple[np.ndarray, np.ndarray]:
        """(log of the brightness (N,), the weights (N,)); see the module docstring."""
        return logs_of(self.brightness)

    @cached_property
    def basis(self) -> np.ndarray:
        """The columns of the module's head (N, K)."""
        theta_h, theta_d = self.half_angles
        cos_i, cos_o = self.cosines
        along = along_highlight(theta_h)
        knots = np.unique(np.quantile(along, np.linspace(0, 1, _KNOTS)))
        c, tilt = 2 * np.cos(theta_d) - 1, (cos_i - cos_o) ** 2
        polynomials = np.stack([np.ones_like(c), c, c**2, c**3, tilt, tilt * c], 1)
        product = (hats(along, knots)[:, :, None] * polynomials[:, None, :]).reshape(len(c), -1)
        grazing, least = np.log(cos_i * cos_o), np.minimum(cos_i, cos_o)
        return np.column_stack([product, grazing, grazing**2, np.log1p((theta_d / 0.1) ** 2), least, least**2])

    def fitted(
        self, further: np.ndarray | None = None, logs: np.ndarray | None = None, weight: np.ndarray | None = None
    ) -> SmoothFit:
        """Fit the module's smooth model with `further` columns (N, K), and with other `logs` or weights if given."""
        own, dark = self.logs
        columns = self.basis if further is None else np.column_stack([self.basis, further])
        coefficients, residual, scale = robust_fit(
            columns, own if logs is None else logs, dark if weight is None else weight
        )
        return SmoothFit(coefficients[self.basis.shape[1] :], residual, scale)


def logs_of(brightness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (logarithms (N,), weights) as the module's head says."""
    lit = brightness > 0
    middle = np.median(brightness[lit]) if lit.any() else 1.0
    # Scaled first, so that squares of tiny and of huge values stay numbers.
    scaled = brightness / middle
    return np.where(lit, np.log(np.where(lit, brightness, 1.0)), 0.0), scaled**2 / (scaled**2 + DARK**2)


def along_highlight(theta_h: np.ndarray) -> np.ndarray:
    """Return log(θh + a small angle) (N,), in which knots resolve narrow and broad highlights alike; θh in radians."""
    return np.log(theta_h + _NARROW)


def hats(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Linear hat functions (N, K) on rising `knots`, constant beyond the ends; a column of ones for a single knot."""
    if len(knots) < 2:
        return np.ones((len(x), 1))
    inside = np.clip(x, knots[0], knots[-1])
    cell = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    part = (inside - knots[cell]) / (knots[cell + 1] - knots[cell])
    weights, row = np.zeros((len(x), len(knots))), np.arange(len(x))
    weights[row, cell] = 1 - part
    weights[row, cell + 1] += part
    return weights


def robust_fit(
    columns: np.ndarray, target: np.ndarray, weight: np.ndarray, ridge: float | np.ndarray = _RIDGE
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return (coefficients (K,), residuals (N,), their scale) of weighted least squares with Cauchy's weights.

    `ridge` is one number for all columns, in units of the RMS of each, or one number per column (K,).
    """
    size = np.sqrt((weight[:, None] * columns**2).sum(0) / max(weight.sum(), 1e-300)) + 1e-12
    scaled, now = columns / size, weight
    coefficients, residual, scale = np.zeros(columns.shape[1]), target, 1.0
    if not weight.sum() > 0:
        return coefficients, residual, scale
    for _ in range(_ROUNDS):
        normal = (scaled * now[:, None]).T @ scaled
        normal[np.diag_indices_from(normal)] += ridge * now.sum()
        coefficients = np.linalg.solve(normal, scaled.T @ (now * target))
        residual = target - scaled @ coefficients
        seen = np.abs(residual[weight > 0.1])
        scale = _NORMAL_MAD * float(np.median(seen)) + 1e-6 if len(seen) else 1.0
        now = weight / (1 + (residual / (_CAUCHY * scale)) ** 2)
    return coefficients / size, residual, scale
