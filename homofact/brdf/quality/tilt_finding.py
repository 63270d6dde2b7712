"""The result of the search for a specimen's tilt: an angle, its interval, and whether it is certain enough to undo.

A tilt is claimed where

* the interval does not contain 0, and the angle is at least `LEAST` and not at the edge of the search range;
* pairs whose half vector is near the plane of incidence, on their own, give at least half of the angle. A tilt has its
  largest effect there, while an anisotropic material that was read as isotropic breaks reciprocity outside that plane;
* undoing the tilt lowers the misfit by `LEAST_GAIN`, and its square by at least the square of the misfit that the
  table's nodes cause.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from homofact.brdf.quality.least_angle import COARSE
from homofact.brdf.tilt import Tilt
from homofact.errors import Advice
from homofact.geometry.coordinates import rusinkiewicz_angles
from homofact.geometry.directions import normalize, to_spherical

SEARCHED = 0.6  # degrees to both sides
BLOCKS = 14
LEAST = 0.005  # degrees
LEAST_GAIN = 0.1
LEAST_NEAR_PLANE = 0.5
LEAST_MISFIT = 2e-3  # below it nothing is looked for: a clean table


@dataclass(frozen=True)
class TiltAngle:
    """One angle in degrees with its 95% interval, and the relative misfit before and after undoing it.

    `near_plane` is the angle from pairs near the plane of incidence alone. `own` is the misfit that the table's nodes
    cause for a reciprocal material, 0 if unknown. `reason` explains why the angle is not claimed; it is empty if it is
    claimed.
    """

    degrees: float
    low: float
    high: float
    misfit: float
    undone: float
    near_plane: float
    own: float = 0.0
    reason: str = ""

    @property
    def claimed(self) -> bool:
        """Whether the evidence is clear enough to undo the tilt."""
        return not self.reason

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {
            "degrees": round(self.degrees, 4),
            "interval": [round(self.low, 4), round(self.high, 4)],
            "misfit": round(self.misfit, 5),
            "misfit_undone": round(self.undone, 5),
            "misfit_of_the_table": round(self.own, 5),
            "near_the_plane_of_incidence": round(self.near_plane, 4),
            "claimed": self.claimed,
            **({"reason": self.reason} if self.reason else {}),
        }


@dataclass(frozen=True)
class TiltFinding:
    """The tilt found in a measurement: the angle in the plane of incidence and the angle across it.

    `errors` are the names of the two misfits in messages.
    """

    in_plane: TiltAngle
    out_of_plane: TiltAngle
    errors: tuple[str, str] = ("reciprocity error", "mirror error")

    @property
    def tilt(self) -> Tilt | None:
        """The tilt to undo; None if no angle is claimed."""
        angles = [angle.degrees if angle.claimed else 0.0 for angle in (self.in_plane, self.out_of_plane)]
        return Tilt(*(math.radians(angle) for angle in angles)) if any(angles) else None

    def record(self, undone: bool = True) -> dict[str, Any]:
        """Return a JSON-able dictionary; `undone` tells whether a claimed tilt was undone or left in.

        "words" is a line of text with two parts: "found" describes the tilt, and "effect" what undoing it changes.
        """
        angles = {"in_plane": self.in_plane.record(), "out_of_plane": self.out_of_plane.record()}
        tilted, (found, effect) = self.tilt is not None, self._parts(undone)
        return angles | {
            "undone": tilted and undone,
            "left_in": tilted and not undone,
            "words": self.line(undone),
            "found": found,
            "effect": effect,
        }

    def line(self, undone: bool = True) -> str:
        """Return one line for people."""
        return ": ".join(self._parts(undone))

    def _parts(self, undone: bool) -> tuple[str, str]:
        places = ("in the plane of incidence", "across the plane of incidence")
        found = [
            (angle, f"{angle.degrees:+.3f}° {where} (95% interval {angle.low:+.3f}° to {angle.high:+.3f}°)", error)
            for where, error, angle in zip(places, self.errors, (self.in_plane, self.out_of_plane), strict=True)
            if angle.claimed
        ]
        if not found:
            return f"no tilt of the sample {'undone' if undone else 'found'}", self.in_plane.reason
        what = " and ".join(words for _, words, _ in found)
        gains = (f"the {error} from {angle.misfit:.1%} to {angle.undone:.1%}" for angle, _, error in found)
        doing = "homofact undid it, which" if undone else f"{Advice('calibrate', 'tilt')} undoes it, which"
        return f"the sample was tilted by {what}", f"{doing} lowers {' and '.join(gains)}"


def doubted(angle: TiltAngle, law: str) -> TiltAngle:
    """Return the angle with the reason why it is not claimed, or with an empty reason."""
    span = f"95% interval {angle.low:+.3f}° to {angle.high:+.3f}°"
    if angle.misfit <= LEAST_MISFIT:
        reason = f"the values are {law} within {LEAST_MISFIT:.1%}"
    elif angle.low <= 0 <= angle.high:
        reason = f"0 lies within the {span}"
    elif abs(angle.degrees) > SEARCHED - COARSE:
        reason = f"no angle within {SEARCHED:g}° makes the values {law} (error {angle.misfit:.1%})"
    elif abs(angle.degrees) < LEAST:
        reason = f"{angle.degrees:+.3f}° is too small to matter ({span})"
    elif law != "mirrored" and angle.near_plane / angle.degrees < LEAST_NEAR_PLANE:
        reason = (
            f"pairs near the plane of incidence want {angle.near_plane:+.3f}° and all pairs {angle.degrees:+.3f}°,"
            " which no tilt explains"
        )
    elif angle.undone > (1 - LEAST_GAIN) * angle.misfit:
        gain = 1 - angle.undone / angle.misfit
        only = f"lowers the error by only {gain:.1%}, expected at least {LEAST_GAIN:.0%}"
        reason = f"the best tilt, {angle.degrees:+.3f}°, {only if gain > 0 else 'does not lower the error'}"
    elif angle.misfit**2 - angle.undone**2 < angle.own**2:
        reason = (
            f"undoing a tilt of {angle.degrees:+.3f}° lowers the error from {angle.misfit:.2%} to {angle.undone:.2%},"
            f" by less than the table's own error of {angle.own:.2%}"
        )
    else:
        reason = ""
    return replace(angle, reason=reason)


def unknown(reason: str) -> TiltAngle:
    """Return an undetermined angle, with the reason."""
    return TiltAngle(0.0, -SEARCHED, SEARCHED, 0.0, 0.0, 0.0, reason=reason)


def blocks_of(wi: Tensor, wo: Tensor, limit: float) -> Tensor:
    """Return the block of each pair (N,): `BLOCKS` by θd up to `limit` for those near the plane of incidence, then
    as many for the others."""
    edges = torch.linspace(0, limit, BLOCKS + 1, dtype=wi.dtype)[1:-1]
    block = torch.bucketize(rusinkiewicz_angles(wi, wo)[1].contiguous(), edges)
    (_, phi_h), (_, phi_i) = to_spherical(normalize(wi + wo)), to_spherical(wi)
    return block + BLOCKS * (torch.sin(phi_h - phi_i).abs() > 0.5)
