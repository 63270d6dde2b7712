"""Tensor files of the RGL material database (Dupuy and Jakob 2018), `.bsdf`.

    12 bytes   "tensor_file\\0"
    2 bytes    version, 1 and 0
    uint32     number of fields
    then each  uint16 length of the name, name, uint16 rank, uint8 type, uint64 offset in the file,
               uint64 size along each axis

all little-endian; the numbers of a field are at its offset, the last axis fastest. Fields that are read here:

    theta_i (T)  phi_i (F)         angles of incidence in radians, F = 1 where the material is isotropic
    ndf (R, C)  sigma (R, C)       rows along the azimuth, columns along the angle from the normal
    vndf (F, T, R, C)              density of visible normals
    rgb (F, T, 3, R, C)            linear RGB; or spectra (F, T, W, R, C) with wavelengths (W) in nm
    jacobian (1)                   0 where D/(4σ) is in the values already; absent means it is not
    description                    text

The fields luminance (for importance sampling) and valid (of the acquisition) are not needed for a value. What
is stored contains cosθo, see `homofact.brdf.rgl`.
"""

import math
import os
import struct
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import LuminanceOf, as_channels, check_channels, spectral_names
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import to_luminance, to_rgb
from homofact.errors import BadInput
from homofact.files.reading import read_bytes

NAME = "rgl"
DESCRIPTION = "RGL tensor file (adaptive parameterization, RGB or spectral)"
_MAGIC = b"tensor_file\0"
_TYPES = dict(enumerate(["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"], 1))
_ANGLES, _PLANES = ("theta_i", "phi_i"), ("ndf", "sigma")
# More axes than any field has; a rank is believed no further than this.
_MOST_AXES = 8
_RGB = ("R", "G", "B")


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is a tensor file."""
    return head.startswith(_MAGIC)


def read_tensors(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Every field of a tensor file by name, read-only views of its bytes.

    Raises BadInput naming file and field for another version, a header that ends early, more fields than fit,
    a name twice or not in UTF-8, an unknown type, and data that do not lie within the file.
    """
    raw = read_bytes(path, DESCRIPTION)
    place = len(_MAGIC)
    if not raw.startswith(_MAGIC):
        raise BadInput(f"{path}: begins with {raw[:12]!r}, expected {_MAGIC!r}")

    def take(form: str, what: str) -> tuple[Any, ...]:
        nonlocal place
        size = struct.calcsize("<" + form)
        if place + size > len(raw):
            raise BadInput(f"{path}: the file ends at byte {len(raw)} within {what}, expected a whole header")
        place += size
        return struct.unpack_from("<" + form, raw, place - size)

    major, minor = take("2B", "the version")
    if (major, minor) != (1, 0):
        raise BadInput(f"{path}: tensor file of version {major}.{minor}, expected 1.0")
    (count,) = take("I", "the number of fields")
    layouts: dict[str, tuple[str, int, tuple[int, ...]]] = {}
    for number in range(1, count + 1):
        what = f"field {number} of {count}"
        (length,) = take("H", what)
        (word,) = take(f"{length}s", what)
        try:
            name = word.decode()
        except UnicodeDecodeError as error:
            raise BadInput(f"{path}: the name of {what} is {word[:20]!r}, expected UTF-8") from error
        if name in layouts:
            raise BadInput(f"{path}: field {_short(name)} is there twice, expected once")
        rank, code, offset = take("HBQ", f"field {_short(name)}")
        if rank > _MOST_AXES:
            raise BadInput(f"{path}: field {_short(name)} has {rank} axes, expected at most {_MOST_AXES}")
        if code not in _TYPES:
            raise BadInput(f"{path}: field {_short(name)} is of type {code}, expected 1 to {len(_TYPES)}")
        layouts[name] = (_TYPES[code], offset, take(f"{rank}Q", f"field {_short(name)}"))
    fields = {}
    for name, (kind, offset, shape) in layouts.items():
        dtype = np.dtype(kind).newbyteorder("<")
        # Python's integers: no product of sizes overflows.
        size, numbers = math.prod(shape) * dtype.itemsize, math.prod(shape)
        if offset < place or offset + size > len(raw):
            raise BadInput(
                f"{path}: field {_short(name)} {shape} takes {size} bytes from byte {offset}, expected it"
                f" between the header's end, {place}, and the file's, {len(raw)}"
            )
        if numbers == 0:
            raise BadInput(f"{path}: field {_short(name)} has shape {shape}, expected at least one number")
        fields[name] = np.frombuffer(raw, dtype, numbers, offset).reshape(shape)
    return fields


def load(path: str | os.PathLike[str], channels: str = "rgb") -> AdaptiveTable:
    """The table of a file, in "rgb" or "spectral"; "luminance" of a spectral file is CIE Y, of an RGB file RGB.

    A spectral file's table becomes linear sRGB or Y node by node, its values being linear in the table;
    facts["faults"] counts the negative entries. Raises BadInput as `read_tensors` does, for a missing field, a
    wrong shape or type, numbers that are not finite, and "spectral" of an RGB file.
    """
    check_channels(channels)
    fields = read_tensors(path)
    kind = "spectra" if "spectra" in fields else "rgb"
    needed = [*_ANGLES, *_PLANES, "vndf", kind, *(["wavelengths"] if kind == "spectra" else [])]
    missing = [name for name in needed if name not in fields]
    if missing:
        raise BadInput(
            f"{path}: holds {', '.join(map(_short, sorted(fields)[:12])) or 'no fields'}; expected"
            f" {', '.join(needed)}, of which {', '.join(missing)} missing"
        )
    if kind == "rgb" and channels == "spectral":
        raise BadInput(f"channels: found 'spectral' for {path}, which holds RGB; expected rgb or luminance")
    axes = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "rgb": 5, "spectra": 5, "wavelengths": 1}
    tensors = {name: _floats(path, name, fields[name], axes[name]) for name in needed}
    names, values = _RGB, tensors[kind]
    facts: dict[str, Any] = {"format": NAME, "comments": _description(fields)}
    facts["units"] = "1/sr, no cosine; cos(theta_o) divided out"
    facts["faults"] = {"negative_entries": int((values < 0).sum())}
    if kind == "rgb" and values.shape[-1] != 3:
        raise BadInput(f"{path}: field rgb has {values.shape[-1]} channels, expected 3")
    try:
        if kind == "spectra":
            wavelengths = tensors["wavelengths"].double().tolist()
            facts["wavelengths_nm"] = wavelengths
            values, names, colour = _in_channels(values, wavelengths, channels)
            facts |= {"colour": colour} if colour else {}
        return AdaptiveTable(
            tensors["theta_i"],
            tensors["phi_i"],
            tensors["ndf"],
            tensors["sigma"],
            tensors["vndf"],
            values,
            _flag(path, fields.get("jacobian")),
            names,
            facts,
        )
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """The table of a file as a reflectance, with samples of it drawn as `drawing` says; errors as in `load`."""
    table = load(path, channels)
    draw = drawing or Drawing()
    try:
        samples = as_channels(table.sample(draw.count, draw.scheme, draw.seed), channels)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
    wants_sum = channels == "luminance" and table.channels == _RGB
    return Reading(samples, LuminanceOf(table) if wants_sum else table)


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """45,000 samples of a file's table, uniform in the parabolic discs; errors as in `load`."""
    return open_file(path, channels).samples


def _in_channels(values: Tensor, wavelengths: list[float], channels: str) -> tuple[Tensor, tuple[str, ...], Any]:
    """(table, channel names, facts of the colour) of a spectral table (F, T, R, C, W) in `channels`."""
    if len(wavelengths) != values.shape[-1]:
        raise BadInput(
            f"field spectra has {values.shape[-1]} wavelengths, expected {len(wavelengths)}, the size of wavelengths"
        )
    if channels == "spectral":
        return values, spectral_names(wavelengths), None
    convert = to_rgb if channels == "rgb" else to_luminance
    # Slice by slice: the whole table in float64 would double the memory.
    parts = [convert(part.reshape(-1, part.shape[-1]).double(), wavelengths) for part in values.flatten(0, 1)]
    colour = parts[0][1]
    if "clipped" in colour:
        colour["clipped"] = {name: sum(facts["clipped"][name] for _, facts in parts) for name in colour["clipped"]}
    table = torch.stack([part.float() for part, _ in parts]).reshape(*values.shape[:-1], -1)
    return table, _RGB if channels == "rgb" else ("Y",), colour


def _floats(path: object, name: str, array: np.ndarray, axes: int) -> Tensor:
    """A field as finite float32 (float64 where the file has it) of `axes` axes; of five, the third comes last."""
    if array.ndim != axes or array.dtype.kind != "f":
        raise BadInput(
            f"{path}: field {name} has shape {array.shape} of {array.dtype.name}, expected {axes} axes of floats"
        )
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise BadInput(f"{path}: field {name} at {where} is {array[where]}, expected finite numbers")
    if axes == 5:
        array = np.moveaxis(array, 2, -1)
    return torch.from_numpy(array.astype(np.float64 if array.dtype.itemsize == 8 else np.float32, order="C"))


def _flag(path: object, array: np.ndarray | None) -> bool:
    if array is None:
        return True
    if array.shape != (1,) or array.dtype.kind not in "iu" or array[0] not in (0, 1):
        raise BadInput(f"{path}: field jacobian has shape {array.shape} of {array.dtype.name}, expected one 0 or 1")
    return bool(array[0])


def _description(fields: dict[str, np.ndarray]) -> list[str]:
    """The lines of the description, where it is text."""
    array = fields.get("description")
    if array is None or array.dtype.itemsize != 1:
        return []
    text = array.tobytes().decode("utf-8", "replace").replace("\0", "")
    return [line.strip() for line in text.splitlines() if line.strip()]


def _short(name: str) -> str:
    return repr(name if len(name) <= 40 else name[:37] + "...")
