"""What is found of a sample's tilt: an angle with its interval, and whether the odds are clear enough to undo it.

A tilt is claimed where

* the interval leaves out 0, and the angle is at least `LEAST` and not at the edge of the search;
* pairs whose half vector lies near the plane of incidence want half of the angle on their own: a tilt shows there most,
  while an anisotropic material that was read as isotropic lacks reciprocity out of that plane;
* the misfit falls by `LEAST_GAIN`, and its square by more than the part that is a table's own.
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
    """One angle in degrees with its 95% interval, and the relative misfit of the head without and with it undone.

    `near_plane` is the angle that pairs near the plane of incidence alone want, `own` the misfit that the table's nodes
    make of a reciprocal material, 0 where that is not known. `reason` says why the angle is not claimed; it is empty
    where it is.
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
        """Whether the odds are clear."""
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
    """What was found of a measurement: the angle in the plane of incidence and the one across it.

    `errors` are the words for the misfit of each.
    """

    in_plane: TiltAngle
    out_of_plane: TiltAngle
    errors: tuple[str, str] = ("reciprocity error", "mirror error")

    @property
    def tilt(self) -> Tilt | None:
        """What is to be undone; None where nothing is claimed."""
        angles = [angle.degrees if angle.claimed else 0.0 for angle in (self.in_plane, self.out_of_plane)]
        return Tilt(*(math.radians(angle) for angle in angles)) if any(angles) else None

    def record(self, undone: bool = True) -> dict[str, Any]:
        """Return a JSON-able dictionary of a tilt that is `undone`, or left in, where there is one.

        "words" are a line for people, of which "found" is what was found and "effect" what undoing it does.
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
        doing = "undone, which" if undone else f"{Advice('calibrate', 'tilt')} undoes it, which"
        return f"the sample was tilted by {what}", f"{doing} lowers {' and '.join(gains)}"


def doubted(angle: TiltAngle, law: str) -> TiltAngle:
    """The angle with the reason why it is not claimed, if there is one."""
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
        reason = (
            f"a tilt of {angle.degrees:+.3f}° ({span}) is possible, but undoing it lowers the error by only"
            f" {1 - angle.undone / angle.misfit:.1%} (from {angle.misfit:.2%}), expected at least {LEAST_GAIN:.0%}"
        )
    elif angle.misfit**2 - angle.undone**2 < angle.own**2:
        reason = (
            f"undoing a tilt of {angle.degrees:+.3f}° lowers the error from {angle.misfit:.2%} to {angle.undone:.2%},"
            f" by less than the table's own error of {angle.own:.2%}"
        )
    else:
        reason = ""
    return replace(angle, reason=reason)


def unknown(reason: str) -> TiltAngle:
    """Return an angle of which nothing is known, with the reason."""
    return TiltAngle(0.0, -SEARCHED, SEARCHED, 0.0, 0.0, 0.0, reason=reason)


def blocks_of(wi: Tensor, wo: Tensor, limit: float) -> Tensor:
    """Return the block of each pair (N,): `BLOCKS` by θd up to `limit` for those near the plane of incidence, then
    as many for the others."""
    edges = torch.linspace(0, limit, BLOCKS + 1, dtype=wi.dtype)[1:-1]
    block = torch.bucketize(rusinkiewicz_angles(wi, wo)[1].contiguous(), edges)
    (_, phi_h), (_, phi_i) = to_spherical(normalize(wi + wo)), to_spherical(wi)
    return block + BLOCKS * (torch.sin(phi_h - phi_i).abs() > 0.5)
