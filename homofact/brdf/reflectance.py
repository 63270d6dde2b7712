"""The one interface through which everything asks for reflectance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from homofact.errors import BadInput

Directions = Tensor | np.ndarray | Sequence[Sequence[float]]
_Evaluate = TypeVar("_Evaluate", bound=Callable[..., Any])


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


@dataclass(frozen=True)
class Derived:
    """What a `Reflectance` made of another has in common with `base`: all but what the subclass says."""

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

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The base's values (N, C) in sr⁻¹, without the cosine."""
        return self.base.evaluate(wi, wo)


class Exchanged(Derived):
    """A reflectance with light and viewer exchanged: renderers take the viewer for the incidence of a table."""

    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """The base's values (N, C) in sr⁻¹ without the cosine for light from ωo and a viewer at ωi."""
        return self.base.evaluate(wo, wi)


def answering_in_kind(evaluate: _Evaluate) -> _Evaluate:
    """An `evaluate(self, wi, wo)` of tensors that takes NumPy arrays and lists of (N, 3) directions too.

    The answer is an array to arrays (where one of the two is a tensor, a tensor), a list to lists. Whole numbers count
    as float64. Raises BadInput for what is no (N, 3) table of numbers.
    """

    @wraps(evaluate)
    def wrapped(self: Any, wi: Directions, wo: Directions) -> Any:
        if isinstance(wi, Tensor) and isinstance(wo, Tensor):
            return evaluate(self, wi, wo)
        values = evaluate(self, _tensor("wi", wi), _tensor("wo", wo))
        if isinstance(wi, Tensor) or isinstance(wo, Tensor):
            return values
        return values.numpy() if isinstance(wi, np.ndarray) or isinstance(wo, np.ndarray) else values.tolist()

    return wrapped  # type: ignore[return-value]


def _tensor(name: str, directions: Directions) -> Tensor:
    if isinstance(directions, Tensor):
        return directions
    try:
        # Lists by way of NumPy's float64: torch's own default is float32.
        found = torch.from_numpy(np.array(directions))
    except (TypeError, ValueError) as error:
        raise BadInput(f"{name}: found no table of numbers ({error}), expected (N, 3) directions") from error
    if found.ndim != 2 or found.shape[1] != 3:
        raise BadInput(f"{name}: found the shape {tuple(found.shape)}, expected (N, 3)")
    return found if found.is_floating_point() else found.to(torch.float64)
