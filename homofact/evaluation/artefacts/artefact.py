"""Classify visible errors in a picture of a fit: a needle, a ring, a rim, a hole or a spot.

A piece is a connected set of pixels that are all too bright or all too dark. The first of these rules that applies to
its place and shape determines its kind:

* rim: at most of its pixels, θi or θo is at least `GRAZING` degrees;
* ring: its pixels have nearly the same distance from the highlight (standard deviation at most `THIN` of the mean), and
  it covers at least a quarter of the circle around the highlight;
* needle: it is at least `LONG` times as long as wide, its axis passes through or near the highlight, and its centre is
  not far from the highlight;
* otherwise it is a spot if it is too bright, or a hole if it is too dark.

The distance from the highlight is the angle between the mirror direction of the view and the light. Under several
lamps, the lamp with the nearest highlight counts.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from homofact.evaluation.artefacts.views import View

GRAZING = 60.0  # degrees
MOSTLY = 0.6
THIN, LONG = 0.3, 3.0
ARM = 6.0  # a needle's arms start outside the highlight: their middle lies within so many times their spread
_BINS = 24  # of the turn about a highlight


class Kind(Enum):
    """The shape of an artefact. The value is the string in JSON records."""

    NEEDLE = "needle"
    RING = "ring"
    RIM = "rim"
    HOLE = "hole"
    SPOT = "spot"


@dataclass(frozen=True)
class Artefact:
    """A visible error in a picture of the fit that no picture of the source has.

    Attributes
    ----------
    kind : what it looks like.
    bright : True if it is too bright, False if it is too dark.
    where : its place, in words.
    size : the difference between the encoded pictures there, as a share of the range from black to white.
    area : the share of the sphere's pixels that it covers.
    view : the name of the picture that shows it best (`views.View.name`).
    """

    kind: Kind
    bright: bool
    where: str
    size: float
    area: float
    view: str

    @property
    def words(self) -> str:
        """A phrase that describes the artefact, for messages."""
        light = "bright" if self.bright else "dark"
        return (
            f"a {light} {self.kind.value} {self.where} ({self.size:.0%} of white too {light}, on {self.area:.1%}"
            f" of {_PICTURES[self.view]})"
        )

    def record(self) -> dict[str, Any]:
        """Return a JSON-able dictionary."""
        return {
            "kind": self.kind.value,
            "bright": self.bright,
            "where": self.where,
            "size": self.size,
            "area": self.area,
            "view": self.view,
        }


_PICTURES = {
    "lamp": "a sphere under a point light",
    "highlight": "a close-up of the highlight",
    "sky": "a sphere under small lamps",
}


def artefact_of(view: View, piece: np.ndarray, bright: bool, size: float) -> Artefact:
    """Return the artefact of a piece, a (H, W) bool mask; `size` is the difference between the pictures there."""
    inside = piece[view.inside]
    place = _Place.of(view, inside)
    kind = _kind(place, bright)
    return Artefact(kind, bright, _where(view, place, kind), size, float(inside.mean()), view.name)


@dataclass(frozen=True)
class _Place:
    """Where the n pixels of a piece are.

    `light` and `seen` are θi and θo, `off` the angle off the mirror direction, in degrees; `x` and `y` count from the
    highlight in the picture's plane, in units of the sphere's radius.
    """

    light: np.ndarray
    seen: np.ndarray
    off: np.ndarray
    x: np.ndarray
    y: np.ndarray

    @classmethod
    def of(cls, view: View, inside: np.ndarray) -> "_Place":
        """Return the place of the pixels `inside` (P,) bool, of those that show the sphere."""
        normal = view.normal[inside]
        seen = normal[:, 2]
        highlights = view.lights + np.array([0.0, 0.0, 1.0])
        highlights /= np.linalg.norm(highlights, axis=1, keepdims=True)
        nearest = int(np.argmax(highlights @ normal.mean(0)))
        light = view.lights[nearest]
        mirrored = 2 * seen[:, None] * normal - np.array([0.0, 0.0, 1.0])
        return cls(
            _degrees(normal @ light),
            _degrees(seen),
            _degrees(mirrored @ light),
            normal[:, 0] - highlights[nearest, 0],
            normal[:, 1] - highlights[nearest, 1],
        )


def _kind(place: _Place, bright: bool) -> Kind:
    if np.mean(np.maximum(place.light, place.seen) >= GRAZING) >= MOSTLY:
        return Kind.RIM
    if place.off.std() <= THIN * place.off.mean() and _turn(place) >= 0.25:
        return Kind.RING
    if _is_needle(place):
        return Kind.NEEDLE
    return Kind.SPOT if bright else Kind.HOLE


def _turn(place: _Place) -> float:
    """The part of the turn about the highlight that holds pixels."""
    angle = np.arctan2(place.y, place.x)
    return len(np.unique(np.floor((angle / (2 * np.pi) + 0.5) * _BINS).astype(int) % _BINS)) / _BINS


def _is_needle(place: _Place) -> bool:
    points = np.stack((place.x, place.y), 1)
    middle = points.mean(0)
    spread, axes = np.linalg.eigh(np.cov((points - middle).T) if len(points) > 1 else np.eye(2))
    width, length = np.sqrt(np.maximum(spread, 1e-12))
    if length < LONG * width:
        return False
    across = abs(float(axes[:, 0] @ middle))
    along = abs(float(axes[:, 1] @ middle))
    return across <= max(length / 2, 2 * width) and along <= ARM * length


def _where(view: View, place: _Place, kind: Kind) -> str:
    if kind is Kind.RIM:
        at_silhouette = np.median(place.seen) >= np.median(place.light)
        least = float(np.percentile(place.seen if at_silhouette else place.light, 10))
        if at_silhouette:
            return f"at the silhouette, seen from beyond {least:.0f}°"
        return f"at the shadow's edge, lit from beyond {least:.0f}°"
    which = "the highlight" if len(view.lights) == 1 else "a lamp's highlight"
    off = float(np.mean(place.off))
    if kind is Kind.RING:
        return f"around {which}, {off:.0f}° off the mirror direction"
    if kind is Kind.NEEDLE:
        return f"through {which}, up to {float(place.off.max()):.0f}° off the mirror direction"
    return f"{off:.0f}° off the mirror direction of {which}, seen from {float(np.median(place.seen)):.0f}°"


def _degrees(cosine: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
