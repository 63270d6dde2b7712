"""Samples as CUReT text: the mirror of `homofact.brdf.readers.curet`, all digits of values and angles.

One material a call: abrdf.dat with the mean of the channels, rbrdf.dat, gbrdf.dat and bbrdf.dat of three, and
table.txt. Weights are not kept.
"""

import os
from pathlib import Path

import torch

from homofact.brdf.readers.curet import COLOURS, MEAN, MEASUREMENTS, SAMPLES, TABLE
from homofact.brdf.readers.files import write_bytes
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.geometry.directions import to_spherical


def write(folder: str | os.PathLike[str], samples: Samples, number: int = 1) -> None:
    """Write the files of one material, of that number, into an existing `folder`.

    Raises BadInput for another number of samples than 205, of channels than one or three, and a number out of 1 to 61.
    """
    if len(samples) != MEASUREMENTS or len(samples.channels) not in (1, 3) or not 1 <= number <= SAMPLES:
        raise BadInput(
            f"CUReT files: {len(samples)} samples of {len(samples.channels)} channels as number {number},"
            f" expected {MEASUREMENTS} samples of 1 or 3 channels and a number from 1 to {SAMPLES}"
        )
    columns = {MEAN: samples.values.mean(1)}
    if len(samples.channels) == 3:
        columns |= {name: samples.values[:, c] for c, name in enumerate(COLOURS)}
    for name, values in columns.items():
        write_bytes(Path(folder) / name, f"{number} {' '.join(map(repr, values.tolist()))}\n".encode())
    table = torch.stack((*to_spherical(samples.wo), *to_spherical(samples.wi)), 1)
    write_bytes(Path(folder) / TABLE, "".join(f"{' '.join(map(repr, row))}\n" for row in table.tolist()).encode())
