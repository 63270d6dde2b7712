"""Joint descent over all searched projections with the variable-projection gradient (L-BFGS).

The search changes the quaternions without normalising them. R does not depend on their length, so the gradient has no
component along it, and L-BFGS never steps in this direction.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
import torch
from torch import Tensor

from homofact.factor.search.minimize import MeasuredObjective, SearchEnding


@dataclass(frozen=True)
class Gradient:
    """L-BFGS (scipy's L-BFGS-B without bounds), with its maximum of iterations, tolerance and memory of steps.

    The tolerance is a gain per iteration, relative to the first value.
    """

    iterations: int = 60
    tolerance: float = 1e-3
    memory: int = 12

    @property
    def independent(self) -> bool:
        """Whether several searches may run in parallel."""
        return True

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        return "gradient"

    def limited(self, steps: int) -> "Gradient":
        """Return the same search with at most `steps` iterations."""
        return replace(self, iterations=steps)

    def descend(self, measured: MeasuredObjective, start: Tensor, seed: int) -> SearchEnding:
        """See `minimize.Minimizer`; the seed has no effect."""

        # scipy's tolerance is relative for values above 1 only: in units of the first value it is relative to that.
        scale = 0.0

        def function(x: np.ndarray) -> tuple[float, np.ndarray]:
            nonlocal scale
            value, slope = measured.slope(torch.from_numpy(np.array(x)))
            scale = scale or 1 / max(value, np.finfo(float).tiny)
            return value * scale, slope.numpy() * scale

        result = scipy.optimize.minimize(
            function,
            start.numpy(),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": self.iterations, "ftol": self.tolerance, "gtol": 0.0, "maxcor": self.memory},
        )
        return SearchEnding(int(result.nit) < self.iterations, int(result.nit))
