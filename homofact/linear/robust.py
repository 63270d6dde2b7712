"""The scale of residuals that a minority of outliers cannot move: 1.4826 times the median |r|, σ of Gaussian ones."""

from torch import Tensor

_NORMAL_MAD = 1.4826


def scale_of(residuals: Tensor) -> float:
    """σ of residuals (N,), from the median of their absolute values."""
    return _NORMAL_MAD * float(residuals.abs().median())
