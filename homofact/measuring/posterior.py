"""What samples tell of a material: its logarithms and colours at all nodes, and how uncertain they still are.

Kriging with the prior of `prior`: for samples y = B L + noise at each of the M centres

    Lᵢ = cᵢ + K Bᵀ (B K Bᵀ + N)⁻¹ (y − B cᵢ),   K' = K − K Bᵀ (B K Bᵀ + N)⁻¹ B K,

and the weights and scales of Student's t: pᵢ ∝ (1 + χᵢ²/ν)^−(ν+N)/2, K'ᵢ = (ν + χᵢ²)/(ν + N) K', with χᵢ² the squared
misfit before the samples were used. The ratios likewise with a single centre.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from homofact.measuring.prior import EPSILON, FREEDOM, BrdfPrior

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from homofact.brdf.samples import Samples

# Standard deviation of a sample's logarithm and ratios: noise, and what the grid cannot follow.
NOISE = 0.03
# A ratio above it is a channel in the noise of dark samples.
_MOST_RATIO = 3.0


@dataclass(frozen=True)
class BrdfPosterior:
    """What is known of a material at the n nodes.

    Attributes
    ----------
    shares : (M,) probabilities of the centres.
    centres : (M, n) means of L.
    scales : (M,) factors on `covariance`, by centre.
    covariance : (n, n) of L about each centre.
    ratios : (C, n) means of the ratios, their mean over the channels 1.
    colour_covariance : (n, n) of the ratios of each channel.
    """

    shares: np.ndarray
    centres: np.ndarray
    scales: np.ndarray
    covariance: np.ndarray
    ratios: np.ndarray
    colour_covariance: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """The mean of L (n,)."""
        return self.shares @ self.centres

    @property
    def scale(self) -> float:
        """The mean factor on `covariance`."""
        return float(self.shares @ self.scales)

    @cached_property
    def total(self) -> np.ndarray:
        """The covariance of L (n, n), that between the centres with it."""
        apart = np.sqrt(self.shares[:, None]) * (self.centres - self.mean)
        return self.scale * self.covariance + apart.T @ apart

    def values(self, matrix: "csr_matrix", logs: np.ndarray | None = None) -> np.ndarray:
        """f (N, C) in sr⁻¹ at the rows of a matrix of `HalfGrid.matrix`; for other logarithms where they are given."""
        level = np.exp(matrix @ (self.mean if logs is None else logs))
        return np.maximum((matrix @ self.ratios.T) * level[:, None] - EPSILON, 0)


def before_samples(prior: BrdfPrior, channels: int) -> BrdfPosterior:
    """Return what is known before the first sample."""
    count = len(prior.scores)
    return BrdfPosterior(
        np.full(count, 1 / count), prior.centres, np.ones(count), prior.covariance,
        np.ones((channels, prior.grid.size)), prior.colour_covariance,
    )  # fmt: skip


def after_samples(prior: BrdfPrior, samples: "Samples") -> BrdfPosterior:
    """Return what is known of a material by its samples."""
    matrix = prior.grid.matrix(samples.wi, samples.wo)
    return after_values(prior, matrix, samples.values.numpy())


def after_values(prior: BrdfPrior, matrix: "csr_matrix", values: np.ndarray) -> BrdfPosterior:
    """What is known by values (N, C) in sr⁻¹ at the rows of a matrix of `HalfGrid.matrix`; NOISE is added to them."""
    bright = values.mean(1)
    logs = np.log(bright + EPSILON)
    ratios = np.minimum((values + EPSILON) / (bright + EPSILON)[:, None], _MOST_RATIO)
    count = len(logs)
    gain, covariance, root = _kriged(prior.covariance, matrix)
    misfit = under(root, logs[:, None] - matrix @ prior.centres.T)
    chi = (misfit**2).sum(0)
    level = -0.5 * (FREEDOM + count) * np.log1p(chi / FREEDOM)
    shares = np.exp(level - level.max())
    colour_gain, colour_covariance, colour_root = _kriged(prior.colour_covariance, matrix)
    apart = under(colour_root, ratios - 1)
    tints = np.maximum(1 + (colour_gain.T @ apart).T, 0)
    # Of C ratios with a mean of 1, C − 1 are free.
    colour_chi = float((apart**2).sum()) / max(values.shape[1] - 1, 1)
    return BrdfPosterior(
        shares / shares.sum(),
        prior.centres + (gain.T @ misfit).T,
        (FREEDOM + chi) / (FREEDOM + count),
        covariance,
        tints / tints.mean(0).clip(1e-9),
        colour_covariance * (FREEDOM + colour_chi) / (FREEDOM + count),
    )


def _kriged(covariance: np.ndarray, matrix: "csr_matrix") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(R⁻¹ B K, K', R) with R the Cholesky root of B K Bᵀ + N."""
    across = np.asarray(matrix @ covariance)
    root = np.linalg.cholesky(np.asarray(matrix @ across.T) + NOISE**2 * np.eye(across.shape[0]))
    gain = under(root, across)
    return gain, covariance - gain.T @ gain, root


def under(root: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return R⁻¹ times a matrix, R lower triangular."""
    from scipy.linalg import solve_triangular

    return solve_triangular(root, right, lower=True, check_finite=False)
