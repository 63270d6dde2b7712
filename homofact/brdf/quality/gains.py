"""Estimate the instrument's gains from the samples and divide them out, per ring of θi and θo or per row.

A goniometer's lamp and detector may have a different gain on each ring of angles, or drift during the measurement. Such
gains are added as columns to the smooth reciprocal fit of log f (`suspicion.evidence`): one column per ring, or one hat
function per block of rows. Least squares, reweighted for outliers, solves for them:

    log f(ωi, ωo) = smooth reciprocal (ωi, ωo) + a(θi) + b(θo)        (rings)
    log f(ωi, ωo) = smooth reciprocal (ωi, ωo) + c(row)               (rows)

The data leave some choices open, which the model fixes as follows:

* The mean of the log gains over the samples is 0, since the samples do not determine the absolute brightness of the
  lamp.
* A smooth gain that is equal over θi and θo cannot be distinguished from another material, and stays in the data.
* A smooth gain over the angle shows only through the difference between θi and θo, which breaks reciprocity. If the
  rings of θo have no gains of their own, θi (the lamp's side) gets the whole difference; otherwise each gets half. (If
  the detector caused it, a smooth gain that is equal over both remains.)
* If the samples do not lie on rings of θo, there is no b. `BINS` bins of θi then get gains by reciprocity only.
* If the rows are sorted by an angle, a drift over rows cannot be distinguished from gains of rings.

Gains below `LEAST_GAIN` (RMS of the log), and gains that hardly improve the fit, may come from the limits of the smooth
fit on a clean material. They are reported and not divided out. A few bad rings among good ones also hardly improve the
fit of all samples. So in this case each suspected ring (`suspicion.ring_steps`) is corrected on its own: its gain
relative to its neighbours is divided out, one ring after the other. So it is if there are few rings of θi: gains of all
of them would be relative to their mean, which a single bad ring moves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.quality.suspicion.calibration import SAID, log_odds
from homofact.brdf.quality.suspicion.evidence import LEAST_SAMPLES, Evidence, hats, robust_fit
from homofact.brdf.quality.suspicion.ring_steps import FEW_RINGS, RingStep, largest_step
from homofact.brdf.samples import Samples
from homofact.brdf.source_names import GAINS
from homofact.brdf.symmetry import ring_numbers
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical

MOST_SAMPLES = 20_000
BINS, BLOCKS, FEWEST_IN_A_BLOCK = 24, 24, 40
NOISES = 3.0
_SMOOTH_DEGREE = 3  # of the polynomial over θo that counts as a smooth gain
_HARDLY = 0.3  # of the unevenness over θi: what that over θo may be to count as none
_MOST_BAD = 4  # rings
LEAST_GAIN, LEAST_IMPROVEMENT = 0.03, 0.5  # logs: RMS of the gains, fall of the fit's error
_RIDGE_OF_BASIS, _RIDGE = 1e-4, 3e-3
_RIDGE_OF_ROWS = 1e-3


@dataclass(frozen=True)
class Gains:
    """Log gains of one kind: `at` (K,) are angles in degrees or rows, `logs` (K,) the gains there.

    `of` is "theta_i", "theta_o" or "row". A sample gets the gain of the nearest angle, or a gain interpolated between
    rows.
    """

    of: str
    at: np.ndarray
    logs: np.ndarray

    def record(self) -> list[list[float]]:
        """[[degrees or row, gain]], JSON-able."""
        return [
            [round(float(at), 4), round(float(gain), 6)] for at, gain in zip(self.at, np.exp(self.logs), strict=True)
        ]


@dataclass(frozen=True)
class Calibration:
    """The result for one `kind` of gains, "rings" or "rows". `rms` is the RMS of the log gains, and `improvement` the
    log of the factor by which they reduce the error of the smooth fit. `bad` lists single bad rings; if it is not
    empty, only these rings have gains."""

    kind: str
    gains: tuple[Gains, ...]
    rms: float
    improvement: float
    bad: tuple[RingStep, ...] = ()

    @property
    def removed(self) -> bool:
        """Whether the gains exceed what the smooth fit finds on a clean material, so they are divided out."""
        return bool(self.bad) or (self.rms >= LEAST_GAIN and self.improvement >= LEAST_IMPROVEMENT)

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {
            "rms": round(self.rms, 6), "improvement": round(self.improvement, 6), "removed": self.removed,
            **{gains.of: gains.record() for gains in self.gains},
        }  # fmt: skip

    def line(self) -> str:
        """Return one line for people."""
        what = "gains by ring of θ" if self.kind == "rings" else "gains along the rows"
        if not self.removed:
            return f"{what}: none found ({self.rms:.1%} RMS, no more than a clean material may show); nothing changed"
        if self.bad:
            rings = (
                f"{'θi' if ring.of == 'theta_i' else 'θo'} = {ring.degrees:.3g}° ({abs(math.expm1(ring.gain)):.0%}"
                f" {'darker' if ring.gain < 0 else 'brighter'} than its neighbours)"
                for ring in self.bad
            )
            return f"{what}: {', '.join(rings)}; divided out"
        low, high = (math.exp(end(gains.logs.max() if end is max else gains.logs.min() for gains in self.gains))
                     for end in (min, max))  # fmt: skip
        return f"{what}: {self.rms:.1%} RMS, from {low:.3g} to {high:.3g}; divided out (mean gain 1)"


def calibrated(samples: Samples, kinds: Sequence[str]) -> Samples:
    """Return the samples with gains of `kinds` ("rings", "rows") divided out, one kind after the other.

    provenance["gains"] contains the result for each kind (`Calibration.record`). Raises BadInput for an unknown kind,
    anisotropic samples, and fewer than `LEAST_SAMPLES`.
    """
    for kind in kinds:
        if kind not in GAINS:
            raise BadInput(where="calibrate", found=repr(kind), expected=f"some of {', '.join(GAINS)}")
    if kinds and not samples.isotropic:
        raise BadInput("the samples are anisotropic", where="calibrate", expected="an isotropic material")
    if kinds and len(samples) < LEAST_SAMPLES:
        raise BadInput(where="calibrate", found=f"{len(samples)} samples", expected=f"at least {LEAST_SAMPLES}")
    for kind in kinds:
        calibration = calibration_of(samples, kind)
        facts = samples.provenance.get("gains", {}) | {kind: calibration.record() | {"words": calibration.line()}}
        values = samples.values
        if calibration.removed:
            logs = torch.stack([gain_at(gains, samples) for gains in calibration.gains]).sum(0)
            values = values / torch.exp(logs)[:, None]
        samples = replace(samples, values=values, provenance=samples.provenance | {"gains": facts})
    return samples


def gain_at(gains: Gains, samples: Samples) -> Tensor:
    """Return the log gain of every sample (N,)."""
    if gains.of == "row":
        logs = np.interp(np.arange(len(samples)), gains.at, gains.logs)
    else:
        theta = _degrees(samples.wi if gains.of == "theta_i" else samples.wo)
        logs = gains.logs[_nearest(theta, gains.at)]
    return torch.from_numpy(logs).to(samples.values)


def calibration_of(samples: Samples, kind: str) -> Calibration:
    """Return the gains of one kind, whether or not they are large enough to divide out."""
    order = torch.randperm(len(samples), generator=torch.Generator().manual_seed(0))
    index = order[:MOST_SAMPLES].sort().values
    some = samples.select(index.to(samples.wi.device))
    wi, wo, values = (tensor.cpu().numpy() for tensor in (some.wi, some.wo, some.values))
    evidence = Evidence(wi, wo, values, np.zeros(len(some)))
    found = (_of_rings if kind == "rings" else _of_rows)(some, evidence, index.numpy(), len(samples))
    rings = _rings(some.wi) if kind == "rings" else None
    few = rings is not None and len(rings) < FEW_RINGS
    return found if kind != "rings" or (found.removed and not few) else _of_bad_rings(some, evidence, found)


def _of_bad_rings(samples: Samples, evidence: Evidence, found: Calibration) -> Calibration:
    """The gains of single rings that are suspected, at most `_MOST_BAD`; what was found where there are none."""
    bad: list[RingStep] = []
    gains = {of: Gains(of, at, np.zeros(len(at))) for of, at in
             (("theta_i", _rings(samples.wi)), ("theta_o", _rings(samples.wo))) if at is not None}  # fmt: skip
    while len(bad) < _MOST_BAD:
        step = largest_step(evidence)
        if step is None or step.of not in gains or log_odds("ring", step.figures) < math.log(SAID):
            break
        bad.append(step)
        ring = gains[step.of]
        ring.logs[_nearest(np.array([step.degrees]), ring.at)] += step.gain
        evidence = step.divided_out(evidence)
    if not bad:
        return found
    return replace(found, gains=tuple(gains.values()), bad=tuple(bad))


def _of_rows(samples: Samples, evidence: Evidence, index: np.ndarray, count: int) -> Calibration:
    blocks = max(2, min(BLOCKS, len(samples) // FEWEST_IN_A_BLOCK))
    knots = np.linspace(0, count - 1, blocks)
    columns = hats(index.astype(float), knots)
    logs, _, improvement = _fitted(evidence, columns, _RIDGE_OF_ROWS)
    logs = logs - (columns @ logs).mean()
    rms = float(np.sqrt(np.mean((columns @ logs) ** 2)))
    return Calibration("rows", (Gains("row", knots, logs),), rms, improvement)


def _of_rings(samples: Samples, evidence: Evidence, index: np.ndarray, count: int) -> Calibration:
    theta_i, theta_o = _degrees(samples.wi), _degrees(samples.wo)
    rings_i, rings_o = _rings(samples.wi), _rings(samples.wo)
    if rings_i is None or rings_o is None:
        at_i = at_o = _bins(np.concatenate((theta_i, theta_o))) if rings_i is None else rings_i
    else:
        at_i, at_o = rings_i, rings_o
    near_i, near_o = _nearest(theta_i, at_i), _nearest(theta_o, at_o)
    members = np.hstack((np.eye(len(at_i))[near_i], np.eye(len(at_o))[near_o]))
    logs, _, improvement = _fitted(evidence, members, _RIDGE)
    a, b = logs[: len(at_i)], logs[len(at_i) :]
    if rings_i is None or rings_o is None:
        # By reciprocity alone: what a and b have in common is as well the material's.
        a, b = a - b, None
    else:
        a, b = _attributed(at_i, a, near_i, at_o, b, near_o)
    a = a - a[near_i].mean()
    gains, every = [Gains("theta_i", at_i, a)], a[near_i]
    if b is not None:
        b = b - b[near_o].mean()
        gains.append(Gains("theta_o", at_o, b))
        every = every + b[near_o]
    return Calibration("rings", tuple(gains), float(np.sqrt(np.mean(every**2))), improvement)


def lacking_reciprocity(evidence: Evidence) -> tuple[np.ndarray, np.ndarray, float]:
    """Return (angles (K,) in degrees, log gains over θi at them with mean 0, their RMS with noise subtracted).

    For samples that do not lie on rings, the gains follow from reciprocity alone: in `BINS` bins of the angle, the gain
    over θi minus the gain over θo. The standard error of a bin is the error of the fit divided by the root of the
    number of its samples. `NOISES` times its square is subtracted from the mean square of the gains. The factor is
    above 1 because weights make the effective number of samples smaller.
    """
    theta_i, theta_o = (np.rad2deg(np.arccos(np.clip(w[:, 2], 0, 1))) for w in (evidence.wi, evidence.wo))
    at = _bins(np.concatenate((theta_i, theta_o)))
    near_i, near_o = _nearest(theta_i, at), _nearest(theta_o, at)
    members = np.hstack((np.eye(len(at))[near_i], np.eye(len(at))[near_o]))
    logs, plain, _ = _fitted(evidence, members, _RIDGE)
    gains = logs[: len(at)] - logs[len(at) :]
    gains = gains - gains[near_i].mean()
    counts = [np.maximum(np.bincount(near, minlength=len(at)), 1) for near in (near_i, near_o)]
    noise = plain**2 * (1 / counts[0] + 1 / counts[1])
    beyond = float(np.mean(gains[near_i] ** 2) - NOISES * np.mean(noise[near_i]))
    return at, gains, math.sqrt(max(beyond, 0.0))


def _attributed(
    at_i: np.ndarray, a: np.ndarray, near_i: np.ndarray, at_o: np.ndarray, b: np.ndarray, near_o: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(a, b) with the smooth part of b put down to θi, where b has next to nothing else.

    p(θi) + p(θo) is the material's; without it b loses p, and so does a.
    """
    smooth_a, smooth_b = (
        np.polynomial.Polynomial.fit(at, logs, min(_SMOOTH_DEGREE, len(at) - 2), w=np.sqrt(np.bincount(near)))
        for at, logs, near in ((at_i, a, near_i), (at_o, b, near_o))
    )
    rough_a, rough_b = ((logs - smooth(at)).std() for logs, smooth, at in ((a, smooth_a, at_i), (b, smooth_b, at_o)))
    if rough_b > max(_HARDLY * rough_a, LEAST_GAIN):
        return a, b
    return a - smooth_b(np.clip(at_i, at_o[0], at_o[-1])), b - smooth_b(at_o)


def _fitted(evidence: Evidence, columns: np.ndarray, ridge: float) -> tuple[np.ndarray, float, float]:
    """(coefficients (K,) of further columns (N, K), the error without them, its fall with them), in logs."""
    logs, weight = evidence.logs
    basis = evidence.basis
    ridges = np.concatenate((np.full(basis.shape[1], _RIDGE_OF_BASIS), np.full(columns.shape[1], ridge)))
    plain = evidence.fitted().scale
    coefficients, _, scale = robust_fit(np.hstack((basis, columns)), logs, weight, ridges)
    return coefficients[basis.shape[1] :], plain, math.log((plain + 1e-3) / (scale + 1e-3))


def _degrees(directions: Tensor) -> np.ndarray:
    return np.rad2deg(to_spherical(directions)[0].cpu().numpy())


def _rings(directions: Tensor) -> np.ndarray | None:
    """The angles (K,) of the rings that directions lie on, rising; None where they lie on none."""
    numbers = ring_numbers(directions)
    if numbers is None:
        return None
    rank, count = numbers
    theta = _degrees(directions)
    return np.bincount(rank.cpu().numpy(), theta, count) / np.bincount(rank.cpu().numpy(), minlength=count)


def _bins(theta: np.ndarray) -> np.ndarray:
    """The middles of `BINS` bins with as many of the angles (N,) in each."""
    return np.unique(np.quantile(theta, (np.arange(BINS) + 0.5) / BINS))


def _nearest(theta: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The number of the nearest of rising angles `at` (K,), for each of `theta` (N,)."""
    return np.searchsorted((at[1:] + at[:-1]) / 2, theta)
