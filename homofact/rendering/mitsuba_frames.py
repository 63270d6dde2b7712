"""A material of Mitsuba 3 in the surface frames that a mesh brings along.

Mitsuba takes the tangent of a mesh from its texture coordinates. `framed` turns a material about the shading normal so
that its x axis is the mesh's attribute `vertex_tangent` (interpolated, then made orthogonal to the normal) instead.
"""

from functools import cache
from importlib import import_module
from typing import Any

TANGENT = "vertex_tangent"


def framed(bsdf: Any) -> Any:
    """The material (a `mitsuba.BSDF`) in the frames of the attribute `vertex_tangent`, for meshes that have it."""
    mi = import_module("mitsuba")
    return _class_of(mi.variant())(bsdf)


@cache
def _class_of(variant: str) -> Any:
    """The class for a variant, which is the one that is set."""
    mi, dr = import_module("mitsuba"), import_module("drjit")

    class Framed(mi.BSDF):
        """`mitsuba.BSDF` around another; arguments and results are Mitsuba's."""

        def __init__(self, nested: Any) -> None:
            mi.BSDF.__init__(self, mi.Properties("homofact_framed"))
            self.nested = nested
            self.m_components = [nested.flags()]
            self.m_flags = nested.flags()

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return F cosθ of the light."""
            own, turn = self._turned(si, active)
            return self.nested.eval(ctx, own, _rotate(wo, turn), active)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Density of `sample`, in sr⁻¹."""
            own, turn = self._turned(si, active)
            return self.nested.pdf(ctx, own, _rotate(wo, turn), active)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return both at once."""
            own, turn = self._turned(si, active)
            return self.nested.eval_pdf(ctx, own, _rotate(wo, turn), active)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            """Return a direction, and f cosθ over its density."""
            own, turn = self._turned(si, active)
            sample, weight = self.nested.sample(ctx, own, sample1, sample2, active)
            sample.wo = _rotate(sample.wo, (turn[0], -turn[1]))
            return sample, weight

        def to_string(self) -> str:
            """Return what is inside."""
            return f"framed[{self.nested}]"

        def _turned(self, si: Any, active: Any) -> tuple[Any, tuple[Any, Any]]:
            """The interaction in the frame of the tangent, and (cosine, sine) of the turn to it."""
            local = si.sh_frame.to_local(si.shape.eval_attribute_3(TANGENT, si, active))
            length = dr.sqrt(local.x * local.x + local.y * local.y)
            turn = (dr.select(length > 0, local.x / length, 1), dr.select(length > 0, local.y / length, 0))
            own = mi.SurfaceInteraction3f(si)
            own.wi = _rotate(si.wi, turn)
            return own, turn

    def _rotate(w: Any, turn: tuple[Any, Any]) -> Any:
        cosine, sine = turn
        return mi.Vector3f(cosine * w.x + sine * w.y, cosine * w.y - sine * w.x, w.z)

    return Framed
