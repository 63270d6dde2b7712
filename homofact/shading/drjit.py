"""A factorization evaluated in Dr.Jit, for Mitsuba: the arithmetic of `Factorization.evaluate` on its arrays.

Every number of the projections is a constant of the traced kernel, and what multiplies 0 is not traced. Two systems
are computed in a form that holds in float32, from e = (ωi − ωo)/2, which is at right angles to h:

* half-diff: with L = √(hy² + hz²) the frame of `directions.half_difference` is r = (L, −hx hy/L, −hx hz/L) and
  s = (0, hz, −hy)/L; as ωi = e + (h·ωi) h and h·e = 0, d = (ex/L, (hz ey − hy ez)/L, h·ωi).
* isotropic half-diff: sin θd = |e|, and the components of ωi across and along the plane of n and h, both times
  |n × h|, are hx ey − hy ex and ez.

Import this module only where Mitsuba is (`mitsuba_bsdf.register` sees to that).
"""

import math
from importlib import import_module
from typing import Any

import numpy as np

from homofact.brdf.log_transform import MOST
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Warp

# Their types depend on the variant that is set when they run, so that no checker can know them.
dr: Any = import_module("drjit")


class DrJitFactorization:
    """The textures of a factorization on the device of Mitsuba's variant, and their evaluation.

    `textures` are Mitsuba's `Texture2f` of (rows, columns, C) logarithms in the variant's precision.
    """

    def __init__(self, factorization: Factorization, mi: Any) -> None:
        """Copy the texels to textures of `mi`, the mitsuba module with a variant set."""
        self._mi = mi
        # A periodic axis is laid out flat, so that one wrap mode serves all.
        self._terms = tuple(term.flat() for term in factorization.terms)
        self._epsilon = factorization.transform.epsilon
        self._mean = factorization.transform.mean.tolist()
        self.textures = [_texture(term, mi) for term in self._terms]

    def evaluate(self, wi: Any, wo: Any, active: Any) -> list[Any]:
        """C values in sr⁻¹, without the cosine, for light `wi` and viewer `wo`; 0 where not `active`.

        Both directions are Mitsuba's vectors, unit, and above the surface wherever `active`.
        """
        up = self._mi.Vector3f(0, 0, 1)
        wi, wo = dr.select(active, wi, up), dr.select(active, wo, up)
        logs = [self._mi.Float(0)] * len(self._mean)
        prepared: dict[tuple[str, float | None], list[Any]] = {}
        for term, texture in zip(self._terms, self.textures, strict=True):
            warp = term.projection.warp
            key = (term.projection.coordinates, None if warp is None else warp.width)
            if key not in prepared:
                x = _COORDINATES[key[0]](wi, wo)
                prepared[key] = x if warp is None else _warped(key[0], warp, x)
            for matrix in term.projection.matrices():
                place = self._place(prepared[key], matrix.tolist(), term.size)
                logs = [a + b for a, b in zip(logs, texture.eval(place, active), strict=True)]
        values = [
            mean * dr.maximum(dr.exp(dr.minimum(log, MOST)) - self._epsilon, 0)
            for mean, log in zip(self._mean, logs, strict=True)
        ]
        return [dr.select(active, value, 0) for value in values]

    def _place(self, x: list[Any], matrix: list[list[float]], size: tuple[int, int]) -> Any:
        """Where Mitsuba's sampler reads for coordinates `x`: texel centres at (column + ½)/columns."""
        rows, columns = size
        u, v = (
            sum((weight * each for weight, each in zip(row, x, strict=True) if weight != 0), self._mi.Float(0))
            for row in matrix
        )
        # (u + 1)/2 · (columns − 1) + ½, all over columns; the wrap mode clamps.
        return self._mi.Point2f(
            u * (0.5 * (columns - 1) / columns) + 0.5,
            v * (0.5 * (rows - 1) / rows) + 0.5,
        )


def _texture(term: Term, mi: Any) -> Any:
    precision = np.float64 if "double" in mi.variant() else np.float32
    tensor = mi.TensorXf(np.ascontiguousarray(term.texture.cpu().numpy(), dtype=precision))
    # No hardware sampler: its weights have 8 bits.
    return mi.Texture2f(tensor, False, False, dr.FilterMode.Linear, dr.WrapMode.Clamp)


def _length(x: Any, y: Any) -> Any:
    # hypot divides by the larger one, which a scalar variant cannot where both are 0.
    return dr.sqrt(x * x + y * y)


def _disc(w: Any) -> list[Any]:
    scale = 1 / (1 + w.z)
    return [w.x * scale, w.y * scale]


def _in_out(wi: Any, wo: Any) -> list[Any]:
    return _disc(wi) + _disc(wo)


def _half_diff(wi: Any, wo: Any) -> list[Any]:
    h, e = dr.normalize(wi + wo), (wi - wo) * 0.5
    across = 1 / dr.maximum(_length(h.y, h.z), 1e-9)
    scale = 1 / (1 + dr.dot(h, wi))
    return [*_disc(h), e.x * across * scale, (h.z * e.y - h.y * e.z) * across * scale]


def _isotropic_half_diff(wi: Any, wo: Any) -> list[Any]:
    h, e = dr.normalize(wi + wo), (wi - wo) * 0.5
    theta_h = dr.atan2(_length(h.x, h.y), h.z)
    theta_d = dr.atan2(dr.norm(e), dr.dot(wi, h))
    phi_d = dr.atan2(dr.abs(h.x * e.y - h.y * e.x), dr.abs(e.z))
    return [angle * (4 / math.pi) - 1 for angle in (theta_h, theta_d, phi_d)]


def _isotropic_in_out(wi: Any, wo: Any) -> list[Any]:
    turn = dr.abs(dr.atan2(wi.y, wi.x) - dr.atan2(wo.y, wo.x))
    folded = dr.minimum(turn, 2 * math.pi - turn)
    polar = [dr.atan2(_length(w.x, w.y), w.z) * (4 / math.pi) - 1 for w in (wi, wo)]
    return [*polar, folded * (2 / math.pi) - 1]


def _half_angles(wi: Any, wo: Any) -> list[Any]:
    s = wi + wo
    return [dr.atan2(_length(s.x, s.y), s.z) * (4 / math.pi) - 1, dr.atan2(s.y, s.x) * (1 / math.pi)]


_COORDINATES = {
    "in-out": _in_out,
    "half-diff": _half_diff,
    "isotropic-half-diff": _isotropic_half_diff,
    "isotropic-in-out": _isotropic_in_out,
    "half-angles": _half_angles,
}


def _warped(name: str, warp: Warp, x: list[Any]) -> list[Any]:
    """Coordinates with their half-vector part stretched, as `Warp.on`, which knows these two systems alone."""
    scale = 1 / math.asinh(1 / warp.width)
    if name == "half-diff":
        radius = dr.maximum(_length(x[0], x[1]), 1e-6)
        factor = dr.asinh(radius / warp.width) * scale / radius
        return [x[0] * factor, x[1] * factor, *x[2:]]
    rho = dr.maximum((x[0] + 1) * 0.5, 0)
    return [dr.asinh(rho / warp.width) * scale * 2 - 1, *x[1:]]
