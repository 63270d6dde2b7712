"""A material that can be edited: a sum of terms ρ = ρ_q · f_A(γ_A) · f_B(γ_B) (Ben-Artzi et al. 2006, eq. 7 and 9).

The quotient ρ_q is fixed and arbitrary; the user edits the curves. A curve over θo only has one value per pixel, which
multiplies the sum over the light. A curve at both θi and θo (P of eq. 17) enters the sum at θi and also multiplies it
at θo. A term has one or two curves in the sum.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from homofact.brdf.in_kind import answering_in_kind
from homofact.editing.angles import PEAKED, angle, check_angle
from homofact.editing.curves import BANDS, Bands, Curve, banded
from homofact.errors import BadInput
from homofact.factor.edited import LETTERS
from homofact.geometry.directions import above_horizon

Quotient = Callable[[Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class Slot:
    """One editable curve of a term: over which `angle`, and how it starts.

    If `also_outgoing` is true, the curve is over θi and also multiplies at θo, as P of a homomorphic factorization.
    `sliders` makes the curve from named numbers and has their start values; it is None for curves that are only drawn
    by hand. `bands` is the number J of bands of the curve in pictures. Bands over the angles of highlights are finer
    near 0 (`finer`), the others equal.
    """

    name: str
    angle: str
    start: Curve
    bands: int = BANDS[0]
    also_outgoing: bool = False
    sliders: "Sliders | None" = None

    def __post_init__(self) -> None:
        """Reject an unknown angle, and an unsupported number of bands."""
        check_angle(self.angle)
        if self.bands not in BANDS:
            wanted = f"one of {', '.join(map(str, BANDS))}"
            raise BadInput(where=f"{self.name}: bands", found=self.bands, expected=wanted)
        if self.also_outgoing and self.angle != "theta_i":
            found = f"a curve over {LETTERS[self.angle]} at both ends"
            raise BadInput(where=self.name, found=found, expected="one over θi")

    @property
    def in_sum(self) -> bool:
        """Whether the curve's angle depends on the light, so that it counts in the sum over it."""
        return self.angle != "theta_o"

    @property
    def finer(self) -> bool:
        """Whether the bands are finer near 0."""
        return self.angle in PEAKED

    def banded(self, curve: Curve) -> Bands:
        """Return a curve in the bands of this place."""
        return banded(curve, self.bands, self.finer)


@dataclass(frozen=True)
class Sliders:
    """The parameters of a curve: their `start` values by name, and `make`, which computes the curve from them.

    `formula` names what `make` computes for the page (formulas.js).
    """

    start: Mapping[str, float | tuple[float, ...]]
    make: Callable[..., Curve]
    formula: str

    def curve(self, **values: float | tuple[float, ...]) -> Curve:
        """Return the curve at the start values, with `values` replaced. Raises BadInput for unknown names."""
        for name in values:
            if name not in self.start:
                raise BadInput(where="slider", found=repr(name), expected=f"one of {', '.join(self.start)}")
        return self.make(**{**self.start, **values})


@dataclass(frozen=True)
class EditableTerm:
    """ρ_q and its curves. `quotient` maps (wi, wo) (N, 3) above the horizon to values (N, C)."""

    name: str
    quotient: Quotient
    slots: tuple[Slot, ...]

    def __post_init__(self) -> None:
        """Reject terms without a curve or with more than two curves in the sum over the light, and repeated names."""
        if not 1 <= len(self.summed) <= 2:
            found = len(self.summed)
            raise BadInput(where=self.name, found=f"{found} curves over angles with the light", expected="1 or 2")
        if len({slot.name for slot in self.slots}) < len(self.slots):
            raise BadInput(where=self.name, found="a curve's name twice", expected="different ones")

    @property
    def summed(self) -> tuple[Slot, ...]:
        """Return the one or two slots (A and B) whose curves are in the sum over the light."""
        return tuple(slot for slot in self.slots if slot.in_sum)

    def slot(self, name: str) -> Slot:
        """Return the slot of that name. Raises BadInput for a curve that the term does not have."""
        for slot in self.slots:
            if slot.name == name:
                return slot
        known = ", ".join(slot.name for slot in self.slots)
        raise BadInput(f"has no curve {name!r}", where=self.name, expected=f"one of {known}")

    def evaluate(self, wi: Tensor, wo: Tensor, curves: Mapping[str, Curve] | None = None) -> Tensor:
        """ρ_q times the curves (N, C): those of `curves` by their slots' names, else as they start."""
        chosen = curves or {}
        value = self.quotient(wi, wo)
        for slot in self.slots:
            curve = chosen.get(slot.name, slot.start)
            value = value * curve.at(angle(slot.angle, wi, wo))
            if slot.also_outgoing:
                value = value * curve.at(angle("theta_o", wi, wo))
        return value


Place = tuple[str, str]


@dataclass(frozen=True)
class Editable:
    """A material as a sum of terms; `notes` has one line per simplification in its construction."""

    name: str
    channels: tuple[str, ...]
    terms: tuple[EditableTerm, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Reject terms with equal names."""
        names = [term.name for term in self.terms]
        if not names or len(set(names)) < len(names):
            raise BadInput(where=self.name, found=f"the terms {', '.join(names) or 'none'}", expected="different names")

    @property
    def places(self) -> tuple[Place, ...]:
        """(term, curve) names of all curves."""
        return tuple((term.name, slot.name) for term in self.terms for slot in term.slots)

    def term(self, name: str) -> EditableTerm:
        """Return the term of that name. Raises BadInput for one that the material does not have."""
        for term in self.terms:
            if term.name == name:
                return term
        known = ", ".join(term.name for term in self.terms)
        raise BadInput(f"has no term {name!r}", where=self.name, expected=f"one of {known}")

    def slot(self, place: Place) -> Slot:
        """Return the slot at (term, curve). Raises BadInput for a curve that the material does not have."""
        return self.term(place[0]).slot(place[1])

    def banded_start(self) -> dict[Place, Bands]:
        """Return every curve as it starts, in its bands."""
        return {place: self.slot(place).banded(self.slot(place).start) for place in self.places}

    def checked(self, place: Place, curve: Bands) -> Bands:
        """Return the curve in the bands of that place; equal bands are converted to finer ones near 0 if needed.

        Raises BadInput for another number of bands or channels, and a curve that is 0 everywhere.
        """
        slot, where = self.slot(place), f"{self.name}: {place[0]}: {place[1]}"
        if curve.count != slot.bands or curve.channels != len(self.channels):
            found = f"{curve.count} bands of {curve.channels} channels"
            raise BadInput(where=where, found=f"a curve of {found}", expected=f"{slot.bands} of {len(self.channels)}")
        if not bool((curve.values > 0).any()):
            raise BadInput(where=where, found="a curve that is 0 everywhere", expected="some value above 0")
        return slot.banded(curve)

    def edited(self, curves: "Mapping[Place, Curve]") -> "Edited":
        """Return the material with these curves as a `Reflectance`; places that are not named stay as they start."""
        for place in curves:
            self.slot(place)
        return Edited(self, dict(curves))


@dataclass(frozen=True)
class Edited:
    """A material with some curves changed; a `Reflectance`.

    `fetches` counts one fetch per curve. The fetches of the quotients are unknown and not included.
    """

    material: Editable
    curves: dict[Place, Curve] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self.material.channels

    @property
    def nbytes(self) -> int:
        """Bytes of the curves as float32, in bands."""
        count = sum(slot.bands for term in self.material.terms for slot in term.slots)
        return 4 * count * len(self.channels)

    @property
    def fetches(self) -> int:
        """Curves that an evaluation reads."""
        return sum(1 + slot.also_outgoing for term in self.material.terms for slot in term.slots)

    @answering_in_kind
    def evaluate(self, wi: Tensor, wo: Tensor) -> Tensor:
        """Return BRDF values (N, C) in sr⁻¹, ≥ 0, without the cosine; 0 where a direction is under the horizon."""
        above, wi, wo = above_horizon(wi, wo)
        total = torch.zeros(len(wi), len(self.channels), dtype=wi.dtype)
        for term in self.material.terms:
            own = {name: curve for (where, name), curve in self.curves.items() if where == term.name}
            total = total + term.evaluate(wi, wo, own)
        return total * above[:, None]
