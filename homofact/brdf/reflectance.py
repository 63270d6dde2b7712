"""The interface of everything that can be evaluated as a BRDF."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from homofact.brdf.in_kind import answering_in_kind

if TYPE_CHECKING:
    from torch import Tensor


@runtime_checkable
class Reflectance(Protocol):
    """Anything that reflects: a measurement, an analytic model, a factorization.

    `channels` names the C columns of what `evaluate` returns, `nbytes` is the storage that evaluation
    reads from, `fetches` the number of texture (or table) lookups one evaluation makes.
    """

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels, for instance ("R", "G", "B")."""
        ...

    @property
    def nbytes(self) -> int:
        """Bytes of the tables or coefficients that an evaluation reads."""
        ...

    @property
    def fetches(self) -> int:
        """Texture or table lookups of one evaluation."""
        ...

    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, linear, without the cosine.

        `wi` and `wo` are (N, 3) unit vectors in the surface frame (z the normal, x the tangent), both
        pointing away from the surface. Pairs with a direction under the horizon give 0.
        """
        ...


@dataclass(frozen=True)
class Derived:
    """Base class of a `Reflectance` made from another, `base`; it forwards what a subclass does not define."""

    base: Reflectance

    @property
    def channels(self) -> tuple[str, ...]:
        """Those of the base."""
        return self.base.channels

    @property
    def nbytes(self) -> int:
        """Those of the base: it is what an evaluation reads."""
        return self.base.nbytes

    @property
    def fetches(self) -> int:
        """Those of the base."""
        return self.base.fetches

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the base's values (N, C) in sr⁻¹, without the cosine."""
        return self.base.evaluate(wi, wo)


class Exchanged(Derived):
    """A reflectance with light and viewer exchanged, since renderers use the viewer as the incidence of a table."""

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the base's values (N, C) in sr⁻¹ without the cosine for light from ωo and a viewer at ωi."""
        return self.base.evaluate(wo, wi)


def innermost(reflectance: Reflectance) -> Any:
    """Return the innermost base of a chain of `Derived` reflectances."""
    inner: Any = reflectance
    while hasattr(inner, "base"):
        inner = inner.base
    return inner
