"""A material whose base colour varies over a surface: f = plain + tint · tinted, linear in the colour at each point.

The `tint` of a point is its base colour over the mean one, channel by channel. So `tinted`, what the colour multiplies,
is that of the mean colour, and where the tint is 1 the two parts add up to the mean material. The parts may be below 0
where they are what is left of a part without a lobe; they are then summed and never shown alone.
"""

from dataclasses import dataclass, replace

from torch import Tensor

from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.in_kind import answering_in_kind
from homofact.brdf.reflectance import Derived, Reflectance


@dataclass(frozen=True)
class Tinted:
    """A `Reflectance` of two parts of the same channels, as the module's head says; its values are those of tint 1."""

    tinted: Reflectance
    plain: Reflectance

    @classmethod
    def of(cls, model: MetallicRoughness) -> "Tinted":
        """glTF's material, its base colour being the mean one."""
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
    """Values (N, C) in sr⁻¹ without the cosine; a `tint` (N, C) or (C,) counts where the reflectance is `Tinted`."""
    if tint is None or not isinstance(reflectance, Tinted):
        return reflectance.evaluate(wi, wo)
    return reflectance.under(tint, wi, wo)
