"""Huber's weights: what is far from the fit pulls on it by its sign only (Huber 1964; iteratively reweighted).

ρ(r) is r²/2 up to c σ and linear beyond. With weights c σ/|r| there the quadratic problem has the same gradient, so
solving, reweighting and solving again goes downhill to the robust answer. σ is 1.4826 times the median |r|, which a
minority of outliers cannot move; c = 1.345 loses 5% efficiency where the noise is Gaussian.
"""

import torch
from torch import Tensor

TUNING = 1.345
NORMAL_MAD = 1.4826


def scale_of(residuals: Tensor) -> float:
    """σ of residuals (N,), from the median of their absolute values."""
    return NORMAL_MAD * float(residuals.abs().median())


def huber_weights(residuals: Tensor) -> Tensor:
    """Weights (N,) in (0, 1] of residuals (N, C), one a sample: by the root mean square over channels."""
    size = residuals.square().mean(1).sqrt()
    limit = TUNING * scale_of(size)
    if limit == 0:
        # More than half of the samples are met exactly: nothing to measure the others by.
        return torch.ones_like(size)
    return limit / size.clamp_min(limit)
