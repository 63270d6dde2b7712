"""Joint descent over all searched projections with the variable-projection gradient (L-BFGS).

The vector is minimised as it is, quaternions unnormalised: their length is a flat direction, which
L-BFGS never steps along, since the gradient has no part in it.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
import torch
from torch import Tensor

from homofact.errors import Report, Status
from homofact.factor.objective import Objective
from homofact.factor.search.best import Best, BudgetSpent


@dataclass(frozen=True)
class Gradient:
    """L-BFGS (scipy's L-BFGS-B without bounds): most iterations, relative gain that ends, memory of steps."""

    iterations: int = 60
    tolerance: float = 1e-4
    memory: int = 12

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        return "gradient"

    def limited(self, steps: int) -> "Gradient":
        """The same with at most `steps` iterations."""
        return replace(self, iterations=steps)

    def minimize(
        self, objective: Objective, start: Tensor, *, seconds: float = float("inf"), seed: int = 0
    ) -> tuple[Tensor, Report]:
        """The best vector met and the report; see `best.Search`."""
        best = Best(seconds)
        began = time.perf_counter()

        def function(x: np.ndarray) -> tuple[float, np.ndarray]:
            vector = torch.from_numpy(np.array(x))
            evaluation = objective.evaluate(vector)
            best.offer(evaluation.value, vector)
            return evaluation.value, evaluation.gradient.numpy()

        status, iterations = Status.CONVERGED, 0
        try:
            result = scipy.optimize.minimize(
                function,
                start.numpy(),
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": self.iterations, "ftol": self.tolerance, "gtol": 0.0, "maxcor": self.memory},
            )
            iterations = int(result.nit)
            if iterations >= self.iterations:
                status = Status.BUDGET
        except BudgetSpent:
            status = Status.BUDGET
        except KeyboardInterrupt:
            if best.vector is None:
                raise
            status = Status.INTERRUPTED
        return best.finish(status, iterations, time.perf_counter() - began, seed)
