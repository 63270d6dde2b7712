"""A robust scale of residuals: 1.4826 times the median |r|, which equals σ for Gaussian residuals."""

from torch import Tensor

_NORMAL_MAD = 1.4826


def scale_of(residuals: Tensor) -> float:
    """Return the robust σ of residuals (N,) from the median of their absolute values."""
    return _NORMAL_MAD * float(residuals.abs().median())
