"""Tables of the white furnace: the sum of `furnace`, with all parts precomputed that no curve changes.

Curves are constant on bands, so all nodes in the same bands of a term's curves can be summed. The table has one weight
per channel for each angle of ωi and each combination of bands: Σ ρ_q cosθo dωo. The weights times the curves give the
albedo of `furnace` up to rounding: for senders of light (`sender_albedo`), and on the page.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from homofact.editing.angles import PEAKED, angle
from homofact.editing.curves import band_of
from homofact.editing.furnace import DEGREES, furnace_nodes
from homofact.editing.material import EditableTerm


@dataclass(frozen=True)
class FurnaceTable:
    """One row for each combination: `degrees` (N,) uint8, the number in `DEGREES`; `bands` (N, F) uint8; `weights`.

    The F columns are the term's factors in the order of `factors`, which belong to the curves of the numbers `slots`;
    `weights` (N, C) float32.
    """

    degrees: np.ndarray
    bands: np.ndarray
    weights: np.ndarray
    slots: tuple[int, ...]

    def albedo(self, curves: Sequence[np.ndarray]) -> np.ndarray:
        """Return a(θi) (angles, C) of the term's curves (J, C), in their order."""
        value = self.weights.astype(np.float64)
        for column, number in enumerate(self.slots):
            value *= curves[number][self.bands[:, column]]
        return np.stack([np.bincount(self.degrees, each, len(DEGREES)) for each in value.T], 1)


def factors(term: EditableTerm) -> list[tuple[int, str, int]]:
    """Return (slot index, angle, bands) per factor of the quotient; a curve over θi and θo appears twice."""
    found = []
    for number, slot in enumerate(term.slots):
        found.append((number, slot.angle, slot.bands))
        if slot.also_outgoing:
            found.append((number, "theta_o", slot.bands))
    return found


def furnace_table(term: EditableTerm) -> FurnaceTable:
    """Return the table of a term."""
    rows, weights = [], []
    for number, degrees in enumerate(DEGREES):
        combined, values = [], []
        for wi, wo, share in furnace_nodes(degrees):
            columns = [band_of(angle(name, wi, wo), count, name in PEAKED).numpy() for _, name, count in factors(term)]
            combined.append(np.stack(columns, 1))
            values.append((term.quotient(wi, wo) * share[:, None]).numpy())
        bands, value = np.concatenate(combined), np.concatenate(values)
        kept, place = np.unique(bands, axis=0, return_inverse=True)
        total = np.stack([np.bincount(place.reshape(-1), each, len(kept)) for each in value.T], 1)
        rows.append(np.column_stack((np.full(len(kept), number), kept)))
        weights.append(total)
    whole = np.concatenate(rows).astype(np.uint8)
    slots = tuple(number for number, _, _ in factors(term))
    bands = np.ascontiguousarray(whole[:, 1:])
    return FurnaceTable(whole[:, 0], bands, np.concatenate(weights).astype(np.float32), slots)
