"""Estimate a material from samples: its logarithms and colours at all nodes, and their remaining uncertainty.

This is kriging with the prior of `prior`. For samples y = B L + noise, each of the M centres becomes

    Lᵢ = cᵢ + K Bᵀ (B K Bᵀ + N)⁻¹ (y − B cᵢ),   K' = K − K Bᵀ (B K Bᵀ + N)⁻¹ B K,

with weights and scales as for Student's t: pᵢ ∝ (1 + χᵢ²/ν)^−(ν+N)/2, K'ᵢ = (ν + χᵢ²)/(ν + N) K'. Here χᵢ² is the
squared misfit of the prior's centre, ν its degrees of freedom, and N in these two formulas the number of samples. The
ratios have a single centre and are updated in the same way.
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
    """The distribution of a material's values at the n nodes.

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
        """The covariance (n, n) of L, including the covariance between the centres."""
        apart = np.sqrt(self.shares[:, None]) * (self.centres - self.mean)
        return self.scale * self.covariance + apart.T @ apart

    def values(self, matrix: "csr_matrix", logs: np.ndarray | None = None) -> np.ndarray:
        """Return f (N, C) in sr⁻¹ at the rows of a `HalfGrid.matrix`, from the mean of L or from given `logs`."""
        level = np.exp(matrix @ (self.mean if logs is None else logs))
        return np.maximum((matrix @ self.ratios.T) * level[:, None] - EPSILON, 0)


def before_samples(prior: BrdfPrior, channels: int) -> BrdfPosterior:
    """Return the distribution before the first sample."""
    count = len(prior.scores)
    return BrdfPosterior(
        np.full(count, 1 / count), prior.centres, np.ones(count), prior.covariance,
        np.ones((channels, prior.grid.size)), prior.colour_covariance,
    )  # fmt: skip


def after_samples(prior: BrdfPrior, samples: "Samples") -> BrdfPosterior:
    """Return the distribution of a material given its samples."""
    matrix = prior.grid.matrix(samples.wi, samples.wo)
    return after_values(prior, matrix, samples.values.numpy())


def after_values(prior: BrdfPrior, matrix: "csr_matrix", values: np.ndarray) -> BrdfPosterior:
    """Return the distribution given values (N, C), in sr⁻¹ with noise NOISE, at rows of a `HalfGrid.matrix`."""
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
    """Return R⁻¹ times a matrix, where R is lower triangular."""
    from scipy.linalg import solve_triangular

    return solve_triangular(root, right, lower=True, check_finite=False)
