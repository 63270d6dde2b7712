"""Curves f(γ) over an angle in [0, π/2], which users edit, and the bands in which pictures represent them.

A curve is any function of γ with C channels: a formula of a model (`Formula`), piecewise linear between knots
(`Knots`), or constant on each of J bands (`Bands`, the box functions of Ben-Artzi et al. 2006, eq. 8). Bands are equal,
or finer near 0 with edges at π/2 (k/J)². Curves over θh and the other angles of highlights use the finer bands: with J
= 256 the first is .0014° wide, the band at 3° .13°, the last .7°. `banded` converts any curve to bands by its mean over
each band, not by its value at the centre (appendix B). So a narrow peak that moves by less than a band still changes
the picture smoothly. `band_deviation` measures the difference between the curve and its bands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from homofact.editing.angles import RIGHT_ANGLE
from homofact.errors import BadInput

# What a curve may be divided into, the finest first.
BANDS = (256, 128, 64, 32)
_NODES, _LOOKED_AT = 8, 33


class Curve(Protocol):
    """Non-negative f(γ) of C channels."""

    @property
    def channels(self) -> int:
        """C."""
        ...

    def at(self, gamma: Tensor) -> Tensor:
        """Return values (N, C) at angles (N,) in radians."""
        ...


@dataclass(frozen=True)
class Formula:
    """A curve given by a function of γ (N,) with values (N, C); `words` describe it."""

    function: Callable[[Tensor], Tensor]
    channels: int
    words: str = ""

    def at(self, gamma: Tensor) -> Tensor:
        """Return values (N, C) at angles (N,) in radians."""
        return self.function(gamma)


def flat(channels: int, level: float = 1.0) -> Formula:
    """Return the curve that is `level` everywhere."""
    return Formula(lambda gamma: torch.full((*gamma.shape, channels), level, dtype=gamma.dtype), channels, "constant")


@dataclass(frozen=True)
class Knots:
    """A piecewise linear curve through M values (M, C) at equal steps of γ from 0 to π/2, or its exponential.

    If `logs` is true, `values` are logarithms of the curve, and the logarithm is piecewise linear.
    """

    values: Tensor
    logs: bool = False

    @property
    def channels(self) -> int:
        """C."""
        return int(self.values.shape[1])

    def at(self, gamma: Tensor) -> Tensor:
        """Return values (N, C) at angles (N,) in radians."""
        number, share = hat(gamma, len(self.values))
        values = self.values.to(gamma)
        found = torch.lerp(values[number], values[number + 1], share[:, None])
        return torch.exp(found) if self.logs else found


def hat(gamma: Tensor, knots: int) -> tuple[Tensor, Tensor]:
    """Return (lower knot (N,) int64, share (N,) of the next) of angles among `knots` equal steps from 0 to π/2."""
    place = (gamma / RIGHT_ANGLE * (knots - 1)).clamp(0, knots - 1)
    number = place.floor().to(torch.int64).clamp_max(knots - 2)
    return number, place - number


@dataclass(frozen=True)
class Bands:
    """Constant on each of J bands of [0, π/2]: `values` (J, C) float64; `finer`: the bands are finer near 0.

    Raises BadInput if `values` is not such a table, is negative or not finite, or if J is not one of `BANDS`.
    """

    values: Tensor
    finer: bool = False

    def __post_init__(self) -> None:
        """Reject invalid values of a curve."""
        shape = tuple(self.values.shape)
        if len(shape) != 2 or shape[0] not in BANDS or shape[1] < 1:
            wanted = f"({' or '.join(map(str, BANDS))}, C)"
            raise BadInput(where="curve", found=f"values of the shape {shape}", expected=wanted)
        bad = ~torch.isfinite(self.values) | (self.values < 0)
        if bool(bad.any()):
            band, channel = (int(place) for place in bad.nonzero()[0])
            found = float(self.values[band, channel])
            what = f"value {band} of channel {channel} is {found}"
            raise BadInput(what, where="curve", expected="finite numbers >= 0")

    @property
    def channels(self) -> int:
        """C."""
        return int(self.values.shape[1])

    @property
    def count(self) -> int:
        """J."""
        return int(self.values.shape[0])

    def at(self, gamma: Tensor) -> Tensor:
        """Return values (N, C) at angles (N,) in radians."""
        return self.values.to(gamma)[band_of(gamma, self.count, self.finer)]


def widened(curve: Bands, factor: float) -> Bands:
    """Return the curve with its angles multiplied by `factor`, interpolated between the centres of bands.

    Above 1 it makes a highlight wider, below 1 narrower; its height stays. Raises BadInput unless factor > 0.
    """
    if not (math.isfinite(factor) and factor > 0):
        raise BadInput(where="factor", found=factor, expected="a number above 0")
    middles = torch.arange(curve.count, dtype=torch.float64) + 0.5
    # Finer bands count the roots of angles.
    place = (middles / (math.sqrt(factor) if curve.finer else factor) - 0.5).clamp(0, curve.count - 1)
    low = place.floor().to(torch.int64).clamp_max(curve.count - 2)
    return Bands(torch.lerp(curve.values[low], curve.values[low + 1], (place - low)[:, None]), curve.finer)


def band_place(gamma: Tensor, count: int, finer: bool = False) -> Tensor:
    """Return band coordinates (N,) of angles: k at the lower edge of band k, clamped to 0 and J."""
    share = (gamma / RIGHT_ANGLE).clamp(0, 1)
    return (share.sqrt() if finer else share) * count


def band_of(gamma: Tensor, count: int, finer: bool = False) -> Tensor:
    """Return the band (N,) int64 of each angle; angles outside [0, π/2] get the nearest band."""
    return band_place(gamma, count, finer).floor().to(torch.int64).clamp_max(count - 1)


def band_edges(count: int, finer: bool = False) -> Tensor:
    """Return the J + 1 edges in radians."""
    share = torch.arange(count + 1, dtype=torch.float64) / count
    return RIGHT_ANGLE * (share**2 if finer else share)


def band_centres(count: int, finer: bool = False) -> Tensor:
    """Return the J centres in radians."""
    edges = band_edges(count, finer)
    return (edges[:-1] + edges[1:]) / 2


def banded(curve: Curve, count: int, finer: bool = False) -> Bands:
    """Return the curve's mean over each of `count` bands (appendix B), by 8 Gauss-Legendre nodes a band.

    Bands of the same number and kind are returned unchanged. For other bands the means are exact.
    """
    if isinstance(curve, Bands):
        return _rebanded(curve, count, finer)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    values = curve.at(_within(count, finer, torch.from_numpy((nodes + 1) / 2))).reshape(count, _NODES, -1)
    return Bands((values * torch.from_numpy(weights / 2)[:, None]).sum(1).clamp_min(0), finer)


def _rebanded(curve: Bands, count: int, finer: bool) -> Bands:
    """Return a curve with other bands: means over the new bands of the piecewise constant `curve`."""
    if (curve.count, curve.finer) == (count, finer):
        return curve
    edges, wanted = band_edges(curve.count, curve.finer), band_edges(count, finer)
    integral = torch.cat((torch.zeros(1, curve.channels), (curve.values * edges.diff()[:, None]).cumsum(0))).double()
    number = band_of(wanted, curve.count, curve.finer)
    below = integral[number] + curve.values[number] * (wanted - edges[number])[:, None]
    return Bands((below.diff(dim=0) / wanted.diff()[:, None]).clamp_min(0), finer)


def _within(count: int, finer: bool, place: Tensor) -> Tensor:
    """Return the angles (J·n,) at relative positions `place` (n,), from 0 to 1, in every band."""
    edges = band_edges(count, finer)
    return (edges[:-1, None] + edges.diff()[:, None] * place).reshape(-1)


def band_deviation(curve: Curve, count: int, finer: bool = False) -> Tensor:
    """Return the largest deviation (J, C) of the curve from its band means, at 33 angles per band."""
    means = banded(curve, count, finer).values
    place = torch.linspace(0, 1, _LOOKED_AT, dtype=torch.float64)
    values = curve.at(_within(count, finer, place)).reshape(count, _LOOKED_AT, -1)
    return (values - means[:, None]).abs().amax(1)
