"""The binary files of the UTIA BRDF database (Filip and Vávra 2014), layout as its authors' program reads it.

    float64, 3 × 6 × 48 × 6 × 48: colour, θi, φi, θv, φv, the last fastest; no header; little endian

θ at 0, 15 … 75°, φ at 0, 7.5 … 352.5°, anisotropic. The same in float32 is read as well. The format has no header. A
file is read as UTIA if its size matches and no other reader recognises it.

The entries are read as f in sr⁻¹ in linear RGB, as in the authors' own look-up program. Their scale is uncertain:
another published reader decodes sRGB from entries/140 and multiplies by 100. So compare such files only with metrics
that do not depend on the scale. Negative entries are set to 0 and counted.

`write` evaluates any reflectance at these nodes. A table that was read from a file is written unchanged.
"""

import math
import os

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.reflectance import Reflectance
from homofact.brdf.samples import Samples
from homofact.brdf.table import AngleTable, TableAxis, ring_weights
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes
from homofact.files.reading import read_bytes
from homofact.geometry.directions import from_spherical

NAME = "utia"
DESCRIPTION = "UTIA .bin (3 × 6 × 48 × 6 × 48 numbers, known by its size)"
SHAPE = (3, 6, 48, 6, 48)
SIZES = {math.prod(SHAPE) * 8: "<f8", math.prod(SHAPE) * 4: "<f4"}
_MOST = 1e6


def sniff(head: bytes) -> bool:
    """Return False, since the format has no header. `SIZES` lists the file sizes that this reader accepts."""
    return False


def axes() -> tuple[TableAxis, TableAxis, TableAxis, TableAxis]:
    """Return θi, φi, θv and φv of the nodes, in radians."""
    theta = TableAxis(torch.arange(SHAPE[1], dtype=torch.float64) * math.radians(15))
    phi = TableAxis(torch.arange(SHAPE[2], dtype=torch.float64) * math.radians(7.5), periodic=True)
    return theta, phi, theta, phi


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return all nodes as anisotropic samples weighted by solid angle, mean 1, and the table itself.

    `drawing` is ignored. Raises BadInput for another file size, and for entries that are not finite or exceed a
    million.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    if len(raw) not in SIZES:
        raise BadInput(
            f"{len(raw)} bytes", where=path, expected=f"{' or '.join(map(str, SIZES))}: 3 × 6 × 48 × 6 × 48 numbers"
        )
    entries = np.frombuffer(raw, SIZES[len(raw)])
    plausible = np.abs(entries) <= _MOST
    if not plausible.all():
        where = int(np.flatnonzero(~plausible)[0])
        raise BadInput(
            f"number {where} is {entries[where]:g}", where=path, expected="values of a BRDF (a UTIA .bin by its size)"
        )
    values = torch.from_numpy(np.moveaxis(entries.astype(np.float64).reshape(SHAPE), 0, -1).copy())
    negative, zeros = values < 0, values == 0
    values = values.clamp_min(0)
    nodes = axes()
    grid = torch.meshgrid(*(axis.nodes for axis in nodes), indexing="ij")
    theta_i, phi_i, theta_o, phi_o = (x.reshape(-1) for x in grid)
    rings = ring_weights(nodes[0].nodes)
    weights = (rings[:, None, None, None] * rings[:, None]).expand(SHAPE[1:]).reshape(-1)
    samples = Samples(
        from_spherical(theta_i, phi_i),
        from_spherical(theta_o, phi_o),
        values.reshape(-1, 3),
        channels=("R", "G", "B"),
        isotropic=False,
        weights=weights / weights.mean(),
        provenance={
            "format": NAME,
            "units": "taken as 1/sr, no cosine; the scale of this database is not established",
            "weights": "solid angle of the nodes, mean 1",
            "faults": {
                "negative": int(negative.sum()),
                "samples_with_negative": int(negative.any(-1).sum()),
                "exact_zeros": int(zeros.sum()),
            },
        },
    )
    table = AngleTable(nodes, values, ("R", "G", "B"))
    return Reading.of(path, samples, table, channels)


def write(path: str | os.PathLike[str], reflectance: Reflectance) -> None:
    """Write an RGB reflectance in float64. Raises BadInput for other channels and values not finite."""
    if len(reflectance.channels) != 3:
        raise BadInput(f"channels {', '.join(reflectance.channels)}", where="UTIA file", expected="R, G and B")
    grid = torch.meshgrid(*(axis.nodes for axis in axes()), indexing="ij")
    theta_i, phi_i, theta_o, phi_o = (x.reshape(-1) for x in grid)
    values = reflectance.evaluate(from_spherical(theta_i, phi_i), from_spherical(theta_o, phi_o)).double()
    if not bool(torch.isfinite(values).all()):
        raise BadInput("a value is not finite", where="UTIA file", expected="finite numbers")
    write_bytes(path, values.T.reshape(SHAPE).contiguous().cpu().numpy().astype("<f8").tobytes())
