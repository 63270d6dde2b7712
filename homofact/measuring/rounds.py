"""Plan a round of measuring: estimate the material, choose the next directions, and predict their benefit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical
from homofact.measuring.aims import MeasuringAims, measuring_aims
from homofact.measuring.choosing import Uncertainty, chosen_groups, chosen_rows, uncertainties
from homofact.measuring.foretelling import Foretold, foretold
from homofact.measuring.goniometer import Goniometer, directions_of
from homofact.measuring.posterior import BrdfPosterior, after_samples, before_samples
from homofact.measuring.prior import BrdfPrior
from homofact.measuring.route import seconds, shortest_order

if TYPE_CHECKING:
    from homofact.brdf.samples import Samples

# The stop rule looks so many incidences ahead.
RINGS_AHEAD = 3
# More samples do not change the answer, but its time.
MOST_SAMPLES = 2000
# Samples at one place, in degrees, whose brightness differs by more than the factor contradict each other.
_SAME_PLACE, _CONTRADICTS = 0.05, 1.5
_DARK = 2e-3


@dataclass(frozen=True)
class MeasuringRound:
    """What to measure next.

    Attributes
    ----------
    posterior : the distribution of the material given the samples so far.
    foretold : the expected error of the estimate now.
    angles : (N, 3) θi, θo, φ in degrees, in the order of measuring.
    incidences : the chosen θi in degrees, best first; empty if single directions were chosen.
    seconds, seconds_unordered : duration of all moves in seconds, in this order and in the order of choice.
    remaining : the share of the expected squared error that remains after these measurements.
    change, change_by_rings : the expected change of the pictures, relative to their light, by these measurements, and
        by the best `RINGS_AHEAD` incidences.
    """

    posterior: BrdfPosterior
    foretold: Foretold
    angles: np.ndarray
    incidences: tuple[float, ...]
    seconds: float
    seconds_unordered: float
    remaining: float
    change: float
    change_by_rings: float


def check_samples(samples: "Samples") -> None:
    """Reject samples from which no estimate is possible.

    Raises BadInput for anisotropic or all-zero samples, and if two samples of one pair of directions contradict each
    other.
    """
    if not samples.isotropic:
        raise BadInput(
            where="samples",
            found="an anisotropic material",
            expected="an isotropic one: directions are chosen for isotropic materials alone",
        )
    if not bool(samples.values.any()):
        raise BadInput(where="samples", found="values that are all 0", expected="some light")
    from scipy.spatial import KDTree

    (theta_i, phi_i), (theta_o, phi_o) = to_spherical(samples.wi), to_spherical(samples.wo)
    turn = (phi_o - phi_i).abs().rad2deg()
    turn = np.minimum(turn.numpy(), 360 - turn.numpy())
    # Near the normal an azimuth is a smaller angle.
    across = turn * np.sqrt((theta_i.sin() * theta_o.sin()).numpy())
    places = np.stack((theta_i.rad2deg().numpy(), theta_o.rad2deg().numpy(), across), 1)
    pairs = KDTree(places).query_pairs(_SAME_PLACE, output_type="ndarray")
    bright = samples.values.mean(1).numpy() + _DARK
    ratio = np.maximum(bright[pairs[:, 0]] / bright[pairs[:, 1]], bright[pairs[:, 1]] / bright[pairs[:, 0]])
    count = int((ratio > _CONTRADICTS).sum())
    if count:
        one, other = sorted(pairs[int(np.argmax(ratio))].tolist())
        at = f"theta_i {places[one, 0]:.4g}, theta_o {places[one, 1]:.4g}, phi {turn[one]:.4g} degrees"
        raise BadInput(
            f"samples {one + 1} and {other + 1}{f', and {count - 1} other pairs,' if count > 1 else ''} contradict each"
            " other:"
            f" {bright[one] - _DARK:.3g} and {bright[other] - _DARK:.3g} sr⁻¹ at {at}",
            where="samples",
            expected=f"values within a factor of {_CONTRADICTS} at one place: remove the wrong ones, or average them",
        )  # fmt: skip


def posterior_of(prior: BrdfPrior, samples: "Samples | None", channels: int, seed: int = 0) -> BrdfPosterior:
    """Return the posterior given at most `MOST_SAMPLES` of the samples, or the prior if there are none."""
    if samples is None:
        return before_samples(prior, channels)
    return after_samples(prior, samples.subset(MOST_SAMPLES, seed))


def next_round(
    prior: BrdfPrior, posterior: BrdfPosterior, goniometer: Goniometer, *, directions: int = 0, incidences: int = 0
) -> MeasuringRound:
    """Choose the next `directions` single measurements, or `incidences` angles of incidence with all views.

    Raises BadInput where the goniometer can measure none of them.
    """
    aims = measuring_aims(prior.grid)
    blocks = uncertainties(posterior, aims.weights(posterior))
    rings = goniometer.incidences()
    groups = [prior.grid.matrix(*directions_of(ring)) for ring in rings]
    chosen: tuple[float, ...] = ()
    if directions:
        angles = _single(prior, blocks, goniometer, directions)
        ahead = chosen_groups(blocks, groups, RINGS_AHEAD)
    else:
        ahead = chosen_groups(blocks, groups, max(incidences, RINGS_AHEAD))
        angles = np.concatenate([rings[number] for number in ahead[:incidences]])
        chosen = tuple(float(rings[number][0, 0]) for number in ahead[:incidences])
    moves, first = goniometer.moves(angles), goniometer.first_moves(angles)
    order = shortest_order(moves, first)
    matrix = prior.grid.matrix(*directions_of(angles))
    wide = np.concatenate([rings[number] for number in ahead[:RINGS_AHEAD]])
    return MeasuringRound(
        posterior,
        foretold(prior, posterior, aims),
        angles[order],
        chosen,
        seconds(order, moves, first),
        seconds(list(range(len(angles))), moves, first),
        remaining(blocks, matrix),
        picture_change(aims, posterior, blocks[0].taken(matrix)),
        picture_change(aims, posterior, blocks[0].taken(prior.grid.matrix(*directions_of(wide)))),
    )


def chosen_angles(prior: BrdfPrior, posterior: BrdfPosterior, goniometer: Goniometer, directions: int) -> np.ndarray:
    """Return only the angles (N, 3) that `next_round` would choose, best first."""
    weights = measuring_aims(prior.grid).weights(posterior)
    return _single(prior, uncertainties(posterior, weights), goniometer, directions)


def _single(prior: BrdfPrior, blocks: Sequence[Uncertainty], goniometer: Goniometer, count: int) -> np.ndarray:
    candidates = goniometer.directions()
    return candidates[chosen_rows(blocks, prior.grid.matrix(*directions_of(candidates)), count)]


def remaining(blocks: Sequence[Uncertainty], matrix: object) -> float:
    """Return the share of the expected squared error that remains after measuring the rows of a matrix."""
    before = sum(float((block.weights * block.covariance).sum()) for block in blocks)
    after = before - sum(block.gain(matrix) for block in blocks)  # type: ignore[arg-type]
    return max(after, 0.0) / max(before, 1e-300)


def picture_change(aims: MeasuringAims, posterior: BrdfPosterior, taken: np.ndarray) -> float:
    """Return Σ E|change| / Σ light of the pictures for measurements that lower the covariance of L by Gᵀ G.

    The change of the estimate is Gaussian with the covariance Gᵀ G. Its mean absolute value is √(2/π) of its standard
    deviation.
    """
    parts = []
    for aim, rows in aims.slopes(posterior.mean, of_light=True):
        if aim.kind in ("lamp", "sky"):
            moved = np.asarray(rows @ taken.T)
            light = np.asarray(aim.sums @ posterior.values(aims.matrix[aim.part]).mean(1))
            parts.append(np.sqrt(2 / np.pi) * float(np.sqrt((moved**2).sum(1)).sum()) / max(float(light.sum()), 1e-12))
    return float(np.mean(parts))
