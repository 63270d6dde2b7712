"""Find gross errors among samples (a blinded detector, stray light) by comparing each with its neighbours.

A smooth reciprocal fit of log f (`suspicion.evidence`) leaves a residual at every sample and channel. A real feature
that is too narrow for this fit, such as the lobe of a mirror, also affects the neighbouring samples; a gross error
affects one sample. Each sample is therefore compared with the median residual of three neighbourhoods, and is an
outlier only if it is far from all three:

* the `NEIGHBOURS` nearest samples in (√θh, θd, φd), or in (h, d) for anisotropic materials;
* the `BEFORE` samples with the next smaller θh, including itself: in a narrow highlight these are bright as well, and
  the innermost sample is compared only with itself;
* the `BEFORE` samples with the next smaller θd: the same for retro-reflection, which must appear in at least two
  samples.

The weight of a sample falls from 1 at `NEAR` to 0 at `FAR` times the usual distance (Hampel's redescending weights),
but only for deviations of at least a factor of exp `LEAST`. A certain outlier thus has no influence on the flux or on
the logarithms. Logs are log(f/median + `DARK`), so a zero is an outlier in a bright region and not in a dark one.

Two cases cannot be decided: an error at the sample nearest to the mirror direction, and a highlight elsewhere that only
one sample shows.
"""

from dataclasses import replace

import numpy as np
import torch

from homofact.brdf.quality.suspicion.evidence import Evidence
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.coordinates import coordinate_system, rusinkiewicz_angles
from homofact.geometry.nearest import tree_of

NEIGHBOURS, BEFORE = 16, 15
NEAR, FAR = 5.0, 8.0
LEAST = 0.5
DARK = 1e-2
MOST_AT_ONCE = 20_000
PASSES = 2
FEWEST = 4 * NEIGHBOURS
_NORMAL_MAD = 1.4826
_ROUNDING = 1e-3  # logs nearer than this are alike


def outlier_weights(samples: Samples, seed: int = 0) -> np.ndarray:
    """Return weights (N,) from 0 to 1 of the module's head; all 1 for fewer than `FEWEST` samples.

    More than `MOST_AT_ONCE` samples are processed in random parts, drawn by `seed`.
    """
    count = len(samples)
    trust = np.ones(count)
    if count < FEWEST:
        return trust
    # Ties between neighbours are decided by the numbers, not by the order in which samples come.
    rows = torch.cat((samples.wi, samples.wo, samples.values, samples.weights[:, None]), 1).cpu().numpy()
    sorted_rows = torch.from_numpy(np.lexsort(rows.T))
    order = torch.randperm(count, generator=torch.Generator().manual_seed(seed))
    for part in torch.chunk(order, -(-count // MOST_AT_ONCE)):
        own = sorted_rows[part.sort().values]
        trust[own.numpy()] = _of_part(samples.select(own.to(samples.wi.device)))
    return trust


def without_outliers(samples: Samples, seed: int = 0) -> tuple[Samples, float]:
    """Return (the samples with outliers removed or weighted down, the share of the total weight removed).

    Raises BadInput where hardly any weight is left.
    """
    share = torch.from_numpy(outlier_weights(samples, seed)).to(samples.weights)
    weights = samples.weights * share
    taken = 1 - float(weights.sum() / samples.weights.sum())
    if taken == 0:
        return samples, 0.0
    kept = (share > 0).nonzero()[:, 0]
    if not float(weights.sum()) > 0 or len(kept) < 2:
        raise BadInput("every sample stands alone", where="robust", expected="neighbours that agree with each other")
    return replace(samples, weights=weights).select(kept), taken


def _of_part(samples: Samples) -> np.ndarray:
    """The weights of samples that are looked at together: found `PASSES` times, each time from the fit of the last."""
    theta_h, theta_d, _ = (angle.cpu().numpy() for angle in rusinkiewicz_angles(samples.wi, samples.wo))
    place = _place(samples)
    near = np.asarray(tree_of(place).query(place, k=NEIGHBOURS + 1)[1])[:, 1:]
    neighbourhoods = (near, _before(theta_h, itself=True), _before(theta_d, itself=False))
    logs = _logs(samples)
    directions = (samples.wi.cpu().numpy(), samples.wo.cpu().numpy())
    evidence = Evidence(*directions, samples.values.cpu().numpy(), np.zeros(len(logs)))
    # All of them at first: a fit that never saw a highlight would take it for errors ever after.
    weights = np.ones(len(logs))
    for _ in range(PASSES):
        residual = np.stack([evidence.fitted(logs=channel, weight=weights + 1e-6).residual for channel in logs.T], 1)
        weights = _weights(residual, neighbourhoods)
    return weights


def _weights(residual: np.ndarray, neighbourhoods: tuple[np.ndarray, ...]) -> np.ndarray:
    """The weights (N,) of residuals (N, C), by the numbers (N, K) of each sample's neighbours of several kinds."""
    scale = _NORMAL_MAD * np.median(np.abs(residual), 0) + _ROUNDING
    distance = np.full(len(residual), np.inf)
    for beside in neighbourhoods:
        theirs = residual[beside]
        middle = np.median(theirs, 1)
        off = np.abs(residual - middle)
        # Where neighbours differ among each other one more that differs says little.
        spread = np.maximum(scale, _NORMAL_MAD * np.median(np.abs(theirs - middle[:, None]), 1))
        distance = np.minimum(distance, (off / np.maximum(spread, LEAST / NEAR)).max(1))
    return np.clip((FAR - distance) / (FAR - NEAR), 0, 1)


def _logs(samples: Samples) -> np.ndarray:
    """The logs (N, C) of the module's head."""
    values = samples.values.cpu().numpy()
    middle = np.array([np.median(channel[channel > 0]) if (channel > 0).any() else 1.0 for channel in values.T])
    return np.log(values / middle + DARK)


def _before(angle: np.ndarray, itself: bool) -> np.ndarray:
    """Return the indices (N, `BEFORE`) of the samples with the next smaller angles, with or without `itself`.

    The innermost samples have fewer of them, which are repeated for the missing ones. Without itself, the first sample
    gets the second.
    """
    order = np.argsort(angle, kind="stable")
    rank = np.empty(len(angle), dtype=np.int64)
    rank[order] = np.arange(len(angle))
    last = rank if itself else np.where(rank > 0, rank - 1, 1)
    place = last[:, None] - np.arange(BEFORE)
    first = np.where((rank == 0) & (not itself), 1, 0)[:, None]
    return order[np.where(place < first, first + place % (last[:, None] - first + 1), place)]


def _place(samples: Samples) -> np.ndarray:
    """Where samples are neighbours: near in (√θh, θd, φd) or, anisotropic, in the discs of h (θh by its root) and d."""
    if samples.isotropic:
        theta_h, theta_d, phi_d = (angle.cpu().numpy() for angle in rusinkiewicz_angles(samples.wi, samples.wo))
        along, across = np.sqrt(theta_h / (np.pi / 2)), theta_d / (np.pi / 2)
        folded = np.abs(np.arcsin(np.sin(phi_d))) / (np.pi / 2)
        return np.stack((along, across, folded * along * np.sin(theta_d)), 1)
    discs = coordinate_system("half-diff").evaluate(samples.wi, samples.wo).cpu().numpy()
    length = np.linalg.norm(discs[:, :2], axis=1, keepdims=True)
    return np.hstack((discs[:, :2] / np.sqrt(np.maximum(length, 1e-9)), discs[:, 2:]))
