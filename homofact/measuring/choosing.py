"""Choose measurements one by one. Each choice lowers the expected error of the aims most.

For Gaussian variables with covariance Σ, a measurement b (a row of B, noise variance N) lowers tr(W Σ) by (wᵀ W w)/(bᵀ
Σ b + N), where w = Σ b. The choice minimises this trace (V-optimal design) and does not depend on the measured values.
The same measurement gives the ratios of the channels, and their trace counts equally.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from homofact.measuring.posterior import NOISE, BrdfPosterior, under

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


@dataclass
class Uncertainty:
    """A covariance Σ (n, n), the weights W (n, n) of its cost tr(W Σ), and the noise variance of a measurement."""

    covariance: np.ndarray
    weights: np.ndarray
    noise: float

    def after(self, matrix: "csr_matrix") -> "Uncertainty":
        """Return the uncertainty after measuring the rows of a matrix (N, n)."""
        taken = self.taken(matrix)
        return Uncertainty(self.covariance - taken.T @ taken, self.weights, self.noise)

    def taken(self, matrix: "csr_matrix") -> np.ndarray:
        """Return G (N, n): measuring the rows of a matrix lowers the covariance by Gᵀ G."""
        across = np.asarray(matrix @ self.covariance)
        root = np.linalg.cholesky(np.asarray(matrix @ across.T) + self.noise * np.eye(across.shape[0]))
        return under(root, across)

    def gain(self, matrix: "csr_matrix") -> float:
        """Return by how much measuring the rows of a matrix lowers tr(W Σ)."""
        taken = self.taken(matrix)
        return float(((taken @ self.weights) * taken).sum())


def uncertainties(posterior: BrdfPosterior, weights: np.ndarray) -> list[Uncertainty]:
    """Return the uncertainties of L and of the ratios."""
    # Measured values cannot be surer than the model is of itself.
    level, colour = posterior.total, posterior.colour_covariance
    return [
        Uncertainty(level, weights, NOISE**2 * max(posterior.scale, 1.0)),
        Uncertainty(colour, weights, NOISE**2),
    ]


def chosen_rows(blocks: Sequence[Uncertainty], matrix: "csr_matrix", count: int) -> list[int]:
    """Return the indices of `count` chosen rows of a matrix (N, n) of candidates, in the order of choice."""
    states = []
    for block in blocks:
        across = np.asarray(matrix @ block.covariance)
        gains = ((across @ block.weights) * across).sum(1)
        variance = np.asarray(matrix.multiply(across).sum(1)).reshape(-1) + block.noise
        states.append([across, gains, variance])
    chosen: list[int] = []
    for _ in range(min(count, len(states[0][1]))):
        total = np.sum([gains / variance for _, gains, variance in states], axis=0)
        total[chosen] = -np.inf
        best = int(np.argmax(total))
        chosen.append(best)
        for block, state in zip(blocks, states, strict=True):
            across, gains, variance = state
            own = across[best] / np.sqrt(variance[best])
            along, weighed = matrix @ own, block.weights @ own
            state[1] = gains - 2 * along * (across @ weighed) + along**2 * float(own @ weighed)
            state[0] = across - along[:, None] * own[None]
            # Measured once more, a direction still has its noise.
            state[2] = np.maximum(variance - along**2, block.noise)
    return chosen


def chosen_groups(blocks: Sequence[Uncertainty], groups: Sequence["csr_matrix"], count: int) -> list[int]:
    """Return the indices of `count` chosen groups of rows, in the order of choice; a group is measured as a whole."""
    left, chosen = list(blocks), []
    for _ in range(min(count, len(groups))):
        gains = [
            -np.inf if number in chosen else sum(block.gain(group) for block in left)
            for number, group in enumerate(groups)
        ]
        best = int(np.argmax(gains))
        chosen.append(best)
        left = [block.after(groups[best]) for block in left]
    return chosen
