"""A saved fit evaluated with NumPy alone, numba for many pairs: no torch, no colour science, no command line.

    from homofact import runtime

    paint = runtime.load("out/paint")  # a result's folder, or a saved fit
    paint.evaluate(wi, wo)  # (..., C) in sr⁻¹, without the cosine

It needs what `homofact` needs to be imported, and of other packages NumPy (and numba, from `MANY` pairs on).
"""

from homofact.runtime.evaluate import MANY, RuntimeFit
from homofact.runtime.load import load

__all__ = ["MANY", "RuntimeFit", "load"]
