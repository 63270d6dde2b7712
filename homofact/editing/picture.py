"""Pictures from what was precomputed: parts times their curves, summed into the pixels of a view."""

from collections.abc import Mapping

import torch
from torch import Tensor

from homofact.editing.curves import Bands
from homofact.editing.material import Editable
from homofact.editing.scene import PreparedScene, PreparedTerm

# By the name of the material, its term and its curve.
Address = tuple[str, str, str]
Curves = Mapping[Address, Bands]


def starting_curves(prepared: PreparedScene) -> dict[Address, Bands]:
    """Return every curve of every material as it starts."""
    found = {}
    for material in prepared.scene.materials:
        for place, bands in material.banded_start().items():
            found[(material.name, *place)] = bands
    return found


def summed_curves(part: PreparedTerm, material: Editable, curves: Curves) -> list[Tensor]:
    """Return the curves (J, C) that are in a part's sum over the light, in order, each in its own bands."""
    summed = material.term(part.term).summed
    return [slot.banded(curves[material.name, part.term, slot.name]).values for slot in summed]


def factor_of(part: PreparedTerm, material: Editable, curves: Curves) -> Tensor:
    """Return the factor (P, C) or (1, C) of a part's sum: its curves over θo and its pattern."""
    factor = torch.ones(1, len(material.channels), dtype=torch.float64)
    for slot in material.term(part.term).slots:
        if slot.also_outgoing or not slot.in_sum:
            factor = factor * curves[material.name, part.term, slot.name].at(part.theta_o)
    return factor if part.factor is None else factor * part.factor


def part_picture(prepared: PreparedScene, part: PreparedTerm, curves: Curves) -> Tensor:
    """Return R (P, C) of one part, in its rows of the view's pixels."""
    material = prepared.scene.objects[part.object].material
    return part.transport.picture(summed_curves(part, material, curves)) * factor_of(part, material, curves)


def add_part(total: Tensor, prepared: PreparedScene, part: PreparedTerm, values: Tensor, curves: Curves) -> None:
    """Add a part's `values` (P, C) to its view's `total`; light from senders is multiplied by their albedos."""
    if part.senders is not None:
        albedos = torch.stack([each.at(curves) for each in prepared.albedos])
        values = values * albedos[torch.from_numpy(part.senders)]
    total.index_add_(0, torch.from_numpy(part.rows), values)


def radiance(prepared: PreparedScene, view: int, curves: Curves) -> Tensor:
    """Return R (P, C), float64, of the covered pixels of a view."""
    total = torch.zeros(len(prepared.pixels[view]), len(prepared.scene.channels), dtype=torch.float64)
    for part in prepared.parts:
        if part.view == view:
            add_part(total, prepared, part, part_picture(prepared, part, curves), curves)
    return total


def image(prepared: PreparedScene, view: int, values: Tensor) -> tuple[Tensor, Tensor]:
    """Return (radiance (H, W, C), coverage (H, W)) of values (P, C) of a view's covered pixels."""
    width, height = prepared.scene.cameras[view].pixels
    picture = torch.zeros(height * width, values.shape[1], dtype=torch.float64)
    coverage = torch.zeros(height * width, dtype=torch.float64)
    numbers = torch.from_numpy(prepared.pixels[view].numbers)
    picture[numbers], coverage[numbers] = values, 1.0
    return picture.reshape(height, width, -1), coverage.reshape(height, width)
