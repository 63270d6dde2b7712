"""Find the ring of angles whose gain differs most from the gains of its neighbours.

Gains per ring of θi, and then of θo, are columns in the smooth reciprocal fit of log f (`suspicion.evidence`), beside a
smooth gain over the angle. The step of a ring is its log gain minus the mean of its two neighbours', so a smooth gain
over the angle has no steps. The usual step is the median over the other rings. The two rings beside the largest step
are excluded, since their steps come from the same ring.
"""

import math
from dataclasses import dataclass

import numpy as np

from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.quality.suspicion.geometry import odd_columns

BINS = 18
_FEWEST_RINGS, _FEWEST_ON_A_RING = 6, 12
_CERTAIN_STEP = 0.01  # of logs: what a clean material shows between rings


@dataclass(frozen=True)
class RingStep:
    """The ring at `degrees` of "theta_i" or "theta_o": its log gain relative to its neighbours, and the usual step."""

    of: str
    degrees: float
    gain: float
    usual: float

    @property
    def figures(self) -> tuple[float, float, float, float, float]:
        """(log of the step, log of step over usual step, 1 for a ring of θo else 0, angle in degrees, log gain)."""
        step = abs(self.gain)
        over = math.log(step / (self.usual + _CERTAIN_STEP) + 1e-4)
        return math.log(step + 1e-4), over, float(self.of == "theta_o"), self.degrees, self.gain


def largest_step(evidence: Evidence) -> RingStep | None:
    """Return the ring with the largest step; None if there are too few rings."""
    found = [_largest_of(evidence, of, w) for of, w in (("theta_i", evidence.wi), ("theta_o", evidence.wo))]
    return max((step for step in found if step is not None), key=lambda step: step.figures[:2], default=None)


def ring_numbers_of(theta: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the ring of each angle (N,) in radians and how many rings there are.

    Rings are angles at which many samples lie; samples elsewhere have −1. If most samples lie on no ring, the function
    uses `BINS` bins with equal numbers of samples instead.
    """
    _, inverse, counts = np.unique(np.round(theta, 3), return_inverse=True, return_counts=True)
    full = counts >= _FEWEST_ON_A_RING
    if counts[full].sum() >= len(theta) / 2:
        return np.where(full, np.cumsum(full) - 1, -1)[inverse], int(full.sum())
    edges = np.unique(np.quantile(theta, np.linspace(0, 1, BINS + 1)))
    return np.clip(np.searchsorted(edges, theta, side="right") - 1, 0, len(edges) - 2), len(edges) - 1


def _largest_of(evidence: Evidence, of: str, directions: np.ndarray) -> RingStep | None:
    theta = np.arccos(np.clip(directions[:, 2], 0, 1))
    number, count = ring_numbers_of(theta)
    if count < _FEWEST_RINGS:
        return None
    _, weight = evidence.logs
    members = (number[:, None] == np.arange(count)).astype(float)
    trusted = ((members * (weight > 0.1)[:, None]).sum(0) >= _FEWEST_ON_A_RING)[1:-1]
    odd = odd_columns(evidence)
    gains = evidence.fitted(np.column_stack([odd, members])).further[odd.shape[1] :]
    steps = (gains[1:-1] - (gains[:-2] + gains[2:]) / 2) * trusted
    largest = int(np.abs(steps).argmax())
    others = np.abs(steps[trusted & (np.abs(np.arange(len(steps)) - largest) > 1)])
    if len(others) < 3:
        return None
    at = math.degrees(float(theta[number == largest + 1].mean()))
    return RingStep(of, at, float(steps[largest]), float(np.median(others)))
