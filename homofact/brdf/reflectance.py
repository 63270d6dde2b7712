"""The one interface through which everything asks for reflectance."""

from typing import Protocol, runtime_checkable

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

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """BRDF values (N, C) in sr⁻¹, linear, without the cosine.

        `wi` and `wo` are (N, 3) unit vectors in the surface frame (z the normal, x the tangent), both
        pointing away from the surface. Pairs with a direction under the horizon give 0.
        """
        ...
