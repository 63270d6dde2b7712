"""The glTF material that looks most like a reflectance: its parameters by nonlinear least squares.

The fit minimises the sum of two parts. Each part is divided by its value for a black material:

* a sphere under small lamps: errors of the cube roots of f cosθi, at pairs of directions drawn around the lobe
  (`brdf.analytic.nonlinear`);
* a sphere under a sky: errors of radiance^(1/2.2) at `PLACES` points, integrated by the nodes of `geometry.quadrature`.
  Without this part, a GGX lobe fitted to a material without long tails would lose half of the material's light.

The base colour is not a free parameter. The material is linear in its base colour, so each trial computes the colour
that gives every channel the mean albedo of the reflectance. A colour outside [0, 1] is clamped, and a third part of the
sum is the resulting error of the mean albedo.

Every other parameter of the material, except the rotation of the anisotropy, is a logistic function of a free variable.
An extension is kept only if it reduces the remaining error by at least the share `HELPS`, because a viewer without the
extension shows a less similar material. If the error is below `ENOUGH` without extensions, none is tried.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch
from scipy.optimize import least_squares
from torch import Tensor

from homofact.brdf.analytic.metallic_roughness import DIELECTRIC, MetallicRoughness, base_parts
from homofact.brdf.analytic.nonlinear import MOST_EVALUATIONS, CubeRoots
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.brdf.symmetry import light_azimuths
from homofact.errors import BadInput
from homofact.exporting.as_source import Drawn
from homofact.geometry.directions import from_cosine, from_spherical
from homofact.geometry.quadrature import disc_nodes, hemisphere_nodes
from homofact.rendering.fixed_lights import sky
from homofact.rendering.surface import sphere_frames

HELPS, ENOUGH = 0.2, 1e-4
PAIRS, PLACES = 2000, 24
SPECULAR, CLEARCOAT, ANISOTROPY = EXTENSIONS = ("specular", "clearcoat", "anisotropy")
_RINGS, _SPOKES = 16, 12
_LEVELS, _FINE = 10, (64, 32)  # of the mean albedo in the end
_GAMMA, _SKY = 2.2, 3.0
# Starts: metallic, or factor of the specular extension and F0 over it, and roughness; a coat's factor and roughness;
# strength (by its logit) and turn of a stretched lobe.
_PLAIN = [(metallic, roughness) for metallic in (0.1, 0.5, 0.9) for roughness in (0.2, 0.5)]
_FRESNEL = [(factor, roughness, share) for factor, share in ((0.9, 0.05), (0.3, 0.5)) for roughness in (0.2, 0.5)]
_COATS = [(0.5, 0.1), (0.5, 0.3)]
_TURNS = [(-1.0, 0.0), (-1.0, math.pi / 2)]
_FEW = 8


@dataclass(frozen=True)
class _Numbers:
    """A material without its base colour, as `base_parts` expects it, with some of the `extensions`."""

    numbers: Tensor
    along: Tensor | None
    fresnel: Tensor | None

    @classmethod
    def of(cls, x: Tensor, extensions: tuple[str, ...], channels: int) -> "_Numbers":
        """Read free numbers: two of the core, 1 + C of SPECULAR (the first is metallic's), two per extension."""
        first, roughness, rest = torch.sigmoid(x[0]), torch.sigmoid(x[1]), x[2:]
        metallic, fresnel = first, None
        if SPECULAR in extensions:
            metallic = torch.zeros_like(first)
            fresnel = torch.cat((first * torch.sigmoid(rest[:channels]), first[None]))
            rest = rest[channels:]
        coat = torch.zeros(2, dtype=x.dtype)
        if CLEARCOAT in extensions:
            coat, rest = torch.sigmoid(rest[:2]), rest[2:]
        along = torch.stack((torch.sigmoid(rest[0]), rest[1])) if ANISOTROPY in extensions else None
        return cls(torch.stack((metallic, roughness, *coat)), along, fresnel)

    def parts(self, channels: int, wi: Tensor, wo: Tensor) -> tuple[Tensor, Tensor]:
        """Return (a, b) of a + b · base colour."""
        return base_parts(channels, self.numbers, self.along, self.fresnel, wi, wo)

    def material(self, base: Tensor, channels: tuple[str, ...]) -> MetallicRoughness:
        """Return the material with a base colour."""
        metallic, roughness, coat, coat_roughness = self.numbers.tolist()
        strength, turn = (0.0, 0.0) if self.along is None else self.along.tolist()
        factor, colour = 1.0, None
        if self.fresnel is not None:
            *reflected, factor = self.fresnel.tolist()
            colour = tuple(each / factor / DIELECTRIC for each in reflected)
        return MetallicRoughness(
            tuple(base.tolist()), metallic, roughness, coat, coat_roughness, strength, turn % math.pi, factor, colour,
            channels=channels,
        )  # fmt: skip


@dataclass(frozen=True)
class _Mean:
    """∫∫ f cosθi cosθo dωi dωo/π as a sum over N pairs with a `weight`; `albedo` (C,) is the reflectance's."""

    wi: Tensor
    wo: Tensor
    weight: Tensor
    albedo: Tensor

    @classmethod
    def fine(cls, reflectance: Reflectance, isotropic: bool) -> "_Mean":
        """By nodes for narrow lobes."""
        theta, shares = disc_nodes(_LEVELS)
        azimuths = light_azimuths(isotropic)
        lit = torch.cat([from_spherical(theta, torch.full_like(theta, azimuth)) for azimuth in azimuths])
        wo, solid = hemisphere_nodes(lit, *_FINE)
        weight = solid * wo[..., 2] * shares.repeat(len(azimuths))[:, None] / len(azimuths)
        wi = lit[:, None].expand_as(wo)
        return cls.over(reflectance.evaluate(wi.reshape(-1, 3), wo.reshape(-1, 3)), wi, wo, weight)

    @classmethod
    def over(cls, values: Tensor, wi: Tensor, wo: Tensor, weight: Tensor) -> "_Mean":
        """Over pairs (K, M, 3) with weights (K, M) and the reflectance's values (K · M, C)."""
        made = cls(wi.reshape(-1, 3), wo.reshape(-1, 3), weight.reshape(-1), torch.zeros(0))
        return replace(made, albedo=made.of(values.to(torch.float64)))

    def of(self, values: Tensor) -> Tensor:
        """Return the mean albedo (C,) of values (N, C)."""
        return self.weight @ values

    def base_colour(self, constant: Tensor, slope: Tensor) -> Tensor:
        """The base colour (C,) in [0, 1] with which a + b · colour has the mean albedo, or comes nearest to it."""
        return ((self.albedo - self.of(constant)) / self.of(slope).clamp_min(1e-9)).clamp(0, 1)


@dataclass(frozen=True)
class _Objective:
    """Residuals (K,) of parameters: the parts of the module's head."""

    lamps: CubeRoots
    mean: _Mean
    light: Tensor
    shown: Tensor

    @classmethod
    def of(cls, reflectance: Reflectance, isotropic: bool) -> "_Objective":
        """Return what a reflectance shows, and how much each part is without a fit."""
        samples = sample_model(Drawn(reflectance, isotropic), PAIRS, "lobe", 0, noise_free=False)
        number = torch.arange(PLACES, dtype=torch.float64)
        # Vogel's spiral: equal areas of the disc that the sphere is seen as, so equal weights by cosθo.
        normals = from_cosine((1 - (number + 0.5) / PLACES).sqrt(), number * (math.pi * (3 - math.sqrt(5))))
        frames, towards = sphere_frames(normals, torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
        wi, solid = hemisphere_nodes(towards, _RINGS, _SPOKES)
        cosine, wo = solid * wi[..., 2], towards[:, None].expand_as(wi)
        values = reflectance.evaluate(wi.reshape(-1, 3), wo.reshape(-1, 3)).to(torch.float64)
        mean = _Mean.over(values, wi, wo, cosine / PLACES)
        made = cls(CubeRoots.of(samples, 0), mean, sky(wi @ frames) * cosine, torch.zeros(0))
        return replace(made, shown=made.under_the_sky(values))

    @property
    def channels(self) -> int:
        """C."""
        return len(self.mean.albedo)

    def under_the_sky(self, values: Tensor) -> Tensor:
        """Encoded radiance (P, C) of values (P · M, C)."""
        radiance = (values.reshape(*self.light.shape, -1) * self.light[..., None]).sum(1)
        return (radiance + 1e-6).pow(1 / _GAMMA)

    def residuals(self, numbers: _Numbers) -> Tensor:
        """Return all parts in one row."""
        constant, slope = numbers.parts(self.channels, self.mean.wi, self.mean.wo)
        base = self.mean.base_colour(constant, slope)
        values = constant + slope * base
        sky_part = _SKY * (self.under_the_sky(values) - self.shown) / self.shown.norm()
        missing = (self.mean.of(values) - self.mean.albedo) / self.mean.albedo.mean()
        samples = self.lamps.samples
        constant, slope = numbers.parts(self.channels, samples.wi, samples.wo)
        lamps = self.lamps.residuals(constant + slope * base)
        return torch.cat(((lamps / self.dark).reshape(-1), sky_part.reshape(-1), missing))

    @cached_property
    def dark(self) -> Tensor:
        """The norm of the lamps' part without a fit."""
        return self.lamps.residuals(torch.zeros_like(self.lamps.samples.values)).norm()


def fit_metallic_roughness(
    reflectance: Reflectance, isotropic: bool, *, extensions: bool | Collection[str] = True
) -> MetallicRoughness:
    """Fit the material; its mean albedo equals that of the reflectance in every channel, if possible.

    Parameters
    ----------
    reflectance : Reflectance
        R, G, B or one channel.
    isotropic : bool
        Whether the reflectance is isotropic. If not, a lobe stretched along a tangent is tried too.
    extensions : bool or names of EXTENSIONS
        The extensions to try; True for all. An extension is kept only if it helps. At most two are kept: SPECULAR and
        one other.

    Raises
    ------
    BadInput
        For other channels, and for a reflectance that is 0 everywhere.
    """
    channels = reflectance.channels
    if len(channels) not in (1, 3):
        raise BadInput(f"channels {', '.join(channels)}", where="glTF material", expected="R, G, B or one alone")
    objective = _Objective.of(reflectance, isotropic)
    if float(objective.lamps.samples.values.max()) <= 0:
        raise BadInput("the values are all 0", where="glTF material", expected="something that reflects")
    names = extensions if not isinstance(extensions, bool) else EXTENSIONS if extensions else ()
    plain = _Fit.of(objective, (), [_logits(*start) for start in _PLAIN])
    others = [name for name in (CLEARCOAT, ANISOTROPY) if name in names and not (name == ANISOTROPY and isotropic)]
    if plain.left < ENOUGH:
        names, others = (), []
    single = [_Fit.of(objective, (name,), plain.with_one_more(name)) for name in others]
    if SPECULAR in names:
        starts = [_logits(factor, rough, *[share] * len(channels)) for factor, rough, share in _FRESNEL]
        single.insert(0, _Fit.of(objective, (SPECULAR,), starts))
    best = plain.or_a_better(single)
    if SPECULAR in names and best is not plain and best.left > ENOUGH:
        both = [_Fit.of(objective, (SPECULAR, name), single[0].with_one_more(name)) for name in others]
        best = best.or_a_better(both)
    numbers = _Numbers.of(best.x, best.extensions, len(channels))
    mean = _Mean.fine(reflectance, isotropic)
    return numbers.material(mean.base_colour(*numbers.parts(len(channels), mean.wi, mean.wo)), channels)


@dataclass(frozen=True)
class _Fit:
    """Free numbers of a material with `extensions`, and the sum of squares that they leave."""

    extensions: tuple[str, ...]
    x: Tensor
    left: float

    @classmethod
    def of(cls, objective: _Objective, extensions: tuple[str, ...], starts: list[Tensor]) -> "_Fit":
        """Return the best of the minima reached from the starts."""

        def residuals(x: Tensor) -> Tensor:
            return objective.residuals(_Numbers.of(x, extensions, objective.channels))

        return cls(extensions, *_least(residuals, starts))

    def with_one_more(self, extension: str) -> list[Tensor]:
        """Starts of a fit with one more extension, from where this has come to."""
        more = [_logits(*coat) for coat in _COATS] if extension == CLEARCOAT else map(_double, _TURNS)
        return [torch.cat((self.x, each)) for each in more]

    def or_a_better(self, others: "list[_Fit]") -> "_Fit":
        """Return the best of those that leave less by `HELPS`, else this."""
        helping = [each for each in others if each.left < self.left * (1 - HELPS)]
        return min(helping, key=lambda each: each.left, default=self)


def _double(numbers: Sequence[float]) -> Tensor:
    return torch.tensor(numbers, dtype=torch.float64)


def _logits(*numbers: float) -> Tensor:
    return _double(numbers).logit()


def _least(residuals: Callable[[Tensor], Tensor], starts: list[Tensor]) -> tuple[Tensor, float]:
    """(parameters, sum of squares) of the best of the minima reached from the starts."""

    def descended(start: np.ndarray, evaluations: int) -> Any:
        # Central differences of a few numbers take a third of the time of torch's forward differentiation.
        return least_squares(
            lambda x: residuals(torch.from_numpy(x)).numpy(), start, jac="3-point", max_nfev=evaluations
        )

    # A few steps from each, and from where the best has come to all the others.
    begun = [descended(start.numpy(), _FEW) for start in starts]
    best = descended(min(begun, key=lambda start: start.cost).x, MOST_EVALUATIONS // 2)
    return torch.from_numpy(np.asarray(best.x)), float(2 * best.cost)
