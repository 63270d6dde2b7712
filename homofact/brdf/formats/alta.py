"""The text format of the ALTA library (Belcour, Barla and Pacanowski), by its documentation.

    #DIM 3 1                                 numbers of inputs and of values in a row
    #VS 0                                    0, 1 or 2 further columns a value, an interval: left unread
    #PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI      what the inputs are: see `alta_parameters`
    #PARAM_OUT INV_STERADIAN_COSINE_FACTOR   what the values are
    0.26 -1.57 0.0 0.0005                    a row a sample, in blanks

INV_STERADIAN is f in sr⁻¹. INV_STERADIAN_COSINE_FACTOR is f cosθo, and the reader divides by the cosine (a published
file then becomes reciprocal to 2%). RGB_COLOR and XYZ_COLOR are read as f in linear sRGB and CIE XYZ. Other lines with
# are comments. `#CHANNELS` names the values; only homofact writes it. If the line #PARAM_OUT is missing,
FILE#INV_STERADIAN or another of the four names supplies it. Rows with a direction below the horizon are left out and
counted. If the reader divides by a cosine, so are rows with a viewer within 0.6° of the horizon, since the division
would multiply their error by a hundred. Negative values are set to 0 and counted.

`write` writes f in sr⁻¹ (INV_STERADIAN) with all digits, isotropic samples as ISOTROPIC_TV_TL_DPHI and others as
SPHERICAL_TL_PL_TV_PV. Values are read back bit-identical. Directions are read back up to rounding, since the file
contains angles. CARTESIAN would keep directions bit-identical too, but such a file does not record that the material is
isotropic. Weights are not written.
"""

import math
import os
from collections.abc import Collection

import numpy as np
import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.alta_parameters import PARAMETERIZATIONS
from homofact.brdf.formats.reading import in_channels, line_fault
from homofact.brdf.samples import Samples
from homofact.brdf.spectral import FROM_XYZ
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes, split_member
from homofact.files.text import check_last_line, number_table, numbered_lines, short
from homofact.geometry.directions import to_spherical

NAME = "alta"
DESCRIPTION = "ALTA text (#DIM, #PARAM_IN, #PARAM_OUT or FILE#UNITS, rows)"
_COSINE = "INV_STERADIAN_COSINE_FACTOR"
_OUTPUTS = ("INV_STERADIAN", _COSINE, "RGB_COLOR", "XYZ_COLOR")
_LEAST_COSINE = 0.01
_SLACK = 1e-6
_MOST_COLUMNS = 4096


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format: #DIM among its first lines with #."""
    for _, line in numbered_lines(head):
        if line.startswith("#DIM"):
            return True
        if not line.startswith("#"):
            return False
    return False


def material_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the names that may follow FILE#, the units of the values."""
    return list(_OUTPUTS)


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file; they are isotropic if its parameterization omits the azimuth of the pair.

    Raises BadInput that names file and line for an unknown or missing PARAM_IN or PARAM_OUT, sizes that disagree, wrong
    column counts, words that are not numbers, a truncated file, and a file without rows above the horizon.
    """
    check_channels(channels)
    path, stated = split_member(path)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(numbered_lines(raw))
    header, comments = _header(path, lines)
    name = _named(path, header, "#PARAM_IN", PARAMETERIZATIONS)
    output = _output(path, header, stated)
    parameters = PARAMETERIZATIONS[name]
    count, intervals = _sizes(path, header, parameters.columns)
    if output.endswith("COLOR") and count != 3:
        raise BadInput(f"{output} with {count} values a row", where=path, expected="3")
    rows = [(number, line) for number, line in lines if not line.startswith("#")]
    if not rows:
        raise BadInput(
            "no samples after the header", where=path, expected=f"rows of {parameters.columns + count} numbers"
        )
    what = f"{parameters.columns} of {name}, {count} values" + (f", {intervals} of intervals" if intervals else "")
    numbers, places = number_table(path, rows, parameters.columns + count + intervals, what)
    check_last_line(path, raw, lines[-1][0])
    wide = np.abs(numbers[:, : parameters.columns]).max(1) > 2 * math.pi + _SLACK
    if parameters.angles and wide.any():
        row = int(wide.argmax())
        angles = numbers[row, : parameters.columns].tolist()
        raise line_fault(path, places[row], f"{name} is {angles}", "angles in radians")
    light, view = parameters.directions(torch.from_numpy(numbers[:, : parameters.columns].copy()))
    values = torch.from_numpy(numbers[:, parameters.columns : parameters.columns + count].copy())
    usable = _above(light) & _above(view)
    near = usable & (view[:, 2] < _LEAST_COSINE) if output == _COSINE else torch.zeros_like(usable)
    keep = usable & ~near
    light, view, values = _on(light[keep]), _on(view[keep]), values[keep]
    if not len(values):
        raise BadInput(
            f"none of {len(keep)} rows has both directions above the horizon", where=path, expected="at least one"
        )
    if output == _COSINE:
        values = values / view[:, 2:]
    if output == "XYZ_COLOR":
        values = values @ torch.tensor(FROM_XYZ, dtype=torch.float64).T
    negative = values < 0
    faults = {
        "under_horizon": int((~usable).sum()),
        "at_horizon": int(near.sum()),
        "negative": int(negative.sum()),
        "exact_zeros": int((values == 0).sum()),
    }
    samples = Samples(
        light,
        view,
        values.clamp_min(0),
        channels=_channels(path, header, count),
        isotropic=parameters.isotropic,
        provenance={
            "format": NAME,
            "comments": comments,
            "parameterization": name + (f" ({parameters.open})" if parameters.open else ""),
            "units": "1/sr, no cosine"
            + ("; cosine of the view divided out" if output == _COSINE else "")
            + (f"; {output} stated, not in the file" if "#PARAM_OUT" not in header else ""),
            "faults": faults,
        },
    )
    return in_channels(path, samples, channels)


def _header(path: object, lines: list[tuple[int, str]]) -> tuple[dict[str, tuple[int, str]], list[str]]:
    """(line, text) by key, and the comments. A key given twice with two meanings is an error."""
    header: dict[str, tuple[int, str]] = {}
    comments: list[str] = []
    for number, line in lines:
        if not line.startswith("#"):
            continue
        key, _, text = line.partition(" ")
        if key in ("#DIM", "#VS", "#PARAM_IN", "#PARAM_OUT", "#CHANNELS"):
            if header.get(key, (0, text.strip()))[1] != text.strip():
                raise line_fault(path, number, f"{key} for the second time", "it once")
            header[key] = (number, text.strip())
        elif "BINARY" in key or (key == "#FORMAT" and "binary" in text.lower()):
            raise line_fault(path, number, "binary ALTA data", "text")
        elif len(comments) < 64:
            comments.append(line.lstrip("# ")[:200])
    return header, [comment for comment in comments if comment]


def _named(path: object, header: dict[str, tuple[int, str]], key: str, known: Collection[str]) -> str:
    number, text = header.get(key, (0, ""))
    words = ", ".join(known)
    if not text:
        raise BadInput(f"no {key}, so its units are unknown", where=path, expected=f"one of {words}")
    if text not in known:
        raise line_fault(path, number, f"{key} is {short(text)}", f"one of {words}")
    return text


def _output(path: object, header: dict[str, tuple[int, str]], stated: str | None) -> str:
    """What the values are: by #PARAM_OUT, or as FILE#NAME states where that is missing."""
    held = header.get("#PARAM_OUT", (0, ""))[1]
    if stated is None and not held:
        name = os.path.basename(str(path))
        hint = f"or state it: {name}#{_OUTPUTS[0]}, or {name}#{_COSINE} where the cosine of the view is in"
        raise BadInput(
            "no #PARAM_OUT, so its units are unknown", where=path, expected=f"one of {', '.join(_OUTPUTS)}", hint=hint
        )
    if stated is None:
        return _named(path, header, "#PARAM_OUT", _OUTPUTS)
    if held and held != stated:
        raise BadInput(f"#PARAM_OUT is {short(held)}", where=path, expected=f"no #{stated} with it")
    if stated not in _OUTPUTS:
        raise BadInput(f"units {short(stated)}", where=path, expected=f"one of {', '.join(_OUTPUTS)}")
    return stated


def _sizes(path: object, header: dict[str, tuple[int, str]], columns: int) -> tuple[int, int]:
    """(values, further columns) of a row."""
    number, text = header.get("#DIM", (0, ""))
    words = text.split()
    if len(words) != 2 or not all(word.isascii() and word.isdecimal() and len(word) < 6 for word in words):
        raise line_fault(path, number, f"#DIM is {short(text)}", "two numbers: inputs and values")
    if int(words[0]) != columns or not 1 <= int(words[1]) <= _MOST_COLUMNS:
        raise line_fault(path, number, f"#DIM is {short(text)}", f"{columns} inputs and 1 or more values")
    number, text = header.get("#VS", (0, "0"))
    intervals = text.split()
    if not intervals or len(intervals) > _MOST_COLUMNS or any(word not in ("0", "1", "2") for word in intervals):
        raise line_fault(path, number, f"#VS is {short(text)}", "0, 1 or 2 for each value")
    # One number stands for all values.
    intervals = intervals * int(words[1]) if len(intervals) == 1 else intervals
    if len(intervals) != int(words[1]):
        raise line_fault(path, number, f"#VS has {len(intervals)} numbers", f"{words[1]}, one for each value")
    return int(words[1]), sum(map(int, intervals))


def _channels(path: object, header: dict[str, tuple[int, str]], count: int) -> tuple[str, ...]:
    number, text = header.get("#CHANNELS", (0, ""))
    if text:
        names = tuple(text.split())
        if len(names) != count or len(set(names)) != count:
            raise line_fault(path, number, f"#CHANNELS is {short(text)}", f"{count} different names")
        return names
    return {1: ("Y",), 3: ("R", "G", "B")}.get(count) or tuple(f"value{k}" for k in range(1, count + 1))


def _above(w: Tensor) -> Tensor:
    """Rows that are unit vectors on or above the horizon, up to rounding."""
    return ((w.norm(dim=1) - 1).abs() <= 1e-3) & (w[:, 2] >= -_SLACK)


def _on(w: Tensor) -> Tensor:
    """Unit vectors of rows that rounding left off the sphere or under the horizon."""
    w = torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1)
    length = w.norm(dim=1, keepdim=True)
    # Vectors of length 1 to the last digit stay bit for bit what they were.
    return torch.where((length - 1).abs() <= 4 * torch.finfo(w.dtype).eps, w, w / length)


_WRITTEN = ("ISOTROPIC_TV_TL_DPHI", "SPHERICAL_TL_PL_TV_PV", "CARTESIAN")


def write(
    path: str | os.PathLike[str], samples: Samples, parameterization: str | None = None, comments: tuple[str, ...] = ()
) -> None:
    """Write samples; `parameterization` defaults to the one for isotropic or anisotropic samples.

    Raises BadInput for an unknown parameterization, an isotropic one for anisotropic samples, channel names
    with blanks, and where the place cannot be written.
    """
    name = parameterization or _WRITTEN[0 if samples.isotropic else 1]
    if name not in _WRITTEN:
        raise BadInput(where="ALTA parameterization", found=repr(name), expected=f"one of {', '.join(_WRITTEN)}")
    if name == _WRITTEN[0] and not samples.isotropic:
        raise BadInput(f"{name} for anisotropic samples", where="ALTA parameterization", expected=_WRITTEN[1])
    if any(channel.split() != [channel] for channel in samples.channels):
        raise BadInput(f"channels {', '.join(samples.channels)}", where="ALTA file", expected="names without blanks")
    columns = torch.cat((_inputs(samples, name), samples.values), 1)
    head = [f"#SOURCE {' '.join(line.split())}" for line in comments]
    head += [
        f"#DIM {columns.shape[1] - len(samples.channels)} {len(samples.channels)}",
        "#VS 0",
        f"#PARAM_IN {name}",
        "#PARAM_OUT INV_STERADIAN",
        f"#CHANNELS {' '.join(samples.channels)}",
    ]
    rows = [" ".join(map(repr, row)) for row in columns.tolist()]
    write_text(path, "\n".join([*head, *rows]) + "\n")


def _inputs(samples: Samples, name: str) -> Tensor:
    if name == "CARTESIAN":
        return torch.cat((samples.wo, samples.wi), 1)
    theta_l, phi_l = to_spherical(samples.wi)
    theta_v, phi_v = to_spherical(samples.wo)
    if name == "SPHERICAL_TL_PL_TV_PV":
        return torch.stack((theta_l, phi_l, theta_v, phi_v), 1)
    turn = torch.remainder(phi_l - phi_v + math.pi, 2 * math.pi) - math.pi
    return torch.stack((theta_v, theta_l, turn), 1)
