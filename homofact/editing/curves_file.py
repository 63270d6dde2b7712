"""Edited curves as JSON, which an editor writes and `homofact` applies to the textures of a fit.

    {"format": "homofact curves", "format_version": 2, "channels": ["R", "G", "B"], "curves": [
      {"material": "paint", "term": "whole", "curve": "theta_h", "angle": "theta_h", "bands": "finer near 0",
       "values": [[1, 1, 1], …]}]}

`values` are the J means over bands of the angle from 0 to π/2, each with one number per channel. `bands` names their
division: "equal", or "finer near 0", whose edges are at π/2 (k/J)². Files of version 1 have equal bands, which are
resampled if the curve has finer ones.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from homofact.editing.curves import Bands
from homofact.editing.material import Editable
from homofact.editing.picture import Address
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.fields import Fields

FORMAT, FORMAT_VERSION = "homofact curves", 2
EQUAL, FINER = "equal", "finer near 0"
MOST_CURVES = 10_000


def write_curves(path: str | os.PathLike[str], materials: Sequence[Editable], curves: Mapping[Address, Bands]) -> None:
    """Write the curves whole or not at all. Raises BadInput for an unwritable place."""
    by_name = {material.name: material for material in materials}
    entries = [
        {
            "material": address[0],
            "term": address[1],
            "curve": address[2],
            "angle": by_name[address[0]].slot(address[1:]).angle,
            "bands": FINER if bands.finer else EQUAL,
            "values": bands.values.tolist(),
        }
        for address, bands in curves.items()
    ]
    channels = list(materials[0].channels)
    answer = {"format": FORMAT, "format_version": FORMAT_VERSION, "channels": channels, "curves": entries}
    write_text(path, json.dumps(answer, allow_nan=False) + "\n")


def read_curves(path: str | os.PathLike[str], materials: Sequence[Editable]) -> dict[Address, Bands]:
    """Return the curves of these materials in a file.

    Raises BadInput with a one-line message if the file is not a curves file or has other channels, if a material, term
    or curve is unknown or listed twice, if an angle is not that of its curve, and if values are empty, of the wrong
    number, negative or not finite.
    """
    target = Path(path)
    fields = Fields.read(target, "edited curves in JSON")
    fields.text("format", (FORMAT,))
    fields.version("format_version", FORMAT_VERSION)
    version = fields.found["format_version"]
    channels = list(materials[0].channels)
    if fields.found.get("channels") != channels:
        fields.refuse("channels", f"{json.dumps(channels)}, as the materials have")
    by_name = {material.name: material for material in materials}
    found: dict[Address, Bands] = {}
    for entry in fields.inners("curves", MOST_CURVES):
        address = (entry.text("material", tuple(by_name)), entry.text("term"), entry.text("curve"))
        material = by_name[address[0]]
        try:
            slot = material.slot(address[1:])
            entry.text("angle", (slot.angle,))
            values = _values(entry, len(channels))
            kind = EQUAL if version == 1 else entry.text("bands", (EQUAL, FINER))
            curve = material.checked(address[1:], Bands(values, kind == FINER))
        except BadInput as error:
            where = entry.place.rstrip(".")
            raise (error if error.where.startswith(where) else error.at(where)) from error
        if address in found:
            entry.refuse("curve", "each curve once")
        found[address] = curve
    return found


def _values(entry: Fields, channels: int) -> torch.Tensor:
    """Return the table (J, C) under the key "values"."""
    rows: Any = entry.found.get("values")
    if not isinstance(rows, list) or not rows:
        entry.refuse("values", f"rows of {channels} numbers")
    for number, row in enumerate(rows):
        numbers = isinstance(row, list) and all(type(value) in (int, float) for value in row)
        if not numbers or len(row) != channels:
            wanted = f"{channels} numbers"
            raise BadInput(where=f"{entry.place}values[{number}]", found=json.dumps(row)[:60], expected=wanted)
    return torch.tensor([[float(value) for value in row] for row in rows], dtype=torch.float64)
