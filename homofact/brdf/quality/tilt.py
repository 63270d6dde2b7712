"""Find the tilt of a measured specimen from two laws of isotropic materials: reciprocity and mirror symmetry.

`brdf.tilt` derives the fault. For an angle δ the misfit is the relative RMS by which the straightened reflectance g
misses its own reciprocal mean,

    e(δ)² = Σ w (g(ωi, ωo) − g(ωo, ωi))² / Σ w (g(ωi, ωo) + g(ωo, ωi))²,    w = (cosθi cosθo)²/q,

over pairs drawn along the lobe (`brdf.pair_density`, density q) with both angles below `LIMIT`, where instruments are
reliable and tables are dense. e(0) is the smallest error that a reciprocal fit of the raw values can have. For the
angle η, the partner of a pair is its mirror image instead of the swapped pair.

Error from the nodes of a table. With few slices over θi, interpolation breaks the reciprocity of a reciprocal material,
which looks like a tilt. Therefore the reciprocal mean of the straightened reflectance is stored in a table with the
same nodes, and the tilt found in this table is subtracted. The misfit found in it is the part of e that the nodes
cause.

The interval comes from a bootstrap. Neighbouring pairs share the errors of one slice of the table, so the bootstrap
draws blocks of pairs by θd instead of single pairs. If different blocks suggest different angles, the interval is wide.

A tilt is claimed if the evidence is clear (`quality.tilt_finding`), and if it leaves a smaller misfit than a gain over
the angle, g(ωi, ωo) exp(c (θi² − θo²)) with one parameter c. A wrong cosine or an uneven lamp causes such a gain, which
resembles a tilt in a wide lobe.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.adaptive import refilled
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.pair_density import density, draw_lobe
from homofact.brdf.quality.least_angle import COARSE, FINE, LeastAngle, steps_round
from homofact.brdf.quality.tilt_finding import (
    BLOCKS,
    LEAST_MISFIT,
    SEARCHED,
    TiltAngle,
    TiltFinding,
    blocks_of,
    doubted,
    unknown,
)
from homofact.brdf.reflectance import Derived, Reflectance
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.table import AngleTable
from homofact.brdf.tilt import Straightened, Tilt
from homofact.geometry.directions import to_spherical

LIMIT = math.radians(70)
PAIRS = 7000
_FEW = 5
_Partner = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]


def find_tilt(reflectance: Reflectance, seed: int = 0) -> TiltFinding:
    """Return the tilt of an isotropic measurement that can be evaluated anywhere; the same seed gives the same bits."""
    pairs = _TiltPairs.drawn(seed)
    if _incidences(reflectance) < 2:
        nothing = unknown("light from one angle shows no reciprocity")
        return TiltFinding(nothing, nothing)
    found = _without_the_tables_own(pairs, reflectance, pairs.angle(reflectance, Tilt, _swapped))
    in_plane = doubted(pairs.with_undone(found, reflectance, Tilt, _swapped), "reciprocal")
    if in_plane.claimed and (levelled := pairs.levelled(reflectance)) < in_plane.undone:
        reason = (
            f"a gain over the angle explains the lack of reciprocity better (of {in_plane.misfit:.1%} it leaves "
            f"{levelled:.1%}, a tilt {in_plane.undone:.1%})"
        )
        in_plane = replace(in_plane, reason=reason)
    held = math.radians(in_plane.degrees) if in_plane.claimed else 0.0

    def across(angle: float) -> Tilt:
        return Tilt(held, angle)

    found = pairs.angle(reflectance, across, _mirrored)
    out_of_plane = doubted(pairs.with_undone(found, reflectance, across, _mirrored), "mirrored")
    return TiltFinding(in_plane, out_of_plane)


def _without_the_tables_own(pairs: "_TiltPairs", reflectance: Reflectance, found: TiltAngle) -> TiltAngle:
    """The angle less what the nodes of a table make of a reciprocal material."""
    if not isinstance(reflectance, AdaptiveTable) or found.misfit <= LEAST_MISFIT:
        return found
    straight = Straightened(reflectance, Tilt(math.radians(found.degrees)))
    own = pairs.angle(refilled(reflectance, ReciprocalMean(straight)), Tilt, _swapped, coarse=0.1)
    degrees = found.degrees - own.degrees
    low, high, near = (angle - own.degrees for angle in (found.low, found.high, found.near_plane))
    return TiltAngle(degrees, low, high, found.misfit, math.nan, near, own.misfit)


def _incidences(reflectance: Reflectance) -> int:
    """How many angles of the light a table holds; 2 of what is no table."""
    if isinstance(reflectance, AdaptiveTable):
        return len(reflectance.theta_i)
    return len(reflectance.axes[0].nodes) if isinstance(reflectance, AngleTable) else 2


def _swapped(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
    return wo, wi


def _mirrored(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
    image = wi.new_tensor([1, -1, 1])
    return wi * image, wo * image


class ReciprocalMean(Derived):
    """(f(ωi, ωo) + f(ωo, ωi))/2 of an isotropic reflectance."""

    isotropic = True

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return values (N, C) in sr⁻¹."""
        return (self.base.evaluate(wi, wo) + self.base.evaluate(wo, wi)) / 2


@dataclass(frozen=True)
class _TiltPairs:
    """Pairs (N, 3), weights (N,) and the block of each: by θd, those near the plane of incidence before the others."""

    wi: Tensor
    wo: Tensor
    weight: Tensor
    block: Tensor

    @classmethod
    def drawn(cls, seed: int) -> "_TiltPairs":
        """Return pairs of the scheme lobe within the limit."""
        wi, wo = draw_lobe(2 * PAIRS, torch.Generator().manual_seed(seed))
        within = torch.minimum(wi[:, 2], wo[:, 2]) > math.cos(LIMIT)
        wi, wo = wi[within][:PAIRS], wo[within][:PAIRS]
        weight = (wi[:, 2] * wo[:, 2]) ** 2 / density("lobe", wi, wo)
        return cls(wi, wo, weight, blocks_of(wi, wo, LIMIT))

    def angle(
        self, reflectance: Reflectance, tilt: Callable[[float], Tilt], partner: _Partner, coarse: float = SEARCHED
    ) -> TiltAngle:
        """The angle within `coarse` degrees that makes pairs and their partners most alike; `undone` is not known."""

        def blocks(pairs: _TiltPairs, degrees: float) -> np.ndarray:
            return pairs._blocks(Straightened(reflectance, tilt(math.radians(degrees))), partner)

        upright = blocks(self, 0.0)
        misfit = _ratio(upright)
        if misfit <= LEAST_MISFIT:
            return TiltAngle(0.0, 0.0, 0.0, misfit, misfit, 0.0)
        search = LeastAngle(lambda degrees: blocks(self, degrees), {0.0: upright})
        steps = steps_round(0.0, coarse, COARSE, SEARCHED)
        # Where the way is long, a fifth of the pairs at every other step say about where it ends.
        few = self.every(_FEW)
        guess = min(steps[::2], key=lambda degrees: _ratio(blocks(few, degrees))) if coarse == SEARCHED else 0.0
        best = search.best_of(steps, guess)
        grid = sorted({*steps, *steps_round(best, 2 * COARSE, FINE, SEARCHED)})
        degrees, (low, high), near = search.answer(grid, best)
        return TiltAngle(degrees, low, high, misfit, math.nan, near)

    def every(self, step: int) -> "_TiltPairs":
        """Return every pair whose number divides by `step`."""
        return _TiltPairs(*(part[::step].contiguous() for part in (self.wi, self.wo, self.weight, self.block)))

    def with_undone(
        self, angle: TiltAngle, reflectance: Reflectance, tilt: Callable[[float], Tilt], partner: _Partner
    ) -> TiltAngle:
        """Return the angle with the misfit that is left when it is undone."""
        if not math.isnan(angle.undone):
            return angle
        straight = Straightened(reflectance, tilt(math.radians(angle.degrees)))
        return replace(angle, undone=_ratio(self._blocks(straight, partner)))

    def levelled(self, reflectance: Reflectance) -> float:
        """Return the misfit that the best gain exp(c θ²) leaves of pairs and swapped pairs, to first order in c."""
        apart, both = self._parts(reflectance, _swapped)
        theta_i, theta_o = (to_spherical(w)[0] for w in (self.wi, self.wo))
        column = both * (theta_i**2 - theta_o**2)[:, None]
        left = apart - column * ((column * apart).sum() / (column**2).sum().clamp_min(1e-300))
        return float(left.norm() / both.norm())

    def _parts(self, reflectance: Reflectance, partner: _Partner) -> tuple[Tensor, Tensor]:
        """√w times difference and sum (N, C) of the values at pairs and partners."""
        pairs = ((self.wi, self.wo), partner(self.wi, self.wo))
        one, two = (self.weight.sqrt()[:, None] * reflectance.evaluate(*pair).double() for pair in pairs)
        return one - two, one + two

    def _blocks(self, reflectance: Reflectance, partner: _Partner) -> np.ndarray:
        """Sums (2, 2 BLOCKS) of the squared parts."""
        sums = ((part**2).sum(1) for part in self._parts(reflectance, partner))
        return np.stack([np.bincount(self.block, part, 2 * BLOCKS) for part in sums])


def _ratio(sums: np.ndarray) -> float:
    """e of sums (2, 2 BLOCKS)."""
    apart, both = sums.sum(1)
    return math.sqrt(apart / both) if both > 0 else 0.0
