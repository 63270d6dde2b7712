"""Write formulas once for tensors and arrays: find the library of a value, and convert to values of its kind.

This module never imports torch: a caller that passes a tensor has already imported it.
"""

import sys
from typing import Any

import numpy as np


def namespace(array: Any) -> Any:
    """Return the module whose functions take `array`: torch for a tensor, else numpy.

    Both have sqrt, exp, expm1, floor, hypot, where, stack, clip, minimum, broadcast_to under the same names.
    """
    torch = sys.modules.get("torch")
    return torch if torch is not None and isinstance(array, torch.Tensor) else np


def like(values: Any, array: Any) -> Any:
    """Convert numbers, a tensor or an array to the kind of `array`: tensor or array, of its type, on its device."""
    library = namespace(array)
    if library is np:
        return np.asarray(values, dtype=array.dtype)
    return library.as_tensor(values, dtype=array.dtype, device=array.device)


def whole(values: Any) -> Any:
    """Convert whole numbers to 64-bit integers."""
    return values.astype(np.int64) if namespace(values) is np else values.long()


def length(v: Any) -> Any:
    """Return the lengths (...) of vectors (..., 3)."""
    return np.sqrt((v * v).sum(-1)) if namespace(v) is np else v.norm(dim=-1)


def normalized(v: Any) -> Any:
    """Return `v` (..., 3) scaled to length 1; the zero vector, which has no direction, becomes the normal."""
    library, size = namespace(v), length(v)[..., None]
    tiny = library.finfo(v.dtype).tiny
    return library.where(size > 0, v / library.clip(size, tiny, None), like((0, 0, 1), v))
