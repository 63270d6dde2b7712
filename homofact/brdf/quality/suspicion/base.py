"""Properties of the base of a material: its reflection away from the highlight, at θh above 25°."""

import math
from functools import lru_cache

import numpy as np

from homofact.brdf.quality.suspicion.evidence import Evidence, logs_of, robust_fit

_BASE = math.radians(25.0)
_LEAST_COSINE = 0.08
_FEWEST = 30


@lru_cache(maxsize=4)
def base_of(evidence: Evidence) -> tuple[float, float] | None:
    """Return (exponent of cosθi cosθo in the base, π × its median as an albedo); None for too few samples."""
    theta_h, _ = evidence.half_angles
    cos_i, cos_o = evidence.cosines
    base = (theta_h > _BASE) & (np.minimum(cos_i, cos_o) > _LEAST_COSINE)
    lit = base & (evidence.brightness > 0)
    if lit.sum() < _FEWEST:
        return None
    logs, weight = logs_of(evidence.brightness)
    grazing = np.log(cos_i * cos_o)
    columns = np.column_stack([np.ones_like(grazing), grazing])
    exponent = robust_fit(columns[base], logs[base], weight[base], 1e-6)[0][1]
    return float(exponent), math.pi * float(np.median(evidence.brightness[lit]))
