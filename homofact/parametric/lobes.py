"""GGX lobes and spherical Gaussians over a diffuse base, fitted to samples (`nonlinear`).

Parameters are free numbers: colours are squares of them, α and λ exponentials, F0 a logistic function.
"""

import math
from itertools import combinations

import torch
from torch import Tensor

from homofact.brdf.analytic.ggx import GgxBrdf, GgxLobe, ggx_lobe
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians, gaussian
from homofact.brdf.samples import Samples
from homofact.errors import Report
from homofact.parametric.nonlinear import fit_parameters

# Half widths of highlights in radians, from a mirror's to a rough paint's: every choice of them is a start.
WIDTHS = (0.03, 0.1, 0.3)
_LEAST, _MOST = 1e-4, 3.0


def fit_ggx(samples: Samples, lobes: int, seed: int) -> tuple[GgxBrdf, Report]:
    """Return a diffuse base and so many GGX lobes."""
    channels = len(samples.channels)

    def model(x: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        values = (x[:channels] ** 2 / math.pi).expand(len(wi), channels)
        for part in x[channels:].reshape(lobes, channels + 2):
            lobe = ggx_lobe(_bounded(part[channels]), torch.sigmoid(part[channels + 1]), wi, wo)
            values = values + lobe[:, None] * part[:channels] ** 2
        return values

    x, report = fit_parameters(model, _starts(samples, lobes, [math.log(w) for w in WIDTHS], own=True), samples, seed)
    parts = x[channels:].reshape(lobes, channels + 2)
    found = tuple(
        GgxLobe(_colour(part[:channels]), float(_bounded(part[channels])), float(torch.sigmoid(part[channels + 1])))
        for part in parts
    )
    return GgxBrdf(_colour(x[:channels]), found, channels=samples.channels), report


def fit_gaussians(samples: Samples, lobes: int, seed: int) -> tuple[SphericalGaussians, Report]:
    """Fit a diffuse base and `lobes` spherical Gaussians; a half width of w means λ = log 2/(1 − cos w)."""
    channels = len(samples.channels)

    def model(x: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        values = (x[:channels] ** 2 / math.pi).expand(len(wi), channels)
        f0 = torch.sigmoid(x[channels])
        for part in x[channels + 1 :].reshape(lobes, channels + 1):
            lobe = gaussian(part[channels].clamp(-3, 16).exp(), f0, wi, wo)
            values = values + lobe[:, None] * part[:channels] ** 2
        return values

    sharpness = [math.log(math.log(2) / (1 - math.cos(width))) for width in WIDTHS]
    x, report = fit_parameters(model, _starts(samples, lobes, sharpness, own=False), samples, seed)
    parts = x[channels + 1 :].reshape(lobes, channels + 1)
    found = tuple(Gaussian(_colour(part[:channels]), float(part[channels].clamp(-3, 16).exp())) for part in parts)
    reflectance = float(torch.sigmoid(x[channels]))
    return SphericalGaussians(_colour(x[:channels]), found, reflectance, channels=samples.channels), report


def _bounded(x: Tensor) -> Tensor:
    return x.exp().clamp(_LEAST, _MOST)


def _colour(x: Tensor) -> tuple[float, ...]:
    return tuple((x**2).tolist())


def _starts(samples: Samples, lobes: int, shapes: list[float], own: bool) -> list[Tensor]:
    """Starts (P,) for every choice of `shapes`: a base of half the median, lobes of a tenth, F0 of .05.

    `own` is whether each lobe has its own F0, behind its shape.
    """
    base = (0.5 * math.pi * samples.values.median(0).values.clamp_min(1e-6)).sqrt()
    colour = torch.full_like(base, math.sqrt(0.1))
    f0 = torch.tensor([math.log(0.05 / 0.95)], dtype=torch.float64)
    chosen = (
        combinations(shapes, lobes)
        if lobes <= len(shapes)
        else [tuple(shapes[k % len(shapes)] + 0.1 * (k // len(shapes)) for k in range(lobes))]
    )
    starts = []
    for some in chosen:
        parts = [
            torch.cat((colour, torch.tensor([shape], dtype=torch.float64), *([f0] if own else []))) for shape in some
        ]
        starts.append(torch.cat((base, *([] if own else [f0]), *parts)))
    return starts
