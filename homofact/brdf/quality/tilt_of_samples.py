"""Find the tilt of a specimen from scattered samples, by how well their values predict one another.

`brdf.tilt` derives the fault, and `quality.tilt` finds it in a table, which can be evaluated at swapped directions. A
list of samples cannot. But a reciprocal isotropic material depends only on θh, θd and the folded φd. Over these
coordinates, a measurement without tilt is one smooth surface. A tilted one is two surfaces, with highlights on both
sides of θh = 0. So for every angle δ the samples are straightened (`straightened_samples`), and a Gaussian process
predicts the logarithm y of each value from all other values. The δ with the best predictions is the tilt.

The process has the covariance K = s² k(r) + V B Bᵀ + diag(σ²/w). k is the Matérn kernel (1 + √3 r) exp(−√3 r) over the
distance r in (log(θh + a small angle), θd, φd √θh sinθd), each divided by its own length scale. The columns of B are
smooth functions of θd and of the cosines, and functions of θi minus the same functions of θo. With them, neither an
extra cosine nor a gain over the angle looks like a tilt. The weights w are small for dark values, which gives them more
noise. With α = K⁻¹ y and d = diag K⁻¹, the others predict sample n as y_n − α_n / d_n with the variance 1/d_n
(Rasmussen and Williams 2006, equations 5.10 to 5.12). The score is the negative logarithm of the predictive density,
with Cauchy tails for outliers. s, the length scales and σ maximise the likelihood at the δ that standard values of
these parameters find; after that they are fixed.

Only samples with both angles below `LIMIT` and θh below `HIGHLIGHT` are used. At most `MOST` of them are chosen: those
whose values a tilt changes most, by the slope of the highlight. The interval comes from a bootstrap over blocks by θd.
A tilt is claimed by the same criteria as for tables (`quality.tilt_finding`).

η, the tilt across the plane of incidence, is not searched for. Many lists have samples on only one side of that plane,
where η looks like a wider highlight.
"""

import math
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.analytic.common import grazing
from homofact.brdf.places import half_places
from homofact.brdf.quality.least_angle import COARSE, FINE, LeastAngle, steps_round
from homofact.brdf.quality.suspicion.evidence import (
    LEAST_SAMPLES,
    Evidence,
    along_highlight,
    hats,
    logs_of,
    robust_fit,
)
from homofact.brdf.quality.suspicion.geometry import odd_columns
from homofact.brdf.quality.tilt_finding import BLOCKS, SEARCHED, TiltAngle, TiltFinding, blocks_of, doubted, unknown
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.brdf.tilt import Tilt
from homofact.geometry.directions import normalize

LIMIT, HIGHLIGHT = math.radians(70), math.radians(30)
MOST, DRAWN, FEWEST = 500, 4000, 100
_KNOTS = 12  # of the highlight's profile, by which samples are chosen
_VARIANCE_OF_SMOOTH = 4.0
_LEAST_WEIGHT = 1e-3
_TAIL = 3.0
_EVALUATIONS = 60
# Logarithms of s², of the three lengths and of σ: where the search for them begins, its first steps, and their bounds.
_BEGIN, _STEP = np.log([1.0, 2.0, 1.0, 0.5, 0.03]), 0.7
_LOW, _HIGH = np.log([1e-2, 0.3, 0.1, 0.05, 3e-3]), np.log([30, 10, 10, 10, 1.0])
_OUTSIDE = 10.0


def find_tilt_of_samples(samples: Samples, seed: int = 0) -> TiltFinding:
    """Return the tilt in the plane of incidence of isotropic samples; the same seed gives the same bits."""
    if len(samples) < LEAST_SAMPLES:
        return _finding(unknown(f"a list of {len(samples)} samples is too short to show one"))
    telling = _telling(samples, seed)
    if telling is None:
        return _finding(unknown(f"fewer than {FEWEST} samples lie on a highlight, at angles under 70°"))
    return _finding(doubted(_Process(telling).angle(), "smooth"))


def straightened_samples(samples: Samples, tilt: Tilt) -> Samples:
    """Return the samples at the directions of the surface, with the values corrected by the viewer's cosines.

    Samples whose directions are below its horizon are left out.
    """
    azimuth = _azimuth(samples)
    upright = _turned(samples, -azimuth)
    wi, wo, values = _undone(upright, tilt)
    above = (wi[:, 2] >= 0) & (wo[:, 2] >= 0)
    straight = replace(upright.select(above), wi=normalize(wi[above]), wo=normalize(wo[above]), values=values[above])
    return _turned(straight, azimuth)


class _Process:
    """The Gaussian process of the module's head, over samples whose light is at azimuth 0."""

    def __init__(self, samples: Samples) -> None:
        """Begin with standard parameters."""
        self.samples = samples
        self._block = blocks_of(samples.wi, samples.wo, LIMIT).numpy()
        self._parameters = _BEGIN

    def angle(self) -> TiltAngle:
        """Return the angle at which the samples predict one another best, without doubts."""
        steps = steps_round(0.0, SEARCHED, COARSE, SEARCHED)
        self._parameters = self._likeliest(max(steps[::2], key=lambda degrees: self._log_likelihood(degrees, _BEGIN)))
        search = LeastAngle(self._scores, {})
        best = search.best_of(steps, min(steps[::2], key=search.ratio))
        grid = sorted({*steps, *steps_round(best, 2 * COARSE, FINE, SEARCHED)})
        degrees, (low, high), near = search.answer(grid, best)
        # What is printed is what is undone, on every machine.
        degrees = round(degrees, 3)
        misfit, undone = (float(np.median(np.abs(self._predicted(at)[0]))) for at in (0.0, degrees))
        return TiltAngle(degrees, low, high, misfit, undone, near)

    def _likeliest(self, degrees: float) -> np.ndarray:
        """The parameters of the largest likelihood that Nelder and Mead's search finds."""
        from scipy.optimize import minimize  # a tenth of a second to load

        def cost(parameters: np.ndarray) -> float:
            inside = np.clip(parameters, _LOW, _HIGH)
            return _OUTSIDE * float(((parameters - inside) ** 2).sum()) - self._log_likelihood(degrees, inside)

        simplex = np.vstack([_BEGIN, _BEGIN + _STEP * np.eye(len(_BEGIN))])
        options = {"maxfev": _EVALUATIONS, "initial_simplex": simplex}
        return np.clip(minimize(cost, _BEGIN, method="Nelder-Mead", options=options).x, _LOW, _HIGH)

    def _log_likelihood(self, degrees: float, parameters: np.ndarray) -> float:
        from scipy.linalg import solve_triangular

        covariance, logs = self._covariance(degrees, parameters)
        root = np.linalg.cholesky(covariance)
        white = solve_triangular(root, logs, lower=True)
        return float(-0.5 * white @ white - np.log(np.diag(root)).sum())

    def _predicted(self, degrees: float) -> tuple[np.ndarray, np.ndarray]:
        """By how much the others miss each logarithm (N,), and the variance (N,) that they give it."""
        covariance, logs = self._covariance(degrees, self._parameters)
        inverse = np.linalg.inv(covariance)
        return (inverse @ logs) / np.diag(inverse), 1 / np.diag(inverse)

    def _scores(self, degrees: float) -> np.ndarray:
        """Sums of the scores and counts (2, 2 B) of the blocks."""
        missed, variance = self._predicted(degrees)
        score = 0.5 * np.log(variance) + _TAIL**2 / 2 * np.log1p(missed**2 / (variance * _TAIL**2))
        return np.stack([np.bincount(self._block, each, 2 * BLOCKS) for each in (score, np.ones_like(score))])

    def _covariance(self, degrees: float, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """K (N, N), and the logarithms (N,) about their mean, with `degrees` of tilt undone."""
        variance, *lengths, noise = np.exp(parameters)
        evidence = _evidence(self.samples, degrees)
        theta_h, theta_d = evidence.half_angles
        azimuth = half_places(torch.from_numpy(evidence.wi), torch.from_numpy(evidence.wo), True)[:, 2].numpy()
        place = np.stack([along_highlight(theta_h), theta_d, azimuth], 1) / lengths
        square = (place**2).sum(1)
        r = np.sqrt(3 * np.maximum(square[:, None] + square[None] - 2 * place @ place.T, 0))
        cos_i, cos_o = evidence.cosines
        c, apart = 2 * np.cos(theta_d) - 1, (cos_i - cos_o) ** 2
        smooth = np.column_stack([np.ones_like(c), c, c**2, apart, np.log(cos_i * cos_o), odd_columns(evidence)])
        logs, weight = logs_of(evidence.brightness)
        covariance = variance * (1 + r) * np.exp(-r) + _VARIANCE_OF_SMOOTH * smooth @ smooth.T
        covariance[np.diag_indices_from(covariance)] += noise**2 / np.maximum(weight, _LEAST_WEIGHT)
        return covariance, logs - logs.mean()


def _finding(in_plane: TiltAngle) -> TiltFinding:
    across = unknown("a tilt across the plane of incidence is not looked for in a list of samples")
    misfit = "median difference between a sample and its prediction from the other samples"
    return TiltFinding(in_plane, across, (misfit, ""))


def _telling(samples: Samples, seed: int) -> Samples | None:
    """At most `MOST` of `DRAWN` samples, the light turned to azimuth 0: those that a tilt changes most.

    None where fewer than `FEWEST` could tell.
    """
    samples = samples.to("cpu").subset(DRAWN, seed)
    samples = _turned(samples, -_azimuth(samples))
    evidence = _evidence(samples, 0.0)
    logs, weight = evidence.logs
    along = along_highlight(evidence.half_angles[0])
    knots = np.unique(np.quantile(along, np.linspace(0, 1, _KNOTS)))
    profile = robust_fit(np.column_stack([hats(along, knots), odd_columns(evidence)]), logs, weight)[0][: len(knots)]
    low, high = (
        np.interp(along_highlight(_evidence(samples, degrees).half_angles[0]), knots, profile)
        for degrees in (-2 * COARSE, 2 * COARSE)
    )
    within = (np.minimum(evidence.wi[:, 2], evidence.wo[:, 2]) > math.cos(LIMIT)) & (evidence.brightness > 0)
    within &= evidence.half_angles[0] < HIGHLIGHT
    if samples.clipped is not None:
        within &= ~samples.clipped.any(1).numpy()
    if within.sum() < FEWEST:
        return None
    change = np.where(within, np.abs(high - low) * np.sqrt(weight), -1.0)
    first = np.argsort(-change, kind="stable")[: min(MOST, int(within.sum()))]
    return samples.select(torch.from_numpy(np.sort(first)))


def _evidence(samples: Samples, degrees: float) -> Evidence:
    """The samples as arrays with `degrees` of tilt undone, those below the horizon too."""
    arrays = (*_undone(samples, Tilt(math.radians(degrees))), torch.zeros(len(samples)))
    return Evidence(*(tensor.numpy() for tensor in arrays))


def _undone(samples: Samples, tilt: Tilt) -> tuple[Tensor, Tensor, Tensor]:
    """The directions of the surface (N, 3) and the values (N, C) there, where the light is at azimuth 0."""
    wi, wo = tilt.true(samples.wi, samples.wo)
    return wi, wo, samples.values * (grazing(samples.wo[:, 2:]) / grazing(wo[:, 2:]))


def _azimuth(samples: Samples) -> float:
    """The azimuth of all the light, in radians; 0 where it has many: each pair then has a plane of its own."""
    if not lit_from_one_azimuth(samples.wi):
        return 0.0
    x, y = samples.wi[samples.wi[:, :2].norm(dim=1).argmax(), :2].tolist()
    return math.atan2(y, x)


def _turned(samples: Samples, azimuth: float) -> Samples:
    """All samples turned about the normal by one angle in radians."""
    return samples.turned(torch.full_like(samples.weights, azimuth))
