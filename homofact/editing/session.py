"""An editing session: curves that are set, undone, redone and kept by name, and the pictures they make.

    prepared = prepare(scene)
    session = Session(prepared)
    session.slide(("paint", "specular", "distribution"), sigma=0.05)
    values = session.picture(0)
    session.undo()

A part of the picture is recomputed only if one of its own curves changed. A `Stroke` is the drag of one curve: the
other curves stay fixed (eq. 26), and every frame adds the few most important wavelets (`wavelets`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from homofact.editing.curves import Bands, widened
from homofact.editing.furnace import Albedo, albedo_of
from homofact.editing.material import Editable, Edited
from homofact.editing.picture import Address, add_part, factor_of, part_picture, starting_curves, summed_curves
from homofact.editing.scene import PreparedScene
from homofact.editing.sender_albedo import mean_weights
from homofact.editing.shown import shown_pictures
from homofact.editing.wavelets import TERMS, Incremental
from homofact.errors import BadInput

START = "start"


class Session:
    """The curves of all materials of a prepared scene, with their history. Curves are checked as they are set."""

    def __init__(self, prepared: PreparedScene) -> None:
        self.prepared = prepared
        self._states = [starting_curves(prepared)]
        self._now = 0
        self._kept = {START: self._states[0]}
        self._shown: list[tuple[tuple[Bands, ...], Tensor] | None] = [None] * len(prepared.parts)

    @property
    def curves(self) -> dict[Address, Bands]:
        """All curves as they are now."""
        return dict(self._states[self._now])

    @property
    def changed(self) -> dict[Address, Bands]:
        """Return the curves that differ from their start."""
        start = self._kept[START]
        return {
            address: curve
            for address, curve in self._states[self._now].items()
            if not torch.equal(curve.values, start[address].values)
        }

    def material(self, name: str) -> Editable:
        """Return the material of that name. Raises BadInput for one that is not in the scene."""
        materials = self.prepared.scene.materials
        for material in materials:
            if material.name == name:
                return material
        known = ", ".join(material.name for material in materials)
        raise BadInput(where="material", found=repr(name), expected=f"one of {known}")

    def set(self, curves: dict[Address, Bands]) -> None:
        """Change some curves in one step that one `undo` reverts.

        Raises BadInput for unknown or unsuitable curves, and changes nothing in this case.
        """
        checked = {address: self.material(address[0]).checked(address[1:], curve) for address, curve in curves.items()}
        del self._states[self._now + 1 :]
        self._states.append({**self._states[self._now], **checked})
        self._now += 1

    def slide(self, address: Address, **values: float | tuple[float, ...]) -> None:
        """Set a curve by its model's sliders. Raises BadInput for a curve without any, and values out of range."""
        slot = self.material(address[0]).slot(address[1:])
        if slot.sliders is None:
            wanted = "a curve drawn by hand"
            raise BadInput("has no sliders", where=f"{address[0]}: {address[1]}: {address[2]}", expected=wanted)
        self.set({address: slot.banded(slot.sliders.curve(**values))})

    def widen(self, address: Address, factor: float) -> None:
        """Multiply a curve's angles by `factor`: above 1 a highlight gets wider, below 1 narrower; its height stays.

        Raises BadInput for a curve that is not there, one with the same value at every angle, and a factor <= 0.
        """
        slot = self.material(address[0]).slot(address[1:])
        curve = self._states[self._now][address]
        if bool((curve.values == curve.values[:1]).all()):
            where, hint = f"{address[0]}: {address[1]}: {slot.name}", 'prepare the material with curves = "HF"'
            found = "the same value at every angle"
            raise BadInput(where=where, found=found, expected="a curve with a highlight", hint=hint)
        self.set({address: widened(curve, factor)})

    def scale(self, address: Address, factor: float | Sequence[float]) -> None:
        """Multiply a curve's values by a factor for all channels, or by one per channel: below 1 it gets darker.

        Raises BadInput for a curve that is not there, and for factors that are not above 0.
        """
        curve = self._states[self._now].get(address)
        if curve is None:
            known = ", ".join(map(str, self._states[self._now]))
            raise BadInput(where="address", found=repr(address), expected=f"one of {known}")
        factors = torch.as_tensor(factor, dtype=torch.float64)
        channels = len(self.material(address[0]).channels)
        if factors.shape not in ((), (channels,)) or not bool((torch.isfinite(factors) & (factors > 0)).all()):
            raise BadInput(where="factor", found=repr(factor), expected=f"a number above 0, or {channels}")
        self.set({address: Bands(curve.values * factors, curve.finer)})

    def keep_albedo(self, address: Address) -> None:
        """Scale a curve, in each channel, until its material has the mean albedo that it had at the start.

        The mean is taken under uniform light. Raises BadInput for an unknown curve, and if no factor reaches the
        albedo.
        """
        slot = self.material(address[0]).slot(address[1:])
        curve = self._states[self._now][address]
        without = self._states[self._now] | {address: Bands(torch.zeros_like(curve.values), curve.finer)}
        states = self._kept[START], self._states[self._now], without
        before, now, others = (self._mean_albedo(address[0], state) for state in states)
        factors = (before - others) / (now - others)
        if not bool((torch.isfinite(factors) & (factors > 0)).all()):
            where = f"{address[0]}: {address[1]}: {slot.name}"
            raise BadInput(where=where, found="no factor for the albedo", expected="a curve that reflects enough light")
        # A curve over both directions multiplies twice.
        self.set({address: Bands(curve.values * factors ** (1 / (1 + slot.also_outgoing)), curve.finer)})

    def _mean_albedo(self, name: str, curves: dict[Address, Bands]) -> Tensor:
        """Return the mean albedo (C,) of a material with these curves under uniform light."""
        own = {address[1:]: curve for address, curve in curves.items() if address[0] == name}
        found = albedo_of(self.material(name).edited(own))
        return torch.from_numpy(mean_weights()) @ torch.tensor(found.values, dtype=torch.float64)

    def shown(self) -> list[np.ndarray]:
        """Return the views as 8-bit sRGB (H, W, 3), at the exposure of the scene without edits."""
        return shown_pictures(self.prepared, self._states[self._now])

    def undo(self) -> bool:
        """Undo one step; return whether there was one."""
        if self._now == 0:
            return False
        self._now -= 1
        return True

    def redo(self) -> bool:
        """Redo one undone step; return whether there was one."""
        if self._now + 1 == len(self._states):
            return False
        self._now += 1
        return True

    def keep(self, name: str) -> None:
        """Store all curves under a name, for presets or to compare A with B; "start" is reserved."""
        if name == START:
            wanted = "another: it means the curves as they started"
            raise BadInput(where="preset", found=f"the name {name!r}", expected=wanted)
        self._kept[name] = self._states[self._now]

    @property
    def kept(self) -> tuple[str, ...]:
        """Return the names that `recall` accepts."""
        return tuple(self._kept)

    def recall(self, name: str) -> None:
        """Set all curves to a stored state, in one step. Raises BadInput for an unknown name."""
        if name not in self._kept:
            raise BadInput(where="preset", found=repr(name), expected=f"one of {', '.join(self._kept)}")
        self.set(self._kept[name])

    def picture(self, view: int) -> Tensor:
        """Return R (P, C), float64, of the covered pixels of a view."""
        prepared, curves = self.prepared, self._states[self._now]
        if not 0 <= view < len(prepared.pixels):
            raise BadInput(where="view", found=f"number {view}", expected=f"0 to {len(prepared.pixels) - 1}")
        total = torch.zeros(len(prepared.pixels[view]), len(prepared.scene.channels), dtype=torch.float64)
        for number, part in enumerate(prepared.parts):
            if part.view != view:
                continue
            material = prepared.scene.objects[part.object].material
            own = tuple(curves[material.name, part.term, slot.name] for slot in material.term(part.term).slots)
            shown = self._shown[number]
            if shown is None or any(a is not b for a, b in zip(shown[0], own, strict=True)):
                shown = self._shown[number] = own, part_picture(prepared, part, curves)
            add_part(total, prepared, part, shown[1], curves)
        return total

    def edited(self, name: str) -> Edited:
        """Return a material with its current curves, as a `Reflectance`."""
        material = self.material(name)
        own = {address[1:]: curve for address, curve in self.curves.items() if address[0] == name}
        return material.edited(own)

    def albedo(self, name: str) -> Albedo:
        """Return the white furnace's albedo of a material as it is now; `warning()` of it says where it exceeds 1."""
        return albedo_of(self.edited(name))

    def stroke(self, address: Address) -> "Stroke":
        """Begin to drag a curve. Raises BadInput for one that is not there, or over θo alone (`set` is as fast)."""
        return Stroke.of(self, address)


@dataclass
class Stroke:
    """One curve while it is dragged; `finish` makes it a step of the session.

    `parts` are the increments of those parts of the session, by index, that depend on the curve.
    """

    session: Session
    address: Address
    curve: Bands
    parts: dict[int, Incremental] = field(default_factory=dict)

    @classmethod
    def of(cls, session: Session, address: Address) -> "Stroke":
        """Hold all other curves (curve switching) and show the curve as it is."""
        material, curves = session.material(address[0]), session.curves
        slot = material.slot(address[1:])
        if not slot.in_sum:
            wanted = "a curve over an angle with the light"
            raise BadInput("has one number per pixel", where=": ".join(address), expected=wanted)
        made = cls(session, address, curves[address])
        active = material.term(address[1]).summed.index(slot)
        for number, part in enumerate(session.prepared.parts):
            if session.prepared.scene.objects[part.object].material is material and part.term == address[1]:
                held = part.transport.wavelets(active, summed_curves(part, material, curves))
                made.parts[number] = Incremental.started(held, made.curve.values)
        return made

    def set(self, curve: Bands) -> None:
        """Drag. Raises BadInput for a curve that does not fit."""
        self.curve = self.session.material(self.address[0]).checked(self.address[1:], curve)
        for part in self.parts.values():
            part.set_curve(self.curve.values)

    def update(self, terms: int = TERMS) -> int:
        """Add up to `terms` wavelets to every part; return the most that were added to one, 0 when settled."""
        return max((part.update(terms) for part in self.parts.values()), default=0)

    def picture(self, view: int) -> Tensor:
        """Return R (P, C) of the updates so far; curves over θo and other factors of a part are exact at once."""
        session = self.session
        total = session.picture(view)
        prepared, curves = session.prepared, session.curves
        changed = {**curves, self.address: self.curve}
        for number, part in enumerate(prepared.parts):
            increment, shown = self.parts.get(number), session._shown[number]
            if part.view != view or (increment is None and part.senders is None):
                continue
            assert shown is not None
            now = shown[1]
            if increment is not None:
                now = increment.shown * factor_of(part, prepared.scene.objects[part.object].material, changed)
            add_part(total, prepared, part, now, changed)
            add_part(total, prepared, part, -shown[1], curves)
        return total

    def finish(self) -> None:
        """Make the curve a step of the session."""
        self.session.set({self.address: self.curve})
