"""Spherical Gaussians over a diffuse base, fitted to samples (`brdf.analytic.nonlinear`).

The optimized parameters are unbounded numbers: colours are their squares, λ their exponentials, and F0 a logistic
function.
"""

import math

import torch
from torch import Tensor

from homofact.brdf.analytic.ggx_fit import WIDTHS, colour, starts
from homofact.brdf.analytic.nonlinear import fit_parameters
from homofact.brdf.analytic.spherical_gaussians import Gaussian, SphericalGaussians, gaussian
from homofact.brdf.samples import Samples
from homofact.errors import Report


def fit_gaussians(samples: Samples, lobes: int, seed: int) -> tuple[SphericalGaussians, Report]:
    """Fit a diffuse base and `lobes` spherical Gaussians, which start at half widths w with λ = log 2/(1 − cos w)."""
    channels = len(samples.channels)

    def model(x: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        values = (x[:channels] ** 2 / math.pi).expand(len(wi), channels)
        f0 = torch.sigmoid(x[channels])
        for part in x[channels + 1 :].reshape(lobes, channels + 1):
            lobe = gaussian(part[channels].clamp(-3, 16).exp(), f0, wi, wo)
            values = values + lobe[:, None] * part[:channels] ** 2
        return values

    sharpness = [math.log(math.log(2) / (1 - math.cos(width))) for width in WIDTHS]
    x, report = fit_parameters(model, starts(samples, sharpness, lobes, own=False), samples, seed)
    parts = x[channels + 1 :].reshape(lobes, channels + 1)
    found = tuple(
        Gaussian(colour(part[:channels].numpy()), float(part[channels].clamp(-3, 16).exp())) for part in parts
    )
    reflectance = float(torch.sigmoid(x[channels]))
    return SphericalGaussians(colour(x[:channels].numpy()), found, reflectance, channels=samples.channels), report
