"""Samples as comma-separated text: the mirror of `homofact.brdf.readers.csv`, every number with all its digits.

Directions go as vectors, so that they come back bit for bit; a column `weight` is written where weights differ
from 1.
"""

import os

import torch

from homofact.brdf.readers.csv import ANGLES, VECTORS
from homofact.brdf.readers.files import write_bytes
from homofact.brdf.samples import Samples
from homofact.errors import BadInput


def write(path: str | os.PathLike[str], samples: Samples, comments: tuple[str, ...] = ()) -> None:
    """Write samples. Raises BadInput for channel names that the format cannot hold, and an unwritable place."""
    reserved = {*ANGLES, *VECTORS, *(f"{name}_deg" for name in ANGLES), "weight"}
    for name in samples.channels:
        if name in reserved or name != name.strip() or not name or set(name) & set(",\n\r#"):
            raise BadInput(
                f"CSV file: channel {name!r}, expected a name without commas that is no column of directions"
            )
    columns = [samples.wi, samples.wo, samples.values]
    header = [*VECTORS, *samples.channels]
    if bool((samples.weights != 1).any()):
        columns.append(samples.weights[:, None])
        header.append("weight")
    lines = [f"# isotropic: {str(samples.isotropic).lower()}"]
    if samples.provenance.get("noise_free") is True:
        lines.append("# noise_free: true")
    lines += [f"# {' '.join(line.split())}" for line in comments]
    rows = [",".join(map(repr, row)) for row in torch.cat(columns, 1).tolist()]
    write_bytes(path, ("\n".join([*lines, ",".join(header), *rows]) + "\n").encode())
