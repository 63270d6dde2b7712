"""Quotients as tables for the page's preview: by θh, θd, φd and, where a material is not isotropic, φh (Rusinkiewicz).

The table stores ρ_q (cosθi + cosθo)² = ρ_q (2 cosθh cosθd)², which stays smooth where both directions graze and models
grow without bound. Levels lie at θh = π/2 u², dense near highlights, and at equal steps of θd. Both azimuths cover the
full circle, since a quotient need not be reciprocal or mirror-symmetric. Directions below the horizon are moved up to
it, so that interpolation stays smooth there. A constant quotient is stored as one number per channel. The page shows
the measured error of the table. Only the preview uses the table; rendered pictures do not.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from homofact.editing.angles import RIGHT_ANGLE
from homofact.editing.material import EditableTerm
from homofact.editing.pairs import pairs_of
from homofact.geometry.directions import normalize

# Levels of θh, θd, φd and φh.
ISOTROPIC, ANISOTROPIC = (48, 32, 32, 1), (32, 12, 16, 16)
_LOWEST, _SAME = 0.02, 1e-6
_PAIRS, _SEED = 2000, 3


@dataclass(frozen=True)
class QuotientTable:
    """`values` (φh, φd, θd, θh, C) float64: what is tabulated, or a constant quotient as it is."""

    values: np.ndarray

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Levels of θh, θd, φd and φh; all 1 where the quotient is the same everywhere."""
        around, about, difference, half = self.values.shape[:4]
        return half, difference, about, around

    def at(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Interpolated values (N, C), as the page's shader does it."""
        angles = to_rusinkiewicz(wi, wo)
        half, difference, about, around = self.sizes
        places = [
            _between((angles[0] / RIGHT_ANGLE).clamp(0, 1).sqrt() * (half - 1), half),
            _between((angles[1] / RIGHT_ANGLE).clamp(0, 1) * (difference - 1), difference),
            _around(angles[2], about),
            _around(angles[3], around),
        ]
        table = torch.from_numpy(self.values)
        total = torch.zeros(len(wi), table.shape[-1], dtype=torch.float64)
        for corner in range(16):
            picks = [places[axis][corner >> axis & 1] for axis in range(4)]
            weight = picks[0][1] * picks[1][1] * picks[2][1] * picks[3][1]
            total += weight[:, None] * table[picks[3][0], picks[2][0], picks[1][0], picks[0][0]]
        return total if self.sizes == (1, 1, 1, 1) else total / (wi[:, 2:] + wo[:, 2:]) ** 2

    def error(self, term: EditableTerm) -> float:
        """Relative RMS of ρ cosθi cosθo of the term as it starts, table against quotient, over fixed directions."""
        wi, wo = pairs_of(_PAIRS, _SEED)
        quotient, weights = term.quotient(wi, wo), wi[:, 2:] * wo[:, 2:]
        curves = torch.where(quotient > 0, term.evaluate(wi, wo) / quotient, torch.zeros_like(quotient)) * weights
        size = float((quotient * curves).square().mean())
        off = float(((self.at(wi, wo) - quotient) * curves).square().mean())
        return math.sqrt(off / size) if size > 0 else 0.0


def quotient_table(term: EditableTerm) -> QuotientTable:
    """Return the table of a term's quotient."""
    wi, wo = pairs_of(_PAIRS, _SEED)
    values = term.quotient(wi, wo)
    if bool((values == values[:1]).all()):
        return QuotientTable(values[:1].reshape(1, 1, 1, 1, -1).numpy().copy())
    sizes = ISOTROPIC if is_isotropic(term, wi, wo, values) else ANISOTROPIC
    half, difference, about, around = sizes
    theta_h = RIGHT_ANGLE * torch.linspace(0, 1, half, dtype=torch.float64) ** 2
    theta_d = RIGHT_ANGLE * torch.linspace(0, 1, difference, dtype=torch.float64)
    phi_d, phi_h = (torch.arange(count, dtype=torch.float64) * (2 * math.pi / count) for count in (about, around))
    grid = torch.meshgrid(phi_h, phi_d, theta_d, theta_h, indexing="ij")
    wi, wo = (lifted(each) for each in from_rusinkiewicz(*(grid[k].reshape(-1) for k in (3, 2, 1, 0))))
    values = term.quotient(wi, wo) * (wi[:, 2:] + wo[:, 2:]) ** 2
    return QuotientTable(values.reshape(around, about, difference, half, -1).numpy())


def is_isotropic(term: EditableTerm, wi: Tensor, wo: Tensor, values: Tensor) -> bool:
    """Return whether the quotient stays the same when both directions are turned about the normal together."""
    turned = (torch.stack((y, -x, z), 1) for x, y, z in (wi.unbind(1), wo.unbind(1)))
    other = term.quotient(*turned)
    return float((other - values).abs().max()) <= _SAME * float(values.abs().max())


def lifted(w: Tensor) -> Tensor:
    """Return unit directions with their height above the horizon at least `_LOWEST`."""
    return normalize(torch.cat((w[:, :2], w[:, 2:].clamp_min(_LOWEST)), 1))


def from_rusinkiewicz(theta_h: Tensor, theta_d: Tensor, phi_d: Tensor, phi_h: Tensor) -> tuple[Tensor, Tensor]:
    """(wi, wo) (N, 3) of half and difference angles; φd counted from where the half vector's meridian leads down."""
    along = torch.stack((theta_h.cos() * phi_h.cos(), theta_h.cos() * phi_h.sin(), -theta_h.sin()), 1)
    across = torch.stack((-phi_h.sin(), phi_h.cos(), torch.zeros_like(phi_h)), 1)
    h = torch.stack((theta_h.sin() * phi_h.cos(), theta_h.sin() * phi_h.sin(), theta_h.cos()), 1)
    side = along * (theta_d.sin() * phi_d.cos())[:, None] + across * (theta_d.sin() * phi_d.sin())[:, None]
    middle = h * theta_d.cos()[:, None]
    return middle + side, middle - side


def to_rusinkiewicz(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return θh, θd, φd, φh (N,) of directions (N, 3): the inverse."""
    s, e = wi + wo, wi - wo
    phi_h = torch.atan2(s[:, 1], s[:, 0])
    theta_h = torch.atan2(s[:, :2].norm(dim=1), s[:, 2])
    along = e[:, 0] * theta_h.cos() * phi_h.cos() + e[:, 1] * theta_h.cos() * phi_h.sin() - e[:, 2] * theta_h.sin()
    across = e[:, 1] * phi_h.cos() - e[:, 0] * phi_h.sin()
    return theta_h, torch.atan2(e.norm(dim=1), s.norm(dim=1)), torch.atan2(across, along), phi_h


def _between(place: Tensor, count: int) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """Return the two levels around a position, with their interpolation weights."""
    low = place.floor().to(torch.int64).clamp(0, max(count - 2, 0))
    share = place - low if count > 1 else torch.zeros_like(place)
    return (low, 1 - share), ((low + 1).clamp_max(count - 1), share)


def _around(phi: Tensor, count: int) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """Return the same for an azimuth, with `count` periodic levels."""
    place = (phi / (2 * math.pi)) % 1 * count
    low = place.floor()
    share = place - low if count > 1 else torch.zeros_like(place)
    number = low.to(torch.int64) % count
    return (number, 1 - share), ((number + 1) % count, share)
