"""A material whose base colour varies over a surface: f = plain + tint · tinted, linear in the colour at each point.

The `tint` of a point is its base colour divided by the mean base colour, per channel. `tinted` is the part of f that is
proportional to the base colour, for the mean colour. So with tint 1 the two parts add up to the material with the mean
colour. A part may be negative if it is a difference of two BRDFs. Only the sum of the parts is rendered.
"""

from dataclasses import dataclass, replace

from torch import Tensor

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived, Reflectance


@dataclass(frozen=True)
class Tinted:
    """A `Reflectance` with the parts `plain` and `tinted` of the module docstring; its values have tint 1."""

    tinted: Reflectance
    plain: Reflectance

    @classmethod
    def of(cls, model: MetallicRoughness) -> "Tinted":
        """Split a glTF material, whose base colour is the mean colour."""
        plain = replace(model, base_colour=(0.0,) * len(model.base_colour))
        return cls(_Difference(model, plain), plain)

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of both parts."""
        return self.tinted.channels

    @property
    def nbytes(self) -> int:
        """What both parts read."""
        return self.tinted.nbytes + self.plain.nbytes

    @property
    def fetches(self) -> int:
        """Look-ups of both parts."""
        return self.tinted.fetches + self.plain.fetches

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return values (N, C) in sr⁻¹ without the cosine, where the tint is 1."""
        return self.tinted.evaluate(wi, wo) + self.plain.evaluate(wi, wo)

    def under(self, tint: Tensor, wi: Tensor, wo: Tensor) -> Tensor:
        """Return values (N, C) in sr⁻¹ without the cosine, where the tint is (N, C) or (C,)."""
        return self.tinted.evaluate(wi, wo) * tint + self.plain.evaluate(wi, wo)


@dataclass(frozen=True)
class _Difference(Derived):
    """What a model has that another, darker one has not."""

    other: Reflectance

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return values (N, C) in sr⁻¹; rounding below 0 is cut."""
        return (self.base.evaluate(wi, wo) - self.other.evaluate(wi, wo)).clamp_min(0)


def values_under(reflectance: Reflectance, tint: Tensor | None, wi: Tensor, wo: Tensor) -> Tensor:
    """Return values (N, C) in sr⁻¹ without the cosine, under a `tint` (N, C) or (C,) if `Tinted`."""
    if tint is None or not isinstance(reflectance, Tinted):
        return reflectance.evaluate(wi, wo)
    return reflectance.under(tint, wi, wo)
