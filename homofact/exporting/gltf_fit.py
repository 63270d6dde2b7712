"""The glTF material that looks most like a reflectance: its parameters by nonlinear least squares.

Minimised is the sum of two parts, each over its own sum without a fit:

* what a sphere under small lamps shows: cube roots of f cosθi at pairs drawn along the lobe (`parametric.nonlinear`);
* what a sphere under a sky shows: the 2.2nd roots of its radiance at `PLACES` places, integrated by the nodes of
  `geometry.quadrature`. Without it GGX's long tails, fitted to a material that has none, lose half of its light.

Every number of the material is a logistic function of a free one. An extension is kept where it takes away at least
`HELPS` of what is left: a viewer that does not know it shows something less like.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from scipy.optimize import least_squares
from torch import Tensor
from torch.func import jacfwd

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness, metallic_roughness
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.sampling import sample_model
from homofact.errors import BadInput
from homofact.exporting.as_source import Drawn
from homofact.geometry.directions import from_cosine
from homofact.geometry.quadrature import hemisphere_nodes
from homofact.parametric.nonlinear import MOST_EVALUATIONS, CubeRoots
from homofact.rendering.fixed_lights import sky
from homofact.rendering.surface import sphere_frames

HELPS = 0.25
PAIRS, PLACES = 2000, 24
_RINGS, _SPOKES = 16, 12
_GAMMA, _SKY = 2.2, 3.0
# Starts: metallic and roughness of the material; roughness of the coat; turn of the tangent.
_STARTS = tuple((metallic, roughness) for metallic in (0.1, 0.5, 0.9) for roughness in (0.2, 0.5))
_COATS = (0.1, 0.3)
_FEW = 8
_TURNS = (0.0, math.pi / 2)


@dataclass(frozen=True)
class _Objective:
    """Residuals (K,) of parameters: the two parts of the module's head."""

    lamps: CubeRoots
    wi: Tensor
    wo: Tensor
    light: Tensor
    shown: Tensor

    @classmethod
    def of(cls, reflectance: Reflectance, isotropic: bool) -> "_Objective":
        """What a reflectance shows, and how much each part is without a fit."""
        samples = sample_model(Drawn(reflectance, isotropic), PAIRS, "lobe", 0, noise_free=False)
        number = torch.arange(PLACES, dtype=torch.float64)
        # Vogel's spiral: equal areas of the disc that the sphere is seen as.
        normals = from_cosine((1 - (number + 0.5) / PLACES).sqrt(), number * (math.pi * (3 - math.sqrt(5))))
        frames, towards = sphere_frames(normals, torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
        wi, solid = hemisphere_nodes(towards, _RINGS, _SPOKES)
        light = sky(wi @ frames) * solid * wi[..., 2]
        wo = towards[:, None].expand_as(wi).reshape(-1, 3)
        made = cls(CubeRoots.of(samples, 0), wi.reshape(-1, 3), wo, light, torch.zeros(0))
        shown = made.under_the_sky(reflectance.evaluate(made.wi, made.wo).to(torch.float64))
        return cls(made.lamps, made.wi, made.wo, made.light, shown)

    def under_the_sky(self, values: Tensor) -> Tensor:
        """Encoded radiance (P, C) of values (P · M, C)."""
        radiance = (values.reshape(*self.light.shape, -1) * self.light[..., None]).sum(1)
        return (radiance + 1e-6).pow(1 / _GAMMA)

    def residuals(self, model: Callable[[Tensor, Tensor], Tensor]) -> Tensor:
        """Both parts in one row."""
        samples = self.lamps.samples
        lamps = self.lamps.residuals(model(samples.wi, samples.wo))
        scale = self.lamps.residuals(torch.zeros_like(samples.values)).norm()
        sky_part = _SKY * (self.under_the_sky(model(self.wi, self.wo)) - self.shown) / self.shown.norm()
        return torch.cat(((lamps / scale).reshape(-1), sky_part.reshape(-1)))


def fit_metallic_roughness(reflectance: Reflectance, isotropic: bool, *, extensions: bool = True) -> MetallicRoughness:
    """The material; with `extensions` a coat, or (where not isotropic) a lobe stretched along a tangent, if that helps.

    R, G, B or one channel; raises BadInput for others, and for what reflects nothing.
    """
    channels = reflectance.channels
    if len(channels) not in (1, 3):
        raise BadInput(f"channels {', '.join(channels)}", where="glTF material", expected="R, G, B or one alone")
    objective = _Objective.of(reflectance, isotropic)
    count = len(channels)
    median = objective.lamps.samples.values.median(0).values
    if float(objective.lamps.samples.values.max()) <= 0:
        raise BadInput("the values are all 0", where="glTF material", expected="something that reflects")

    def residuals(x: Tensor) -> Tensor:
        # Behind the numbers of the core stand the two of a coat, or strength, turn and a filler of a stretched lobe.
        core, more = torch.sigmoid(x[: count + 2]), x[count + 2 :]
        coat = torch.sigmoid(more) if len(more) == 2 else torch.zeros(2, dtype=x.dtype)
        along = torch.stack((torch.sigmoid(more[0]), more[1])) if len(more) == 3 else None
        single = torch.cat((core[count:], coat))
        return objective.residuals(lambda wi, wo: metallic_roughness(core[:count], single, along, wi, wo))

    base = (math.pi * median).clamp(0.02, 0.95)
    # What a metal reflects is all in its highlight: there the median says the hue alone.
    bright = base / base.max() * 0.6
    starts = [
        torch.cat((base if metallic < 0.3 else bright, torch.tensor([metallic, rough], dtype=torch.float64))).logit()
        for metallic, rough in _STARTS
    ]
    best, least = _least(residuals, starts)
    kinds = [[torch.tensor([0.5, rough], dtype=torch.float64).logit() for rough in _COATS]]
    if not extensions:
        return _material(best, channels)
    if not isotropic:
        kinds.append([torch.tensor([-1.0, turn, 0.0], dtype=torch.float64) for turn in _TURNS])
    core, bound = best, least * (1 - HELPS)
    for several in kinds:
        found, own = _least(residuals, [torch.cat((core, more)) for more in several])
        if own < bound:
            best, bound = found, own
    return _material(best, channels)


def _least(residuals: Callable[[Tensor], Tensor], starts: list[Tensor]) -> tuple[Tensor, float]:
    """(parameters, sum of squares) of the best of the minima reached from the starts."""
    slopes = jacfwd(residuals)

    def descended(start: np.ndarray, evaluations: int) -> Any:
        return least_squares(
            lambda x: residuals(torch.from_numpy(x)).numpy(),
            start,
            jac=lambda x: slopes(torch.from_numpy(x)).numpy(),  # type: ignore[arg-type]
            max_nfev=evaluations,
        )

    with warnings.catch_warnings():
        # torch loads rules of its own the first time, by a function that it calls deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        # A few steps from each, and from where the best has come to all the others.
        begun = [descended(start.numpy(), _FEW) for start in starts]
        best = descended(min(begun, key=lambda start: start.cost).x, MOST_EVALUATIONS // 2)
    return torch.from_numpy(np.asarray(best.x)), float(2 * best.cost)


def _material(x: Tensor, channels: tuple[str, ...]) -> MetallicRoughness:
    count = len(channels)
    *colour, metallic, roughness = torch.sigmoid(x[: count + 2]).tolist()
    more = x[count + 2 :]
    coat = torch.sigmoid(more).tolist() if len(more) == 2 else [0.0, 0.0]
    along = [float(torch.sigmoid(more[0])), float(more[1]) % math.pi] if len(more) == 3 else [0.0, 0.0]
    return MetallicRoughness(tuple(colour), metallic, roughness, *coat, *along, channels=channels)
