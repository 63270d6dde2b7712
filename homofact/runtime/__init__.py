"""Evaluate a saved fit with NumPy alone, or numba for many pairs: no torch, colour science or command line.

    from homofact import runtime

    paint = runtime.load("out/paint")  # the folder of a result or of an export, or a saved fit
    paint.evaluate(wi, wo)  # (..., C) in sr⁻¹, without the cosine

`load` is `homofact.load`. To evaluate arrays and lists, a fit needs only the packages that `import homofact` needs,
NumPy, and numba for `MANY` or more pairs of float32.
"""

from homofact.api.loading import load
from homofact.shading.on_arrays import MANY

__all__ = ["MANY", "load"]
