"""Tensor files of the RGL material database (Dupuy and Jakob 2018), `.bsdf`.

Fields that are read here (`formats.tensor_file` has the layout):

    theta_i (T)  phi_i (F)         angles of incidence in radians, F = 1 where the material is isotropic
    ndf (R, C)  sigma (R, C)       rows along the azimuth, columns along the angle from the normal
    vndf (F, T, R, C)              density of visible normals
    rgb (F, T, 3, R, C)            linear RGB; or spectra (F, T, W, R, C) with wavelengths (W) in nm
    jacobian (1)                   0 where D/(4σ) is in the values already; absent means it is not
    description                    text

The reader ignores the fields luminance (for importance sampling) and valid (of the acquisition). The stored values
contain cosθo; see `homofact.brdf.rgl`. Renderers need all fields except valid, including luminance (F, T, R, C).
"""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.adaptive import importance
from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import Drawing, Reading
from homofact.brdf.formats.tensor_file import DESCRIPTION as DESCRIPTION
from homofact.brdf.formats.tensor_file import MAGIC, read_tensors, short, tensor_bytes
from homofact.brdf.rgl import AdaptiveTable
from homofact.brdf.spectral import to_luminance, to_rgb
from homofact.brdf.wavelengths import spectral_names, wavelengths_of
from homofact.errors import BadInput
from homofact.files.atomic import write_bytes

NAME = "rgl"
_ANGLES, _PLANES = ("theta_i", "phi_i"), ("ndf", "sigma")
_RGB = ("R", "G", "B")


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is a tensor file."""
    return head.startswith(MAGIC)


def load(path: str | os.PathLike[str], channels: str = "rgb") -> AdaptiveTable:
    """Return a file's table in `channels`; "luminance" of a spectral file is CIE Y, of an RGB file still RGB.

    A spectral table is converted to linear sRGB or Y node by node, which is exact because f is linear in the table.
    facts["faults"] counts the negative entries. Raises BadInput as `read_tensors` does, and for a missing field, a
    wrong shape or type, numbers that are not finite, or "spectral" of an RGB file.
    """
    check_channels(channels)
    fields = read_tensors(path)
    kind = "spectra" if "spectra" in fields else "rgb"
    needed = [*_ANGLES, *_PLANES, "vndf", kind, *(["wavelengths"] if kind == "spectra" else [])]
    missing = [name for name in needed if name not in fields]
    if missing:
        raise BadInput(
            f"holds {', '.join(map(short, sorted(fields)[:12])) or 'no fields'}",
            where=path,
            expected=f"{', '.join(needed)}, of which {', '.join(missing)} missing",
        )
    if kind == "rgb" and channels == "spectral":
        raise BadInput(where="channels", found=f"'spectral' for {path}, which holds RGB", expected="rgb or luminance")
    axes = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "rgb": 5, "spectra": 5, "wavelengths": 1}
    tensors = {name: _floats(path, name, fields[name], axes[name]) for name in needed}
    names, values = _RGB, tensors[kind]
    facts: dict[str, Any] = {"format": NAME, "comments": _description(fields)}
    facts["units"] = "1/sr, no cosine; cos(theta_o) divided out"
    facts["faults"] = {"negative_entries": int((values < 0).sum())}
    if kind == "rgb" and values.shape[-1] != 3:
        raise BadInput(f"field rgb has {values.shape[-1]} channels", where=path, expected="3")
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
        raise error.at(path) from error


def open_file(path: str | os.PathLike[str], channels: str = "rgb", drawing: Drawing | None = None) -> Reading:
    """Return the table of a file as a reflectance, with samples of it drawn as `drawing` says; errors as in `load`."""
    table = load(path, channels)
    draw = drawing or Drawing()
    try:
        samples = table.sample(draw.count, draw.scheme, draw.seed)
    except BadInput as error:
        raise error.at(path) from error
    return Reading.of(path, samples, table, channels)


def write(path: str | os.PathLike[str], table: AdaptiveTable, comments: Sequence[str] = ()) -> None:
    """Write the bytes of `packed` to a file. Raises BadInput as `packed`, and if the file cannot be written."""
    try:
        content = packed(table, comments)
    except BadInput as error:
        raise error.at(path) from error
    write_bytes(path, content)


def packed(table: AdaptiveTable, comments: Sequence[str] = ()) -> bytes:
    """Return a table's file as renderers read it (Mitsuba's `measured`), in float32; `comments` fill the description.

    R, G and B are written to rgb, a single channel to all three channels of rgb, and two or more wavelengths to
    spectra. Every number that `load` reads is written unchanged. Raises BadInput for other channels and for numbers out
    of float32's range.
    """
    wavelengths = wavelengths_of(table.channels)
    spectral = wavelengths is not None and len(wavelengths) > 1
    if not spectral and len(table.channels) not in (1, 3):
        names = ", ".join(table.channels)
        raise BadInput(f"channels {names}", expected="R, G, B, one alone, or wavelengths")
    values = table.table if spectral or len(table.channels) == 3 else table.table.expand(*table.table.shape[:-1], 3)
    # A description without a character is no field that readers take.
    words = "\n".join(comments) or "a BRDF"
    tensors = {
        "phi_i": table.phi_i,
        "theta_i": table.theta_i,
        "sigma": table.sigma,
        "ndf": table.ndf,
        "vndf": table.vndf,
        "luminance": importance(table),
        "rgb": values.movedim(-1, 2),
    }
    fields = {"description": np.frombuffer(words.encode(errors="replace"), "u1")}
    with np.errstate(over="ignore"):
        fields |= {name: tensor.detach().cpu().numpy().astype("f4") for name, tensor in tensors.items()}
    for name, array in fields.items():
        if name != "description" and not np.isfinite(array).all():
            raise BadInput(f"{name} has values that are not finite in float32", expected="finite ones")
    if spectral:
        fields["spectra"] = fields.pop("rgb")
        fields["wavelengths"] = np.array(wavelengths, "f4")
    return tensor_bytes(fields | {"jacobian": np.array([table.jacobian], "u1")})


def _in_channels(values: Tensor, wavelengths: list[float], channels: str) -> tuple[Tensor, tuple[str, ...], Any]:
    """(table, channel names, facts of the colour) of a spectral table (F, T, R, C, W) in `channels`."""
    if len(wavelengths) != values.shape[-1]:
        raise BadInput(
            f"field spectra has {values.shape[-1]} wavelengths", expected=f"{len(wavelengths)}, the size of wavelengths"
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
            f"field {name} has shape {array.shape} of {array.dtype.name}", where=path, expected=f"{axes} axes of floats"
        )
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise BadInput(f"field {name} at {where} is {array[where]}", where=path, expected="finite numbers")
    if axes == 5:
        array = np.moveaxis(array, 2, -1)
    return torch.from_numpy(array.astype(np.float64 if array.dtype.itemsize == 8 else np.float32, order="C"))


def _flag(path: object, array: np.ndarray | None) -> bool:
    if array is None:
        return True
    if array.shape != (1,) or array.dtype.kind not in "iu" or array[0] not in (0, 1):
        raise BadInput(
            f"field jacobian has shape {array.shape} of {array.dtype.name}", where=path, expected="one 0 or 1"
        )
    return bool(array[0])


def _description(fields: dict[str, np.ndarray]) -> list[str]:
    """The lines of the description, where it is text."""
    array = fields.get("description")
    if array is None or array.dtype.itemsize != 1:
        return []
    text = array.tobytes().decode("utf-8", "replace").replace("\0", "")
    return [line.strip() for line in text.splitlines() if line.strip()]
