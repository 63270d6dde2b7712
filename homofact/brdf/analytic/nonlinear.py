"""Models of a few parameters fitted by nonlinear least squares.

The fit minimises Σ w (∛(f̂ cosθi + δ) − ∛(f cosθi + δ))² over pairs and channels, where f̂ is the model and f the
sample. The cube root keeps the highlight from dominating the sum, and it agreed best with people's judgements in a
comparison of metrics (Fores, Ferwerda and Gu 2012). δ is a thousandth of the mean of f cosθi and only keeps derivatives
finite. w are the weights of the samples for means over the discs (`brdf.pair_density`).

scipy's trust region method runs from every start of the model, with derivatives from forward-mode automatic
differentiation or from the model itself. The number of evaluations is limited, not the time. The only random choice is
a subset of the samples, if there are more than `MOST_SAMPLES`.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor
from torch.func import jacfwd

from homofact.brdf.pair_density import over_discs
from homofact.brdf.samples import Samples
from homofact.errors import Report, Status

MOST_SAMPLES, MOST_EVALUATIONS = 8000, 100


@dataclass(frozen=True)
class CubeRoots:
    """The objective of the module docstring, on `samples`."""

    samples: Samples

    @classmethod
    def of(cls, samples: Samples, seed: int, most: int = MOST_SAMPLES) -> "CubeRoots":
        """Return the objective on at most `most` samples, drawn by `seed`."""
        return cls(samples.subset(most, seed))

    def compressed(self, values: Tensor) -> Tensor:
        """∛(f cosθi + δ), (N, C)."""
        return (values * self.samples.wi[:, 2:].to(values) + self.floor).pow(1 / 3)

    def residuals(self, values: Tensor) -> Tensor:
        """√w times the difference (N, C) of model and samples."""
        return self.root.to(values) * (self.compressed(values) - self.target.to(values))

    @cached_property
    def floor(self) -> float:
        """δ."""
        return max(1e-3 * float((self.samples.values * self.samples.wi[:, 2:]).mean()), 1e-12)

    @cached_property
    def root(self) -> Tensor:
        """√w (N, 1)."""
        weights = over_discs(self.samples)
        return (weights / weights.sum()).sqrt()[:, None]

    @cached_property
    def target(self) -> Tensor:
        """∛(f cosθi + δ) of the samples (N, C)."""
        return self.compressed(self.samples.values)


def fit_parameters(
    model: Callable[[Tensor, Tensor, Tensor], Tensor], starts: Sequence[np.ndarray], samples: Samples, seed: int
) -> tuple[Tensor, Report]:
    """Return (the best parameters (P,) in float64, the report of the fit).

    `model(parameters, wi, wo)` returns values (N, C) for any real parameters: the model itself maps them into their
    bounds. It uses only operations that torch can differentiate.
    """
    data = CubeRoots.of(samples, seed)
    wi, wo = data.samples.wi, data.samples.wo

    def residuals(parameters: Tensor) -> Tensor:
        return data.residuals(model(parameters, wi, wo)).reshape(-1)

    slopes = jacfwd(residuals)
    with warnings.catch_warnings():
        # torch loads rules of its own the first time, by a function that it calls deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        x, report = least(
            lambda x: residuals(torch.from_numpy(x)).numpy(),
            lambda x: slopes(torch.from_numpy(x)).numpy(),
            starts,
            seed,
        )
    return torch.from_numpy(x), report


def least(
    residuals: Callable[[np.ndarray], np.ndarray],
    slopes: Callable[[np.ndarray], np.ndarray],
    starts: Sequence[np.ndarray],
    seed: int,
) -> tuple[np.ndarray, Report]:
    """Return (the parameters (P,) with the least sum of squares over all starts, the report of the fit).

    `residuals(parameters)` returns the residuals (R,), and `slopes(parameters)` their derivatives (R, P).
    """
    from scipy.optimize import least_squares  # a tenth of a second to load

    found = [
        least_squares(residuals, start, jac=slopes, x_scale="jac", max_nfev=MOST_EVALUATIONS)  # type: ignore[arg-type]
        for start in starts
    ]
    best = min(found, key=lambda each: each.cost)
    evaluations = sum(each.nfev for each in found)
    status = Status.CONVERGED if best.success else Status.BUDGET
    return np.asarray(best.x), Report(status, len(starts), evaluations, 0.0, float(2 * best.cost), seed)
