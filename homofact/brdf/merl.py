"""A BRDF tabulated like those of the MERL database (Matusik, Pfister, Brand and McMillan 2003).

The table is isotropic, over Rusinkiewicz's angles in bins:

    θh   k-th of n bins: (π/2)(k/n)² to (π/2)((k+1)/n)²       finer towards the highlight
    θd   k-th of n bins: (π/2)k/n to (π/2)(k+1)/n
    φd   even bins over [0, π), the other half by reciprocity (φd ~ φd + π); or over [0, 2π)

The table contains raw numbers: f = raw · scale in sr⁻¹ without the cosine, with scale 1/1500, 1.15/1500 and 1.66/1500
for red, green and blue. A negative entry was not measured. The value of a bin applies at its centre. For θh this is the
centre in k, because the bins have equal width in √θh.

The measure of a bin follows from two facts. At fixed ωi, dωh = dωo/(4 h·ωo). At fixed h, the frame of d is a rotation
of the frame of ωi, so dωi = dωd. Hence

    dωi dωo = 4 cosθd dωh dωd = 4 cosθd · sinθh dθh dφh · sinθd dθd dφd.

Integrated over a bin and over φh: 2π (cos θh₀ − cos θh₁) · 2 (sin² θd₁ − sin² θd₀) · Δφd, twice that where
the other half of φd is folded in. Over all bins with both directions above the horizon, the measures sum to (2π)².
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.errors import BadInput
from homofact.geometry.directions import normalize

SCALES = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)
STANDARD = (90, 90, 180)
UNMEASURED = -1.0
_ON_AXIS = 1e-9


@dataclass(frozen=True)
class MerlGrid:
    """The bins: `shape` is their number in (θh, θd, φd).

    φd covers the whole turn if it has four times as many bins as θd (360 and 90), else half a turn.
    """

    shape: tuple[int, int, int] = STANDARD

    @property
    def count(self) -> int:
        """Number of bins."""
        return math.prod(self.shape)

    @property
    def turn(self) -> float:
        """The range of φd: π or 2π."""
        return 2 * math.pi if self.shape[2] == 4 * self.shape[1] else math.pi

    def centres(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return θh, θd and φd of the bins' centres in radians."""
        h, d, p = (torch.arange(n, dtype=torch.float64).add_(0.5).div_(n) for n in self.shape)
        return h**2 * (math.pi / 2), d * (math.pi / 2), p * self.turn

    def measure(self) -> Tensor:
        """dωi dωo of every bin (θh, θd, φd) in sr², as in the module's head."""
        h, d = (torch.linspace(0, 1, n + 1, dtype=torch.float64) for n in self.shape[:2])
        cos_h, sin_d = torch.cos(h**2 * (math.pi / 2)), torch.sin(d * (math.pi / 2)) ** 2
        folded = 2 if self.turn < 4 else 1
        azimuth = 2 * math.pi * (self.turn / self.shape[2]) * folded
        return (
            ((cos_h[:-1] - cos_h[1:])[:, None] * (2 * (sin_d[1:] - sin_d[:-1])) * azimuth)[:, :, None]
            .expand(self.shape)
            .contiguous()
        )

    def slabs(self, rows: int = 8) -> Iterator[tuple[slice, Tensor, Tensor]]:
        """Yield (bins, wi, wo) for `rows` bins of θh at a time: flat bin numbers, and directions (N, 3) at centres.

        h is in the xz-plane, wi = Ry(θh) d and wo = Ry(θh) d', d' being d at φd + π. Directions may lie under
        the horizon.
        """
        theta_h, theta_d, phi_d = self.centres()
        sine = torch.sin(theta_d)[:, None]
        dx, dy = sine * torch.cos(phi_d), sine * torch.sin(phi_d)
        dz = torch.cos(theta_d)[:, None].expand_as(dx)
        plane = self.shape[1] * self.shape[2]
        for first in range(0, self.shape[0], rows):
            angle = theta_h[first : first + rows, None, None]
            cos, sin = torch.cos(angle), torch.sin(angle)
            across = dy.expand(angle.shape[0], *dy.shape)
            wi = torch.stack((cos * dx + sin * dz, across, cos * dz - sin * dx), -1)
            wo = torch.stack((sin * dz - cos * dx, -across, cos * dz + sin * dx), -1)
            bins = slice(first * plane, (first + angle.shape[0]) * plane)
            yield bins, wi.reshape(-1, 3), wo.reshape(-1, 3)

    def place(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the position of each pair along each axis in units of bins; the centre of bin k is at k + ½."""
        theta_h, theta_d, phi_d = _angles(wi, wo)
        h = torch.sqrt(theta_h * (2 / math.pi)) * self.shape[0]
        return h, theta_d * (2 / math.pi) * self.shape[1], torch.remainder(phi_d, self.turn) / self.turn * self.shape[2]

    def bins(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return the flat bin (N,) that each pair falls in."""
        h, d, p = (x.floor().long() for x in self.place(wi, wo))
        nh, nd, np_ = self.shape
        return (h.clamp(0, nh - 1) * nd + d.clamp(0, nd - 1)) * np_ + p.clamp(0, np_ - 1)


@dataclass(frozen=True)
class MerlTable:
    """A table as a `Reflectance`: `raw` is (3, θh, θd, φd) in float64, as in the file, negative where not measured.

    With `lookup` "linear", values are interpolated trilinearly between the centres of measured bins, periodically in
    φd. Unmeasured bins among the eight are left out, and the weights of the others are scaled up. Beyond the outermost
    centres in θ the value is constant. With "nearest", the value is that of the bin that contains the pair, as in the
    program of the database. The value is 0 if none of these bins was measured. Raises BadInput for another shape or
    lookup.
    """

    raw: Tensor
    lookup: Literal["linear", "nearest"] = "linear"

    def __post_init__(self) -> None:
        """Refuse other shapes and lookups."""
        if self.raw.ndim != 4 or self.raw.shape[0] != 3 or 0 in self.raw.shape:
            raise BadInput(f"raw has shape {tuple(self.raw.shape)}", where="MERL table", expected="(3, θh, θd, φd)")
        if self.lookup not in ("linear", "nearest"):
            raise BadInput(f"lookup is {self.lookup!r}", where="MERL table", expected="linear or nearest")

    @property
    def channels(self) -> tuple[str, ...]:
        """R, G and B."""
        return ("R", "G", "B")

    @property
    def isotropic(self) -> bool:
        """True: the table does not depend on the azimuth of h."""
        return True

    @property
    def nbytes(self) -> int:
        """Bytes of the table in the file's float64."""
        return 8 * self.raw.numel()

    @property
    def fetches(self) -> int:
        """Bins read for one value: 1, or the 8 round it."""
        return 1 if self.lookup == "nearest" else 8

    @cached_property
    def grid(self) -> MerlGrid:
        """The bins."""
        _, nh, nd, np_ = self.raw.shape
        return MerlGrid((nh, nd, np_))

    @cached_property
    def measured(self) -> Tensor:
        """Whether each bin (θh·θd·φd,) was measured, i.e. no channel is negative."""
        return (self.raw >= 0).all(0).reshape(-1)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, 3) in sr⁻¹ without the cosine; 0 under the horizon and where nothing was measured."""
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
        values = self._nearest(wi, wo) if self.lookup == "nearest" else self._linear(wi, wo)
        return torch.where(above, values * torch.tensor(SCALES, dtype=torch.float64), 0.0).to(wi)

    def _nearest(self, wi: Tensor, wo: Tensor) -> Tensor:
        bins = self.grid.bins(wi.double(), wo.double())
        return torch.where(self.measured[bins][:, None], self.raw.reshape(3, -1)[:, bins].T, 0.0)

    def _linear(self, wi: Tensor, wo: Tensor) -> Tensor:
        shape, flat = self.grid.shape, self.raw.reshape(3, -1)
        axes = []
        for axis, x in enumerate(self.grid.place(wi.double(), wo.double())):
            low = (x - 0.5).floor()
            axes.append((low.long(), x - 0.5 - low, shape[axis]))
        (h, fh, nh), (d, fd, nd), (p, fp, np_) = axes
        total = torch.zeros(wi.shape[0], 3, dtype=torch.float64)
        weight = torch.zeros(wi.shape[0], 1, dtype=torch.float64)
        for step in range(8):
            sh, sd, sp = step >> 2, step >> 1 & 1, step & 1
            bins = ((h + sh).clamp(0, nh - 1) * nd + (d + sd).clamp(0, nd - 1)) * np_ + (p + sp) % np_
            share = (fh if sh else 1 - fh) * (fd if sd else 1 - fd) * (fp if sp else 1 - fp)
            share = torch.where(self.measured[bins], share, 0.0)[:, None]
            total += torch.where(share > 0, flat[:, bins].T, 0.0) * share
            weight += share
        return torch.where(weight > 0, total / weight.clamp_min(torch.finfo(torch.float64).tiny), 0.0)


def _angles(wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(θh, θd, φd) in radians, φd in (−π, π] from the direction in which θh grows; 0 at h = n."""
    h = normalize(wi + wo)
    sin_h = torch.hypot(h[:, 0], h[:, 1])
    theta_h = torch.atan2(sin_h, h[:, 2])
    theta_d = torch.atan2((wi - wo).norm(dim=-1) / 2, (wi * h).sum(-1))
    across = h[:, 0] * wi[:, 1] - h[:, 1] * wi[:, 0]
    along = (h[:, 0] * wi[:, 0] + h[:, 1] * wi[:, 1]) * h[:, 2] - wi[:, 2] * sin_h**2
    on_axis = sin_h <= _ON_AXIS
    return theta_h, theta_d, torch.where(on_axis, 0.0, torch.atan2(across, along))
