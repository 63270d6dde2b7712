"""Measured BSDFs of NVIDIA's Material Definition Language (.mbsdf), layout by the SDK's interface description.

    NVIDIA ARC MBSDF V1\\n
    key="value"\\n …                                              metadata, any number of lines
    MBSDF_DATA=\\n or MBSDF_DATA_REFLECTION=\\n                    or …_TRANSMISSION=\\n, which is not read
    uint32 type (0 scalar, 1 RGB), uint32 nθ, uint32 nφ, then float32: Δφ fastest, then θ out, θ in slowest

Values are f in sr⁻¹ without the cosine; the reciprocity of a measured file confirms this. Entries are values at the
centres of equal bins of θ in [0, π/2] and of |Δφ| in [0, π]. Δφ = 0 is the side of the light.

Files have two faults. First, the values of the last measured angle are repeated beyond it; the reader leaves these
copies out. Second, noise makes some entries negative. The reader sets them to 0 instead of dropping them, since
dropping would keep only the upward noise and brighten dark colours. Both are counted.
"""

import math
import os
import struct

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.samples import Samples
from homofact.brdf.table import AngleTable, TableAxis, ring_weights
from homofact.errors import BadInput
from homofact.files.reading import read_bytes
from homofact.geometry.directions import from_spherical

NAME = "mdl"
DESCRIPTION = "MDL measured BSDF (NVIDIA ARC MBSDF V1)"
_MAGIC = b"NVIDIA ARC MBSDF V1\n"
_MARKS = (b"MBSDF_DATA_REFLECTION=\n", b"MBSDF_DATA=\n")
_CHANNELS = {0: ("Y",), 1: ("R", "G", "B")}


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format."""
    return head.startswith(_MAGIC)


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the bins up to the last measured angles as isotropic samples, and the table itself.

    Samples are weighted by solid angle, with mean 1. `drawing` is ignored. Raises BadInput for a file without
    reflection, an unknown type, sizes in the header that disagree with the file's length, and entries that are not
    finite.
    """
    check_channels(channels)
    entries, names, comments = read_entries(path, read_bytes(path, DESCRIPTION))
    theta, phi = _centres(entries.shape[0], math.pi / 2), _centres(entries.shape[2], math.pi)
    rows, columns = (entries.shape[k] - _repeated(entries, k) for k in (0, 1))
    kept = entries[:rows, :columns]
    negative = kept < 0
    values = torch.from_numpy(kept).clamp_min(0)
    zero = (values == 0) & torch.from_numpy(~negative)
    grid = torch.meshgrid(theta[:rows], theta[:columns], phi, indexing="ij")
    theta_i, theta_o, delta = (x.reshape(-1) for x in grid)
    weights = (ring_weights(theta)[:rows, None, None] * ring_weights(theta)[:columns, None]).expand(
        rows, columns, len(phi)
    )
    samples = Samples(
        from_spherical(theta_i, torch.zeros_like(theta_i)),
        from_spherical(theta_o, delta),
        values.reshape(-1, len(names)),
        channels=names,
        isotropic=True,
        weights=weights.reshape(-1) / weights.mean(),
        provenance={
            "format": NAME,
            "comments": comments,
            "bins": list(entries.shape[:3]),
            "units": "1/sr, no cosine",
            "weights": "solid angle of the bins, mean 1",
            "faults": {
                "extrapolated": entries[..., 0].size - kept[..., 0].size,
                "measured_to_degrees": [round(math.degrees(float(theta[n - 1])), 3) for n in (rows, columns)],
                "negative": int(negative.sum()),
                "samples_with_negative": int(negative.any(-1).sum()),
                "most_negative": float(min(kept.min(), 0.0)),
                "exact_zeros": int(zero.sum()),
            },
        },
    )
    table = AngleTable((TableAxis(theta[:rows]), TableAxis(theta[:columns]), TableAxis(phi)), values, names)
    return Reading.of(path, samples, table, channels)


def read_entries(path: object, raw: bytes) -> tuple[np.ndarray, tuple[str, ...], list[str]]:
    """Return the file's entries (θ in, θ out, Δφ, C) unchanged, float64; the channel names; the metadata lines.

    Error messages name the file as `path`. Raises BadInput as `open_file` does.
    """
    if not sniff(raw):
        raise BadInput(f"begins with {raw[:20]!r}", where=path, expected=repr(_MAGIC))
    start, comments = len(_MAGIC), []
    while not raw.startswith(_MARKS, start):
        end = raw.find(b"\n", start)
        if end < 0 or raw.startswith(b"MBSDF_DATA", start):
            raise BadInput(
                f"no reflection found after {len(comments)} lines", where=path, expected="MBSDF_DATA_REFLECTION="
            )
        line = raw[start:end].decode("latin-1").strip()
        if line and len(comments) < 64:
            comments.append(line[:200])
        start = end + 1
    start = raw.index(b"\n", start) + 1
    if len(raw) < start + 12:
        raise BadInput("the file ends in the header", where=path, expected="type, nθ and nφ")
    kind, n_theta, n_phi = struct.unpack_from("<3I", raw, start)
    if kind not in _CHANNELS or not n_theta or not n_phi:
        raise BadInput(
            where=path,
            found=f"type {kind}, nθ {n_theta}, nφ {n_phi}",
            expected="type 0 (scalar) or 1 (RGB) and sizes above 0",
        )
    names = _CHANNELS[kind]
    size = 4 * n_theta * n_theta * n_phi * len(names)
    rest = len(raw) - start - 12
    follows = raw[start + 12 + size : start + 12 + size + 11] if rest > size else b""
    if rest < size or (rest > size and not follows.startswith(b"MBSDF_DATA_")):
        raise BadInput(f"{rest} bytes of data", where=path, expected=f"{size} for {n_theta} × {n_theta} × {n_phi} bins")
    numbers = np.frombuffer(raw, "<f4", size // 4, start + 12)
    if not np.isfinite(numbers).all():
        where = int(np.flatnonzero(~np.isfinite(numbers))[0])
        raise BadInput(f"number {where} of the data is {numbers[where]}", where=path, expected="finite numbers")
    return numbers.astype(np.float64).reshape(n_theta, n_theta, n_phi, len(names)), names, comments


def _centres(count: int, span: float) -> Tensor:
    return (torch.arange(count, dtype=torch.float64) + 0.5) * (span / count)


def _repeated(entries: np.ndarray, axis: int) -> int:
    """How many of the last slices along `axis` are copies of the one before them; none where all are alike."""
    slices = np.moveaxis(entries, axis, 0)
    count = 0
    while count < len(slices) - 1 and np.array_equal(slices[-1 - count], slices[-2 - count]):
        count += 1
    return 0 if count == len(slices) - 1 else count
