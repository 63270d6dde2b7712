"""Predict the error of the estimate from random materials that agree with the samples.

Each draw is a material of the posterior: a centre, drawn by its probability, and random logarithms and ratios about it.
The errors of the estimate are its differences from the draw in pictures, albedo and highlight. The intervals are the
`COVERED` quantiles of these errors, widened by factors (`BrdfPrior.widening`) so that they cover the errors of measured
materials.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from homofact.measuring.aims import DEGREES, Aim, MeasuringAims
from homofact.measuring.posterior import BrdfPosterior
from homofact.measuring.prior import BrdfPrior

COVERED = 0.9
DRAWS = 64


@dataclass(frozen=True)
class AimErrors:
    """Errors of one material: PSNR in dB of all pictures together, log ratios of albedo and highlight by incidence."""

    psnr: float
    albedo: tuple[float, ...]
    highlight: tuple[float, ...]


@dataclass(frozen=True)
class Foretold:
    """The expected error of an estimate.

    Attributes
    ----------
    psnr, psnr_least : PSNR of the pictures in dB: the median, and a bound that nine of ten materials reach.
    degrees : angles of incidence of the following figures, in degrees.
    albedo, albedo_factor : the estimated albedo (mean of the channels), and the factor within which the true one is
        expected.
    highlight, highlight_factor : the part of the albedo with half vectors within `aims.HIGHLIGHT` degrees of the
        normal, and its factor.
    """

    psnr: float
    psnr_least: float
    degrees: tuple[float, ...]
    albedo: tuple[float, ...]
    albedo_factor: tuple[float, ...]
    highlight: tuple[float, ...]
    highlight_factor: tuple[float, ...]

    def record(self) -> dict[str, Any]:
        """Return the JSON form."""
        return asdict(self)


def aim_errors(aims: MeasuringAims, truth: np.ndarray, estimate: np.ndarray) -> AimErrors:
    """Return the errors of estimated values (P, C) against true values, at the pairs of the aims."""
    logs: dict[str, tuple[float, ...]] = {}
    squared = []
    for aim in aims.aims:
        own, theirs = (np.asarray(aim.sums @ values[aim.part]) for values in (estimate, truth))
        if aim.kind in ("albedo", "highlight"):
            ratio = np.maximum(own.mean(1), 1e-12) / np.maximum(theirs.mean(1), 1e-12)
            logs[aim.kind] = tuple(np.log(ratio).tolist())
        else:
            squared.append(_squared(aim, own, theirs))
    mean = float(np.mean(squared))
    return AimErrors(-10 * math.log10(mean) if mean > 0 else math.inf, logs["albedo"], logs["highlight"])


def _squared(aim: Aim, own: np.ndarray, truth: np.ndarray) -> float:
    exposure = aim.exposure(truth.max(1) if aim.kind == "lamp" else truth.mean(1))
    return float(np.mean((aim.displayed(own, exposure) - aim.displayed(truth, exposure)) ** 2))


def foretold(prior: BrdfPrior, posterior: BrdfPosterior, aims: MeasuringAims, seed: int = 0) -> Foretold:
    """Return the expected error of the mean of a posterior."""
    estimate = posterior.values(aims.matrix)
    errors = [aim_errors(aims, values, estimate) for values in _drawn(posterior, aims, seed)]
    psnr = np.array([each.psnr for each in errors])
    light = aims.light(estimate)
    widening = prior.widening

    def within(name: str) -> tuple[float, ...]:
        logs = np.abs(np.array([getattr(each, name) for each in errors]))
        return tuple(np.exp(widening.get(name, 1.0) * np.quantile(logs, COVERED, axis=0)).tolist())

    median = float(np.median(psnr)) + widening.get("psnr", 0.0)
    return Foretold(
        psnr=median,
        psnr_least=median - widening.get("psnr_spread", 1.0) * float(np.median(psnr) - np.quantile(psnr, 1 - COVERED)),
        degrees=DEGREES,
        albedo=tuple(light["albedo"][0].mean(1).tolist()),
        albedo_factor=within("albedo"),
        highlight=tuple(light["highlight"][0].mean(1).tolist()),
        highlight_factor=within("highlight"),
    )


def _drawn(posterior: BrdfPosterior, aims: MeasuringAims, seed: int) -> list[np.ndarray]:
    """Return values (P, C) of materials drawn from a posterior, at the pairs of the aims."""
    chance = np.random.default_rng(seed)
    count, size = len(posterior.shares), posterior.centres.shape[1]
    centres = chance.choice(count, DRAWS, p=posterior.shares)
    level = _root(posterior.covariance) @ chance.standard_normal((size, DRAWS)) * np.sqrt(posterior.scales[centres])
    logs = aims.matrix @ (posterior.centres[centres].T + level)
    root, ratios = _root(posterior.colour_covariance), posterior.ratios[:, :, None]
    colour = chance.standard_normal((len(ratios), size, DRAWS))
    tints = np.stack([aims.matrix @ (own + root @ noise) for own, noise in zip(ratios, colour, strict=True)], 1)
    tints = np.maximum(tints, 0)
    tints /= tints.mean(1, keepdims=True).clip(1e-9)
    # Above this logarithm no surface reflects: a draw far from all samples is a guess, not a sun.
    found = tints * np.exp(np.minimum(logs, 12.0))[:, None]
    return [found[..., number] for number in range(DRAWS)]


def _root(covariance: np.ndarray) -> np.ndarray:
    """Return the lower Cholesky factor of the covariance, regularized on its diagonal against rounding."""
    least = 1e-8 * float(np.trace(covariance)) / len(covariance) + 1e-12
    return np.linalg.cholesky((covariance + covariance.T) / 2 + least * np.eye(len(covariance)))
