"""Model how a tilted sample changes the measurement of an isotropic material, and correct it.

A goniometer reports directions relative to the assumed normal of the sample. Let the light be in the xz-plane at the
reported angle t ≥ 0. If the sample is tilted by small angles δ (about y, in the plane of incidence) and η (about x, out
of it), a reported direction ω is Rω in the frame of the surface,

    R = Rx(η) Ry(δ),    Ry(δ) (sin t, 0, cos t) = (sin(t + δ), 0, cos(t + δ)).

The instrument measures the intensity f cosθo of the lit spot and divides by the cosine of the reported angle. With g
the BRDF of the material and f the reported BRDF,

    f(ωi, ωo) cosθo = g(Rωi, Rωo) cosθ'o,    θ'o the angle of Rωo.

The data determine the tilt as follows:

* g is reciprocal. If the swapped pair is rotated until its light is at azimuth 0, it looks like a measurement with the
  tilt −δ. In the plane of incidence, with signed angles, f(t, s) = g(t + δ, s + δ) and f(s, t) = g(t − δ, s − δ): the
  highlight lies 2δ off the mirror direction, and flips when light and viewer are swapped. So the correct δ makes g
  reciprocal.
* An error α of the light's arm and β of the viewer's give f(t, s) = g(t + α, s + β), and f(s, t) = g(t − β, s − α).
  Reciprocity determines only α + β: with α = −β the measurement is reciprocal. Errors of the two arms cannot be
  distinguished from a tilt δ = (α + β)/2, which is corrected.
* g is mirrored at the plane of incidence: f at azimuths φ and −φ of the viewer differ only because of η. If a file
  contains averages over both sides, η cannot be determined.
* If the tilt rotates with the sample, for example on a turntable, R is the same for every pair. For an anisotropic
  material this is only another orientation and keeps reciprocity, so only isotropic data are corrected.

Near the normal: for δ > 0 the smallest measured angle, t = 0, is the angle δ to the surface normal. Pairs with a
smaller angle of incidence get the values at t = 0 with the same half vector, since the highlight depends on the half
vector. Viewers below the horizon of the instrument get the value at its horizon, times the cosines above.
"""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from homofact.brdf.analytic.common import grazing
from homofact.brdf.channels import OneChannel
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived, Reflectance
from homofact.geometry.directions import normalize, to_spherical


@dataclass(frozen=True)
class Tilt:
    """The tilt of a specimen in radians: `in_plane` is δ and `out_of_plane` is η of the module docstring."""

    in_plane: float
    out_of_plane: float = 0.0

    def measured(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
        """Return the pairs (N, 3) that the instrument reports for pairs of the surface; the light has azimuth 0."""
        theta, phi = to_spherical(wi)
        wo = _about_z(wo, -phi)
        angle = theta
        if self.out_of_plane:
            # The light is in the instrument's plane of incidence: (sin a, −cos a sin η, cos a cos η) in the surface's.
            sine, cosine = math.sin(self.out_of_plane), math.cos(self.out_of_plane)
            across = (torch.sin(theta) ** 2 - sine**2).clamp_min(0).sqrt() / cosine
            angle = torch.atan2(across, torch.cos(theta) / cosine)
            wo = _about_z(wo, torch.atan2(-torch.cos(angle) * sine, torch.sin(angle)))
            wo = _about_x(wo, -self.out_of_plane)
        reported = angle - self.in_plane
        wo = _about_y(wo, reported.clamp_max(0) - self.in_plane)
        reported = reported.clamp(0, math.pi / 2)
        wi = torch.stack((torch.sin(reported), torch.zeros_like(reported), torch.cos(reported).clamp_min(0)), -1)
        return wi, torch.cat((wo[:, :2], wo[:, 2:].clamp_min(0)), 1)

    def true(self, wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
        """The pairs (N, 3) of the surface that the instrument reports as `wi`, `wo`; they keep the light's azimuth."""
        phi = to_spherical(wi)[1]
        turned = (_about_y(_about_z(w, -phi), torch.full_like(phi, self.in_plane)) for w in (wi, wo))
        wi, wo = (_about_x(w, self.out_of_plane) for w in turned)
        back = phi - to_spherical(wi)[1]
        return _about_z(wi, back), _about_z(wo, back)


@dataclass(frozen=True)
class Straightened(Derived):
    """An isotropic measurement with the tilt of its specimen undone; `base` is the measurement as reported."""

    tilt: Tilt

    @property
    def isotropic(self) -> bool:
        """True: only isotropic data are straightened."""
        return True

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, without the cosine; 0 where a direction is under the horizon."""
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0))[:, None]
        pairs = self.tilt.measured(wi.double(), wo.double())
        lit, seen = (normalize(w) for w in pairs)
        ratio = grazing(seen[:, 2:]) / grazing(wo[:, 2:].double())
        values = self.base.evaluate(lit, seen) * ratio
        return torch.where(above, values, 0.0).to(wi.dtype)


def as_measured(reflectance: Reflectance) -> Reflectance | None:
    """Return the reflectance before its tilt was undone, in the same channels; None if no tilt was undone."""
    if isinstance(reflectance, Straightened):
        return reflectance.base
    if isinstance(reflectance, OneChannel):
        inner = as_measured(reflectance.base)
        return None if inner is None else replace(reflectance, base=inner)
    return None


def _about_x(w: Tensor, angle: float) -> Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.stack((w[:, 0], cos * w[:, 1] - sin * w[:, 2], sin * w[:, 1] + cos * w[:, 2]), -1)


def _about_y(w: Tensor, angle: Tensor) -> Tensor:
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack((cos * w[:, 0] + sin * w[:, 2], w[:, 1], cos * w[:, 2] - sin * w[:, 0]), -1)


def _about_z(w: Tensor, angle: Tensor) -> Tensor:
    cos, sin = torch.cos(angle), torch.sin(angle)
    return torch.stack((cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]), -1)
