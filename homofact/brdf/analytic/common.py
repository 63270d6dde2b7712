"""The base class of the analytic models, checks of their parameters, and geometry without division by zero.

A model only defines `formula`; `evaluate` returns 0 below the horizon. Every formula stays finite: cosines in
denominators are at least `MIN_COSINE`. The cosine between a direction and the half vector is computed as |ωi + ωo|/2,
which is the same for both directions.

The functions here take tensors or NumPy arrays (`geometry.namespace`) and load no torch.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from homofact.brdf.in_kind import answering_in_kind
from homofact.errors import BadInput
from homofact.geometry.namespace import length, like, namespace, normalized

if TYPE_CHECKING:
    from torch import Tensor

MIN_COSINE = 1e-6
RGB = ("R", "G", "B")
Colour = tuple[float, ...]


@dataclass(frozen=True)
class AnalyticModel(ABC):
    """Base of the models: a `Reflectance` that reads no table.

    Subclasses declare their parameters as fields (`Colour` fields have one number per channel) and write `formula`.
    `channels` names the C channels.
    """

    channels: tuple[str, ...] = field(default=RGB, kw_only=True)

    @property
    def isotropic(self) -> bool:
        """Whether the value is unchanged when both directions are turned about the normal together."""
        return True

    @property
    def nbytes(self) -> int:
        """Bytes of the coefficients as float32."""
        return 4 * sum(_count(getattr(self, item.name)) for item in fields(self) if item.name != "channels")

    @property
    def fetches(self) -> int:
        """0: nothing is looked up."""
        return 0

    @abstractmethod
    def formula(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the model's values (N, C) in sr⁻¹ for directions on or above the horizon."""

    @answering_in_kind
    def evaluate(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return BRDF values (N, C) in sr⁻¹, linear, without the cosine; 0 where a direction is under the horizon.

        `wi`, `wo` are (N, 3) unit vectors in the surface frame. Values are finite and non-negative everywhere. If a
        model diverges at grazing angles, it uses cosines of at least 1e-6.
        """
        above = (wi[..., 2] >= 0) & (wo[..., 2] >= 0)
        values = self.formula(wi, wo)
        return namespace(wi).where(above[..., None], values, like(0.0, values))

    def colour(self, value: Colour, directions: "Tensor") -> "Tensor":
        """Return a `Colour` as a tensor (C,) in the dtype and on the device of the directions."""
        return like(value, directions)

    def diffuse_term(self, value: Colour, directions: "Tensor") -> "Tensor":
        """ρd/π (N, C) in sr⁻¹."""
        shape = (*directions.shape[:-1], len(self.channels))
        return namespace(directions).broadcast_to(self.colour(value, directions) / math.pi, shape)

    def check_colour(self, name: str) -> None:
        """Refuse a colour field whose length is not the number of channels or that is not finite and ≥ 0."""
        value = getattr(self, name)
        who = f"{type(self).__name__}: {name}"
        if len(value) != len(self.channels):
            raise BadInput(f"{who} has {len(value)} numbers", expected=f"one for each of {', '.join(self.channels)}")
        if not all(math.isfinite(x) and x >= 0 for x in value):
            raise BadInput(f"{who} is {value}", expected="finite numbers >= 0")

    def check_above(self, name: str, bound: float, inclusive: bool = False) -> None:
        """Raise BadInput unless a scalar field is finite and above `bound` (or equal to it, if `inclusive`)."""
        value = getattr(self, name)
        if not math.isfinite(value) or value < bound or (value == bound and not inclusive):
            sign = ">=" if inclusive else ">"
            raise BadInput(
                f"{name} is {value}", where=type(self).__name__, expected=f"a finite number {sign} {bound:g}"
            )


def _count(value: Any) -> int:
    """Numbers in a parameter: a scalar, or nested tuples and dataclasses of them."""
    if isinstance(value, tuple):
        return sum(_count(item) for item in value)
    if hasattr(value, "__dataclass_fields__"):
        return sum(_count(getattr(value, item.name)) for item in fields(value))
    return 1


def half_vector(wi: "Tensor", wo: "Tensor") -> "tuple[Tensor, Tensor]":
    """Return (h, cosθd): the unit half vector (..., 3) and cosθd = h·ωi = h·ωo = |ωi + ωo|/2 (...).

    If ωi and ωo are opposite directions on the horizon, h is undefined; the function then returns the normal and cosθd
    = 0.
    """
    total = wi + wo
    return normalized(total), length(total) / 2


def grazing(cosine: "Tensor") -> "Tensor":
    """Return the cosine, but at least `MIN_COSINE`, so that it is safe to divide by."""
    return namespace(cosine).clip(cosine, MIN_COSINE, None)


def v_grooves(wi: "Tensor", wo: "Tensor") -> "Tensor":
    """Return V-groove masking min(1, 2 (n·h)(n·ωo)/(h·ωo), 2 (n·h)(n·ωi)/(h·ωi)), (...)."""
    h, cosine = half_vector(wi, wo)
    library = namespace(wi)
    least = library.minimum(grazing(wi[..., 2]), grazing(wo[..., 2]))
    return library.clip(2 * grazing(h[..., 2]) * least / grazing(cosine), None, 1)


def schlick(normal_incidence: "Tensor", cosine: "Tensor") -> "Tensor":
    """Return Schlick's F0 + (1 − F0)(1 − cosθd)⁵ (N, C), for F0 (C,) and cosθd (N,) (Schlick 1994)."""
    return normal_incidence + (1 - normal_incidence) * (namespace(cosine).clip(1 - cosine, 0, 1) ** 5)[..., None]
