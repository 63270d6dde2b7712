"""Three materials of random textures as the layers of arrays."""

from dataclasses import replace

import torch
from shading_cases import factorization, searched

from homofact.brdf.log_transform import LogTransform
from homofact.factor.factorization import Factorization
from homofact.factor.layered import Layered
from homofact.factor.projection import Warp, fixed_projection

COUNT = 3


def layered(channels: int = 3) -> Layered:
    """Three materials of random textures; a periodic texture, a warped one and a searched one are among them."""
    projections = (
        fixed_projection("theta_h-phi_h", True, Warp(0.1)),
        searched("isotropic-half-diff", 8, Warp(0.03)),
        fixed_projection("theta_d", True),
    )
    base = factorization(*projections, channels=channels)
    layers = []
    for k in range(COUNT):
        generator = torch.Generator().manual_seed(k)
        terms = tuple(
            replace(term, texture=torch.rand(term.texture.shape, generator=generator, dtype=torch.float64) * 2 - 1)
            for term in base.terms
        )
        transform = LogTransform(10.0 ** -(k + 1), base.transform.mean * (k + 1))
        layers.append(Factorization(terms, transform, base.channels, {"seed": k}))
    return Layered(tuple(layers))
