"""The functions of expressions (`interpret`) on tensors."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor


def _max(a: Any, b: Any) -> Tensor:
    if isinstance(a, Tensor) and isinstance(b, Tensor):
        return torch.maximum(a, b)
    return a.clamp_min(b) if isinstance(a, Tensor) else b.clamp_min(a)


def _min(a: Any, b: Any) -> Tensor:
    if isinstance(a, Tensor) and isinstance(b, Tensor):
        return torch.minimum(a, b)
    return a.clamp_max(b) if isinstance(a, Tensor) else b.clamp_max(a)


TORCH: dict[str, Callable[..., Tensor]] = {
    "sqrt": torch.sqrt,
    "abs": torch.abs,
    "exp": torch.exp,
    "log": torch.log,
    "asinh": torch.asinh,
    "cos": torch.cos,
    "sin": torch.sin,
    "atan2": torch.atan2,
    "floor": torch.floor,
    "fract": lambda x: x - torch.floor(x),
    "max": _max,
    "min": _min,
    "step": lambda edge, x: (x >= edge).to(x.dtype),
}
