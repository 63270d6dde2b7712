"""Any of nlopt's algorithms, by name, on the vector of all searched projections.

Gradient-based ones (LD_, GD_) are given the variable-projection gradient. Each component of a quaternion is bounded to
[−1.5, 1.5]. The start vectors have unit length, and the length does not matter, so the bounds exclude no rotation.
"""

from dataclasses import dataclass, replace

import nlopt
import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput
from homofact.factor.search.algorithms import EXPECTED_OF_NLOPT, has_algorithm, in_full
from homofact.factor.search.minimize import DeadlineReached, MeasuredObjective, SearchEnding

_NEEDS_LOCAL = ("MLSL", "AUGLAG")


@dataclass(frozen=True)
class Nlopt:
    """`algorithm` is nlopt's name with or without its LN_/LD_/GN_/GD_ (PRAXIS, SBPLX, BOBYQA, COBYLA, LD_LBFGS,
    LD_SLSQP, MLSL …). The search ends at a relative gain below `tolerance` or after `evaluations` evaluations.
    """

    algorithm: str
    evaluations: int = 2000
    tolerance: float = 1e-4
    step: float = 0.2

    def __post_init__(self) -> None:
        """Refuse a name that nlopt does not have."""
        if not has_algorithm(self.algorithm):
            raise BadInput(where="search", found=f"nlopt algorithm {self.algorithm!r}", expected=EXPECTED_OF_NLOPT)

    @property
    def full_name(self) -> str:
        """The full nlopt name of the algorithm."""
        return in_full(self.algorithm)

    @property
    def independent(self) -> bool:
        """Whether several searches may run in parallel; nlopt shares one random generator between all searches."""
        return False

    @property
    def name(self) -> str:
        """The name in reports and charts."""
        return f"nlopt-{self.algorithm}"

    def limited(self, steps: int) -> "Nlopt":
        """Return the same search, limited to the cost of `steps` gradient iterations or 8 direct sweeps."""
        return replace(self, evaluations=steps if "D_" in self.full_name[:3] else 8 * steps)

    def descend(self, measured: MeasuredObjective, start: Tensor, seed: int) -> SearchEnding:
        """See `minimize.Minimizer`."""
        nlopt.srand(seed)
        ended: BaseException | None = None

        def function(x: np.ndarray, slope: np.ndarray) -> float:
            nonlocal ended
            if ended is not None:
                return measured.best
            vector = torch.from_numpy(np.array(x))
            try:
                if slope.size == 0:
                    return measured.value(vector)
                value, gradient = measured.slope(vector)
                slope[:] = gradient.numpy()
                return value
            except (DeadlineReached, KeyboardInterrupt) as stop:
                # Some algorithms call once more after an exception: nlopt's own way out is a flag.
                ended = stop
                optimizer.force_stop()
                return measured.best

        optimizer = self._optimizer(start.shape[0])
        optimizer.set_min_objective(function)
        converged = True
        try:
            optimizer.optimize(start.numpy())
            converged = optimizer.last_optimize_result() != nlopt.MAXEVAL_REACHED
        except (nlopt.ForcedStop, nlopt.RoundoffLimited, nlopt.runtime_error):
            # Ours, or nlopt's own giving up where rounding hides the descent: the best so far stands.
            if measured.vector is None and ended is None:
                raise
        if ended is not None:
            raise ended
        return SearchEnding(converged, measured.evaluations)

    def _optimizer(self, dimension: int) -> nlopt.opt:
        optimizer = self._configured(self.full_name, dimension)
        if any(part in self.full_name for part in _NEEDS_LOCAL):
            optimizer.set_local_optimizer(self._configured("LD_LBFGS", dimension))
        return optimizer

    def _configured(self, name: str, dimension: int) -> nlopt.opt:
        optimizer = nlopt.opt(getattr(nlopt, name), dimension)
        optimizer.set_lower_bounds(-1.5)
        optimizer.set_upper_bounds(1.5)
        optimizer.set_ftol_rel(self.tolerance)
        optimizer.set_maxeval(self.evaluations)
        if name.startswith("LN_"):
            optimizer.set_initial_step(self.step)
        return optimizer
