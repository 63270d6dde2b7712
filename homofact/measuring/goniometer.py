"""Describe which directions a goniometer can measure, and how long its moves take.

The specimen is isotropic, so the light stays at φ = 0. Three axes move one after another: θi of the light, θo and φ of
the detector. Each axis that moves takes |angle|/speed plus the settling time.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.pair_density import draw_lobe
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import draw_in_discs, from_spherical, to_spherical

# Candidates are drawn, half where lobes are: regular ones would fall together with the nodes of the prior's grid, where
# they say less of what lies between.
_BY_LOBES, _IN_DISCS, _RIM = 1200, 800, 0.75
_SEED, _DRAWS, _ENOUGH = 20261126, 12, 1200
# What an incidence measures beside its regular rings: offsets from the mirror direction in the plane of incidence.
_ABOUT_MIRROR = (-12, -8, -5, -3, -2, -1, -0.5, 0, 0.5, 1, 2, 3, 5, 8, 12)
_MOST_ROWS = 4000
_SLACK = 1e-9


@dataclass(frozen=True)
class Goniometer:
    """Limits of a goniometer's axes in degrees, and its speed.

    Attributes
    ----------
    theta_i, theta_o, phi : the least and greatest polar angles of light and detector, and of the azimuth φ between
        them. φ = 0 is the side of the light, φ = 180 the side of the mirror direction.
    separation : the least angle between light and detector, below which one shadows the other.
    resolution : the step of the axes in degrees; measured angles are multiples of this step.
    rings, azimuths : steps of θo and φ, in degrees, in the measurement of one angle of incidence.
    speed : degrees per second of each axis.
    settle : settling time, in seconds, of each axis that has moved.
    """

    theta_i: tuple[float, float] = (0.0, 80.0)
    theta_o: tuple[float, float] = (0.0, 80.0)
    phi: tuple[float, float] = (0.0, 180.0)
    separation: float = 5.0
    resolution: float = 0.25
    rings: float = 10.0
    azimuths: float = 20.0
    speed: float = 10.0
    settle: float = 1.0

    @classmethod
    def reaching(cls, samples: Samples | None, **settings: Any) -> "Goniometer":
        """Return a goniometer that reaches 80°, or the largest angles of the samples if these are larger.

        A given `theta_i` or `theta_o` takes precedence. Raises BadInput as the constructor does.
        """
        if samples is not None:
            for name, w in (("theta_i", samples.wi), ("theta_o", samples.wo)):
                largest = math.floor(float(to_spherical(w)[0].max().rad2deg()) + _SLACK)
                settings.setdefault(name, (0.0, max(cls.theta_o[1], float(largest))))
        return cls(**settings)

    def __post_init__(self) -> None:
        """Refuse angles that no goniometer has. Raises BadInput."""
        for name, most in (("theta_i", 90.0), ("theta_o", 90.0), ("phi", 180.0)):
            low, high = getattr(self, name)
            if not 0 <= low <= high <= most:
                raise BadInput(where=name, found=f"{low:g} to {high:g}", expected=f"rising degrees from 0 to {most:g}")
        limits = (
            ("separation", 0.0, 90.0), ("resolution", 0.01, 10.0), ("rings", 1.0, 45.0), ("azimuths", 1.0, 90.0),
            ("speed", 1e-3, 1e6), ("settle", 0.0, 1e6),
        )  # fmt: skip
        for name, least, most in limits:
            if not least <= getattr(self, name) <= most:
                raise BadInput(where=name, found=getattr(self, name), expected=f"a number from {least:g} to {most:g}")

    def directions(self) -> np.ndarray:
        """Return the distinct candidates (N, 3) for single measurements: θi, θo, φ in degrees.

        Raises BadInput if the limits allow no direction; its message lists the limits.
        """
        chance = torch.Generator().manual_seed(_SEED)
        found = np.zeros((0, 3))
        # Narrow limits leave few of the drawn pairs: draw again.
        for _ in range(_DRAWS):
            parts = (draw_lobe(_BY_LOBES, chance), draw_in_discs(_IN_DISCS, chance, _RIM))
            drawn = self._rounded(*(torch.cat([part[which] for part in parts]) for which in (0, 1)))
            found = np.unique(np.concatenate((found, drawn[self._allowed(drawn)])), axis=0)
            if len(found) >= _ENOUGH:
                break
        if not len(found):
            raise self._nothing()
        return found

    def incidences(self) -> list[np.ndarray]:
        """Return the angles (N, 3), in degrees, of each incidence; θi are the multiples of 5° and both limits."""
        low, high = self.theta_i
        angles = sorted({low, high, *(5.0 * k for k in range(math.ceil(low / 5), math.floor(high / 5) + 1))})
        found = [self.ring(angle) for angle in angles]
        found = [ring for ring in found if len(ring)]
        if not found:
            raise self._nothing()
        return found

    def ring(self, theta_i: float) -> np.ndarray:
        """Return the angles (N, 3) of one incidence: steps of θo and φ, more of them about the mirror direction."""
        low, high = self.theta_o
        theta = np.append(np.arange(low, high, self.rings), high)
        phi = np.append(np.arange(self.phi[0], self.phi[1], self.azimuths), self.phi[1])
        rows = [[theta_i, each, turn] for each in theta for turn in (phi if each > 0 else phi[:1])]
        if len(rows) > _MOST_ROWS:
            raise BadInput(
                where="rings", found=f"{len(rows)} directions for each incidence", expected=f"at most {_MOST_ROWS}"
            )
        rows += [[theta_i, abs(theta_i + k), 180.0 if theta_i + k >= 0 else 0.0] for k in _ABOUT_MIRROR]
        found = np.array(rows)
        return found[self._allowed(found)]

    def moves(self, angles: np.ndarray) -> np.ndarray:
        """Return the seconds (N, N) of the moves between all pairs of angles (N, 3)."""
        gaps = np.abs(angles[:, None] - angles[None])
        return (gaps / self.speed + self.settle * (gaps > _SLACK)).sum(-1)

    def first_moves(self, angles: np.ndarray) -> np.ndarray:
        """Return the seconds (N,) of the moves to angles (N, 3) from the parking position, the least angles."""
        gaps = np.abs(angles - np.array([self.theta_i[0], self.theta_o[0], self.phi[0]]))
        return (gaps / self.speed + self.settle * (gaps > _SLACK)).sum(-1)

    def _rounded(self, wi: Tensor, wo: Tensor) -> np.ndarray:
        (theta_i, phi_i), (theta_o, phi_o) = to_spherical(wi), to_spherical(wo)
        turn = torch.remainder(phi_o - phi_i, 2 * math.pi)
        turn = torch.minimum(turn, 2 * math.pi - turn)
        degrees = torch.stack((theta_i, theta_o, turn), 1).rad2deg().numpy()
        degrees = np.round(np.round(degrees / self.resolution) * self.resolution, 6)
        # A detector or light at the normal has no azimuth.
        degrees[(degrees[:, 0] == 0) | (degrees[:, 1] == 0), 2] = self.phi[0]
        return np.unique(degrees, axis=0)

    def _allowed(self, angles: np.ndarray) -> np.ndarray:
        limits = (self.theta_i, self.theta_o, self.phi)
        inside = np.ones(len(angles), dtype=bool)
        for axis, (low, high) in enumerate(limits):
            inside &= (angles[:, axis] >= low - _SLACK) & (angles[:, axis] <= high + _SLACK)
        return inside & (separations(angles) >= self.separation - 1e-6)

    def _nothing(self) -> BadInput:
        span = ", ".join(
            f"{name} {low:g} to {high:g}"
            for name, (low, high) in (("theta_i", self.theta_i), ("theta_o", self.theta_o), ("phi", self.phi))
        )
        least = f" and directions {self.separation:g} degrees apart"
        expected = "wider limits: most materials need theta 0 to 75 and phi 0 to 180, and phi 180 for the highlight"
        return BadInput(f"no direction with {span}{least}", where="goniometer", expected=expected)


def separations(angles: np.ndarray) -> np.ndarray:
    """Return the angle (N,) in degrees between light and detector at angles (N, 3)."""
    wi, wo = directions_of(angles)
    cosine = (wi * wo).sum(1).clamp(-1, 1)
    across = torch.linalg.cross(wi, wo).norm(dim=1)
    return torch.atan2(across, cosine).rad2deg().numpy()


def directions_of(angles: np.ndarray) -> tuple[Tensor, Tensor]:
    """Return the unit vectors ωi and ωo, (N, 3) each, of angles (N, 3) in degrees; the light is at φ = 0."""
    theta_i, theta_o, phi = torch.from_numpy(np.ascontiguousarray(angles, dtype=np.float64)).deg2rad().unbind(1)
    return from_spherical(theta_i, torch.zeros_like(phi)), from_spherical(theta_o, phi)
