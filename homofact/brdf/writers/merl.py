"""Any reflectance, or the samples of a MERL file, as a MERL .binary, which nearly every viewer opens.

Layout and units are those of `homofact.brdf.readers.merl` and `homofact.brdf.merl`. A table is written as it
is. A reflectance is evaluated at the bins' centres with h in the xz-plane: of an anisotropic one the file
holds that cut alone. Bins with a direction under the horizon, and bins without a sample, are −1.
"""

import os
import struct

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import wavelengths_of
from homofact.brdf.merl import SCALES, STANDARD, UNMEASURED, MerlGrid, MerlTable
from homofact.brdf.readers.files import write_bytes
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import to_rgb
from homofact.errors import BadInput


def write(
    path: str | os.PathLike[str], source: Reflectance | Samples, shape: tuple[int, int, int] = STANDARD
) -> dict[str, int]:
    """Write a reflectance, a `MerlTable` (its own bins, every byte as it was) or samples (binned, means).

    Returns counts: bins written, bins left empty, negative values cut to 0. Raises BadInput for channels
    that are no colour, values not finite, bins below 2 or above 4096, a place that cannot be written.
    """
    if isinstance(source, MerlTable):
        raw, clipped = source.raw, 0
    else:
        if len(shape) != 3 or not all(2 <= n <= 4096 for n in shape):
            raise BadInput(f"MERL bins: found {tuple(shape)}, expected three numbers of 2 to 4096")
        grid = MerlGrid(shape)
        raw, clipped = _binned(source, grid) if isinstance(source, Samples) else _evaluated(source, grid)
        raw = raw.T.reshape(3, *shape)
    header = struct.pack("<3i", *raw.shape[1:])
    write_bytes(path, header + raw.contiguous().cpu().numpy().astype("<f8").tobytes())
    empty = int((raw < 0).any(0).sum())
    return {"written": raw[0].numel() - empty, "empty": empty, "clipped": clipped}


def _evaluated(reflectance: Reflectance, grid: MerlGrid) -> tuple[Tensor, int]:
    raw = torch.full((grid.count, 3), UNMEASURED, dtype=torch.float64)
    clipped = 0
    for bins, wi, wo in grid.slabs(4):
        above = ((wi[:, 2] >= 0) & (wo[:, 2] >= 0)).nonzero().reshape(-1)
        values = _rgb(reflectance.evaluate(wi[above], wo[above]).double(), reflectance.channels)
        clipped += int((values < 0).sum())
        raw[above + bins.start] = _entries(values.clamp_min(0))
    return raw, clipped


def _binned(samples: Samples, grid: MerlGrid) -> tuple[Tensor, int]:
    values = _rgb(samples.values, samples.channels)
    if not samples.isotropic:
        raise BadInput("MERL file: the samples are anisotropic, expected an isotropic material")
    bins = grid.bins(samples.wi, samples.wo)
    counts = torch.bincount(bins, minlength=grid.count)
    sums = torch.zeros(grid.count, 3, dtype=torch.float64).index_add_(0, bins, values)
    raw = torch.full((grid.count, 3), UNMEASURED, dtype=torch.float64)
    filled = counts > 0
    # Of a single sample the mean is the value itself, bit for bit.
    raw[filled] = _entries((sums[filled] / counts[filled][:, None]).clamp_min(0))
    return raw, 0


def _rgb(values: Tensor, channels: tuple[str, ...]) -> Tensor:
    if not bool(torch.isfinite(values).all()):
        raise BadInput("MERL file: a value is not finite, expected finite numbers")
    wavelengths = wavelengths_of(channels)
    if wavelengths is not None and len(wavelengths) > 1:
        return to_rgb(values, wavelengths)[0]
    if len(channels) not in (1, 3):
        raise BadInput(f"MERL file: channels {', '.join(channels)}, expected R, G, B, a spectrum, or one channel")
    return values.expand(-1, 3)


def _entries(values: Tensor) -> Tensor:
    """Raw entries (N, 3) that times the scales give back `values`, bit for bit where they came from a file.

    Two neighbouring entries can share a product; the one with few digits is preferred where it fits (a
    float32, as measurements are), then the quotient.
    """
    target = values.numpy()
    scales = np.array(SCALES)
    quotient = target / scales
    with np.errstate(over="ignore"):
        short = quotient.astype(np.float32).astype(np.float64)
    return torch.from_numpy(np.where(short * scales == target, short, quotient))
