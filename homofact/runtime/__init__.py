"""A saved fit evaluated with NumPy alone, numba for many pairs: no torch, no colour science, no command line.

    from homofact import runtime

    paint = runtime.load("out/paint")  # the folder of a result or of an export, or a saved fit
    paint.evaluate(wi, wo)  # (..., C) in sr⁻¹, without the cosine

`load` is `homofact.load`: of arrays and lists a fit needs what `homofact` needs to be imported, and of other packages
NumPy (and numba, from `MANY` pairs of float32 on).
"""

from homofact.api.loading import load
from homofact.shading.on_arrays import MANY

__all__ = ["MANY", "load"]
