"""The binary files of the MERL BRDF database (Matusik et al. 2003), with the layout of its own reading program.

    int32 × 3        numbers of bins in θh, θd, φd: 90, 90, 180 (or 360, without the fold by reciprocity)
    float64 × 3 · n  all red entries, then green, then blue; φd fastest, θh slowest; little endian

`homofact.brdf.merl` defines the entries. The samples are the centres of the measured bins with both directions above
the horizon, each weighted by the measure of the direction pairs in its bin (mean weight 1). The many small bins round
the highlight therefore count by their small solid angle.

You can write a table as it is, samples that were read from such a file, or any reflectance. A reflectance is evaluated
at the bins' centres with h in the xz-plane, so the file contains only this slice of an anisotropic material. Bins with
a direction below the horizon and bins without a sample are −1. Nearly every viewer opens these files.
"""

import os
import struct

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading, zeros_of
from homofact.brdf.merl import SCALES, STANDARD, UNMEASURED, MerlGrid, MerlTable
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import to_rgb
from homofact.brdf.wavelengths import wavelengths_of
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.files.reading import read_bytes

NAME = "merl"
DESCRIPTION = "MERL .binary (three int32: bins in θh, θd, φd; then red, green, blue as float64)"
_MOST_BINS = 4096
_HEADER = 12


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is of this format: three plausible numbers of bins, then numbers."""
    return len(head) >= _HEADER and all(2 <= n <= _MOST_BINS for n in struct.unpack("<3i", head[:_HEADER]))


def load(path: str | os.PathLike[str]) -> MerlTable:
    """Return the table of a file. Raises BadInput for sizes that disagree with the file's, and entries not finite."""
    raw = read_bytes(path, DESCRIPTION)
    if not sniff(raw[:_HEADER]):
        raise BadInput(
            f"begins with {raw[:_HEADER]!r}", where=path, expected="three int32 numbers of bins (90, 90, 180)"
        )
    shape = struct.unpack("<3i", raw[:_HEADER])
    expected = _HEADER + 24 * shape[0] * shape[1] * shape[2]
    if len(raw) != expected:
        bins = " × ".join(str(n) for n in shape)
        raise BadInput(f"{len(raw)} bytes", where=path, expected=f"{expected} for {bins} bins of three float64")
    planes = np.frombuffer(raw, "<f8", offset=_HEADER).astype(np.float64).reshape(3, *shape)
    finite = np.isfinite(planes)
    if not finite.all():
        channel, h, d, p = (int(x[0]) for x in np.nonzero(~finite))
        raise BadInput(
            f"{'RGB'[channel]} at bin θh {h}, θd {d}, φd {p} is {planes[channel, h, d, p]}",
            where=path,
            expected="finite numbers (negative where not measured)",
        )
    return MerlTable(torch.from_numpy(planes))


def samples_of(table: MerlTable) -> Samples:
    """Return the measured bins of a table as samples, isotropic, R, G and B; weights as in the module's head.

    Raises BadInput where no bin was measured.
    """
    grid = table.grid
    directions: list[tuple[torch.Tensor, torch.Tensor]] = []
    kept: list[torch.Tensor] = []
    for bins, wi, wo in grid.slabs():
        use = (table.measured[bins] & (wi[:, 2] >= 0) & (wo[:, 2] >= 0)).nonzero().reshape(-1)
        directions.append((wi[use], wo[use]))
        kept.append(use + bins.start)
    index = torch.cat(kept)
    values = table.raw.reshape(3, -1)[:, index].T * torch.tensor(SCALES, dtype=torch.float64)
    if not len(index):
        raise BadInput("no bin was measured", where="MERL table", expected="at least one entry that is not negative")
    weights = grid.measure().reshape(-1)[index]
    return Samples(
        torch.cat([wi for wi, _ in directions]),
        torch.cat([wo for _, wo in directions]),
        values,
        channels=table.channels,
        isotropic=True,
        weights=weights / weights.mean(),
        provenance={
            "format": NAME,
            "bins": list(grid.shape),
            "units": "1/sr, no cosine; factors 1/1500, 1.15/1500 and 1.66/1500 undone",
            "weights": "solid angle of the bins, mean 1",
            "faults": {
                "not_measured": grid.count - int(table.measured.sum()),
                "under_horizon": int(table.measured.sum()) - len(index),
            }
            | zeros_of(values),
        },
    )


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return samples of all measured bins, and the table itself; `drawing` does not matter.

    Raises BadInput as `load` and `samples_of` do, and for channels "spectral".
    """
    check_channels(channels)
    table = load(path)
    try:
        samples = samples_of(table)
    except BadInput as error:
        raise error.at(path) from error
    return Reading.of(path, samples, table, channels)


def write(
    path: str | os.PathLike[str], source: Reflectance | Samples, shape: tuple[int, int, int] = STANDARD
) -> dict[str, int]:
    """Write a reflectance, a `MerlTable` (its bins unchanged) or samples (means per bin).

    Returns counts: bins written, bins left empty, negative values cut to 0. Raises BadInput for channels
    that are no colour, values not finite, bins below 2 or above 4096, a place that cannot be written.
    """
    if isinstance(source, MerlTable):
        raw, clipped = source.raw, 0
    else:
        if len(shape) != 3 or not all(2 <= n <= 4096 for n in shape):
            raise BadInput(where="MERL bins", found=tuple(shape), expected="three numbers of 2 to 4096")
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
        raise BadInput("the samples are anisotropic", where="MERL file", expected="an isotropic material")
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
        raise BadInput("a value is not finite", where="MERL file", expected="finite numbers")
    wavelengths = wavelengths_of(channels)
    if wavelengths is not None and len(wavelengths) > 1:
        return to_rgb(values, wavelengths)[0]
    if len(channels) not in (1, 3):
        raise BadInput(
            f"channels {', '.join(channels)}", where="MERL file", expected="R, G, B, a spectrum, or one channel"
        )
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
