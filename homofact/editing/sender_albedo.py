"""The albedo of senders of light: the share of uniform light that their terms reflect under current curves.

It is the white furnace's albedo a(θi) (`furnace`), linear between its angles, in the mean ∫ a(θ) sin2θ dθ.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from homofact.editing.curves import Bands
from homofact.editing.furnace import DEGREES
from homofact.editing.furnace_table import FurnaceTable, furnace_table
from homofact.editing.material import Editable

_STEPS = 9000


def mean_weights() -> np.ndarray:
    """Return the weights of albedos at `furnace.DEGREES` in their mean under uniform light; their sum is 1.

    Examples
    --------
    >>> mean_weights().round(3).tolist()
    [0.023, 0.133, 0.227, 0.258, 0.212, 0.114, 0.034]
    """
    theta = (np.arange(_STEPS) + 0.5) * (np.pi / 2 / _STEPS)
    hats = [np.interp(theta, np.radians(DEGREES), row) for row in np.eye(len(DEGREES))]
    found = np.array([(hat * np.sin(2 * theta)).sum() for hat in hats])
    return found / found.sum()


class SenderAlbedo:
    """The mean albedo of some terms of a material; the last two results are cached for dragging."""

    def __init__(self, material: Editable, terms: Sequence[str]) -> None:
        self._name = material.name
        self._tables: dict[str, tuple[FurnaceTable, tuple[str, ...]]] = {
            name: (furnace_table(material.term(name)), tuple(slot.name for slot in material.term(name).slots))
            for name in terms
        }
        self._kept: list[tuple[tuple[Bands, ...], Tensor]] = []

    def at(self, curves: Mapping[tuple[str, str, str], Bands]) -> Tensor:
        """Return ρ (C,) float64 with these curves by (material, term, curve)."""
        own = [(self._name, term, slot) for term, (_, slots) in self._tables.items() for slot in slots]
        now = tuple(curves[address] for address in own)
        for before, albedo in self._kept:
            if all(a is b for a, b in zip(before, now, strict=True)):
                return albedo
        rows = [
            table.albedo([curves[self._name, term, slot].values.numpy() for slot in slots])
            for term, (table, slots) in self._tables.items()
        ]
        found = torch.from_numpy(mean_weights() @ np.sum(rows, 0))
        self._kept = [(now, found), *self._kept[:1]]
        return found
