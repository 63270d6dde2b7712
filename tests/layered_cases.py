"""Texture arrays for tests of their shaders: three materials, and places on a map of labels."""

from dataclasses import replace

import numpy as np
import torch
from shading_cases import factorization, searched

from homofact.brdf.log_transform import LogTransform
from homofact.factor.factorization import Factorization
from homofact.factor.layered import Layered
from homofact.factor.projection import Warp, fixed_projection
from homofact.geometry.directions import draw_uniform

COUNT, ROWS, COLUMNS = 3, 5, 7


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
            replace(
                term, texture=(torch.rand(term.texture.shape, generator=generator, dtype=torch.float64) * 2 - 1).numpy()
            )
            for term in base.terms
        )
        transform = LogTransform(10.0 ** -(k + 1), base.transform.mean * (k + 1))
        layers.append(Factorization(terms, transform, base.channels, {"seed": k}))
    return Layered(tuple(layers))


def places() -> tuple[torch.Tensor, torch.Tensor, np.ndarray, np.ndarray, torch.Tensor]:
    """Pairs, places (u, v) some of which lie on and beyond the edges, the label map, and the labels at the places."""
    wi, wo = draw_uniform(2000, torch.Generator().manual_seed(0))
    wi[:50, 2] *= -1
    generator = np.random.default_rng(1)
    labels = generator.integers(0, COUNT, (ROWS, COLUMNS)).astype(np.uint8)
    row, column = generator.integers(0, ROWS, 2000), generator.integers(0, COLUMNS, 2000)
    inside = generator.uniform(0.05, 0.95, (2000, 2))
    uv = np.stack(((column + inside[:, 0]) / COLUMNS, (row + inside[:, 1]) / ROWS), 1).astype(np.float32)
    # Behind those under the horizon; no label is 0 there, which reading outside the map may give.
    labels[-1, [0, -1]] = 1, 2
    uv[60], row[60], column[60] = (1.0, 1.0), ROWS - 1, COLUMNS - 1
    uv[61], row[61], column[61] = (-0.3, 7.0), ROWS - 1, 0
    return wi, wo, uv, labels, torch.from_numpy(labels[row, column].astype(np.int64))
