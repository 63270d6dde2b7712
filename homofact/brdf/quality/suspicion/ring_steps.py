"""Find the ring of angles whose gain differs most from the gains of its neighbours.

Gains per ring of θi, and then of θo, are columns in the smooth reciprocal fit of log f (`suspicion.evidence`), beside a
smooth gain over the angle. The step of a ring is its log gain minus the mean of its two neighbours', so a smooth gain
over the angle has no steps. The usual step is the median over the other rings. The two rings beside the largest step
are excluded, since their steps come from the same ring.

Few rings have too few steps to show what is usual. If a goniometer has lit the sample from few angles θi, swapped pairs
of samples therefore replace the smooth fit: f(ωi, ωo) over f(ωo, ωi) is the gain of the ring of ωi over that of ωo,
whatever the material. The ring whose removal leaves the most equal gains is the one that differs; its step is its log
gain minus the median of the others', and the usual step is the RMS of what the others differ by, with the error of the
gain.
"""

import math
from dataclasses import dataclass

import numpy as np

from homofact.brdf.quality.suspicion.evidence import Evidence, robust_fit
from homofact.brdf.quality.suspicion.geometry import odd_columns
from homofact.brdf.symmetry import swapped_neighbours

BINS = 18
_FEWEST_RINGS, _FEWEST_ON_A_RING = 6, 12
_FEWEST_OTHERS = 3
FEW_RINGS = 8  # fewer leave too few steps
_CERTAIN_STEP = 0.01  # of logs: what a clean material shows between rings
_SAME_RING = 0.05  # degrees
# Of swapped pairs: how far apart in radians, how many pairs and rings at least, and the ridge of their gains.
_NEAR, _FEWEST_PAIRS, _FEWEST_SWAPPED, _RIDGE = math.radians(0.3), 20, 4, 1e-6


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

    def divided_out(self, evidence: Evidence) -> Evidence:
        """Return the evidence with the gain of the ring divided out."""
        w = evidence.wi if self.of == "theta_i" else evidence.wo
        there = np.abs(np.rad2deg(np.arccos(np.clip(w[:, 2], -1, 1))) - self.degrees) < _SAME_RING
        values = np.where(there[:, None], evidence.values * math.exp(-self.gain), evidence.values)
        return Evidence(evidence.wi, evidence.wo, values, evidence.place)


def largest_step(evidence: Evidence) -> RingStep | None:
    """Return the ring with the largest step; None if there are too few rings."""
    of_lights = _largest_of(evidence, "theta_i", evidence.wi)
    of_views = _largest_of(evidence, "theta_o", evidence.wo)
    if of_lights is not None:
        return max(filter(None, (of_lights, of_views)), key=lambda step: step.figures[:2])
    # A bad ring among few lights makes the smooth fit uneven over θo as well: the clearer of the two is the fault.
    return max(filter(None, (lone_ring(evidence), of_views)), key=lambda step: step.figures[1], default=None)


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
    if len(others) < _FEWEST_OTHERS:
        return None
    at = math.degrees(float(theta[number == largest + 1].mean()))
    return RingStep(of, at, float(steps[largest]), float(np.median(others)))


def lone_ring(evidence: Evidence) -> RingStep | None:
    """Return the ring of few rings of θi that differs most from the others by swapped pairs.

    None if there are `FEW_RINGS` or more, whose steps show it, and if there are too few pairs.
    """
    theta = np.arccos(np.clip(evidence.wi[:, 2], -1, 1))
    number, count = ring_numbers_of(theta)
    if count >= FEW_RINGS:
        return None
    swapped = swapped_neighbours(evidence.samples(), near=_NEAR)
    one, two = (swapped.chosen[rows].numpy() for rows in (swapped.paired, swapped.nearest[swapped.paired]))
    # Each pair once, of samples on two rings.
    kept = (one < two) & (number[one] != number[two]) & (number[one] >= 0) & (number[two] >= 0)
    one, two = one[kept], two[kept]
    members = np.eye(count)[number[one]] - np.eye(count)[number[two]]
    paired = np.flatnonzero(members.any(0))
    if len(one) < _FEWEST_PAIRS or len(paired) < _FEWEST_SWAPPED:
        return None
    logs, weight = evidence.logs
    members = members[:, paired]
    gains, _, scale = robust_fit(members, logs[one] - logs[two], np.minimum(weight[one], weight[two]), _RIDGE)
    others = [np.delete(gains, ring) for ring in range(len(gains))]
    apart = [float(np.sqrt(((each - np.median(each)) ** 2).mean())) for each in others]
    odd = int(np.argmin(apart))
    usual = math.hypot(apart[odd], scale / math.sqrt(np.count_nonzero(members[:, odd])))
    at = math.degrees(float(theta[number == paired[odd]].mean()))
    return RingStep("theta_i", at, float(gains[odd] - np.median(others[odd])), usual)
