"""Samples as a numpy archive, in homofact's own layout.

An uncompressed .npz of plain arrays, read without pickle:

    wi, wo      (N, 3) floats, unit vectors in the surface frame
    values      (N, C) floats in sr⁻¹, without the cosine
    channels    (C,) strings
    isotropic   one boolean
    header      JSON text: an object with whatever is to be said of the data; "noise_free": true says that
                the values are a model's

float32 directions are normalised again in float64. `write` is deterministic: the same samples give the same bytes.
"""

import json
import os
from typing import Any

import numpy as np
import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import in_channels, zeros_of
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.files.archive import member_names, read_arrays, read_header, write_arrays
from homofact.files.reading import read_bytes

NAME = "npz"
DESCRIPTION = "numpy archive of samples (wi, wo, values, channels, isotropic, header)"
_KEYS = ("wi", "wo", "values", "channels", "isotropic", "header")
_WHOLE = "a whole .npz of samples"
_LENGTH_TOLERANCE = 1e-3


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is a zip whose first member is a numpy array."""
    return head.startswith(b"PK\x03\x04") and b".npy" in head[30:300]


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file in `channels`, if they can be converted (spectra become RGB or luminance).

    Raises BadInput for a damaged archive, and BadInput that names the array if it is missing, has a wrong shape or
    type, or has values that are not finite, negative, below the horizon or not of unit length.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    members = member_names(path, raw, _WHOLE)
    data = read_arrays(path, raw, _KEYS, _WHOLE)
    missing = [name for name in _KEYS if name not in data]
    if missing:
        raise BadInput(
            f"holds {', '.join(sorted(members)[:8]) or 'nothing'}",
            where=path,
            expected=f"arrays {', '.join(_KEYS)}, of which {', '.join(missing)} missing",
        )
    header = read_header(path, data, _WHOLE)
    if data["isotropic"].shape != () or data["isotropic"].dtype != np.bool_:
        raise BadInput(f"isotropic is {data['isotropic'].dtype}", where=path, expected="one boolean")
    if data["channels"].ndim != 1 or data["channels"].dtype.kind != "U":
        raise BadInput(f"channels is {data['channels'].dtype}", where=path, expected="a list of strings")
    for name in ("wi", "wo", "values"):
        if data[name].ndim != 2 or data[name].dtype.kind != "f":
            raise BadInput(
                f"{name} has shape {data[name].shape} of {data[name].dtype}",
                where=path,
                expected="two dimensions of floats",
            )
    wi, wo = (_directions(path, name, data[name]) for name in ("wi", "wo"))
    values = torch.from_numpy(_doubles(data["values"]))
    try:
        samples = Samples(
            wi,
            wo,
            values,
            channels=tuple(str(name) for name in data["channels"]),
            isotropic=bool(data["isotropic"]),
            provenance=header | {"format": NAME, "faults": zeros_of(values)},
        )
    except BadInput as error:
        raise error.at(path) from error
    return in_channels(path, samples, channels)


def write(path: str | os.PathLike[str], samples: Samples, header: dict[str, Any], dtype: str = "float64") -> None:
    """Write samples (weights are not kept) with a JSON-able header; `dtype` is that of wi, wo and values.

    Raises BadInput where the place cannot be written.
    """
    arrays = {
        "wi": samples.wi.cpu().numpy().astype(dtype),
        "wo": samples.wo.cpu().numpy().astype(dtype),
        "values": samples.values.cpu().numpy().astype(dtype),
        "channels": np.array(samples.channels),
        "isotropic": np.array(samples.isotropic),
        "header": np.array(json.dumps(header, ensure_ascii=False, sort_keys=True)),
    }
    write_arrays(path, arrays)


def _doubles(array: np.ndarray) -> np.ndarray:
    """In float64; a signalling NaN among them is no cause for a warning."""
    with np.errstate(invalid="ignore"):
        return array.astype(np.float64)


def _directions(path: object, name: str, array: np.ndarray) -> torch.Tensor:
    directions = torch.from_numpy(_doubles(array))
    if directions.shape[1] != 3:
        raise BadInput(f"{name} has shape {tuple(array.shape)}", where=path, expected="(N, 3)")
    length = directions.norm(dim=1, keepdim=True)
    off = ~((length - 1).abs() <= _LENGTH_TOLERANCE).reshape(-1)
    if bool(off.any()):
        row = int(off.nonzero()[0])
        raise BadInput(f"{name} at row {row} has length {float(length[row]):.6g}", where=path, expected="a unit vector")
    return directions / length
