"""Comma-separated text with a header that says what it holds: our own format for other programs' sake.

    # isotropic: true
    theta_i,phi_i,theta_o,phi_o,R,G,B
    0.1,0,0.2,3.14,0.5,0.4,0.3

Lines with # come before the header: `isotropic` and `noise_free` take true or false (both false unless
stated), others are comments. The header names the columns, in any order: both directions as theta_i, phi_i,
theta_o, phi_o in radians, the same with _deg in degrees, or wi_x … wo_z; `weight` if there is one; every other
column is a channel of f in sr⁻¹ without the cosine, "550nm" being a wavelength. φ is absolute: the mirror
direction of φi = 0 is φo = π.

`write` gives every number with all its digits and directions as vectors, so that samples come back bit for bit; there
is a column `weight` where weights differ from 1.
"""

import math
import os

import torch
from torch import Tensor

from homofact.brdf.channels import as_channels, check_channels, wavelengths_of
from homofact.brdf.formats.reading import check_azimuths
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.text import check_last_line, number_table, numbered_lines, short
from homofact.geometry.directions import from_spherical

NAME = "csv"
DESCRIPTION = "CSV with a header (theta_i,phi_i,theta_o,phi_o or wi_x … wo_z; channels)"
ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
VECTORS = ("wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
_DEGREES = tuple(f"{name}_deg" for name in ANGLES)
_FORMS = (ANGLES, _DEGREES, VECTORS)
_MOST_COLUMNS = 4096
_SLACK = 1e-6
_LENGTH_TOLERANCE = 1e-3


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is of this format: a header with one of the directions' names."""
    for _, line in numbered_lines(head):
        if not line.startswith("#"):
            words = {word.strip() for word in line.split(",")}
            return len(words) > 1 and any(name in words for form in _FORMS for name in form)
    return False


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """The samples of a file. Exact zeros are kept and counted.

    Raises BadInput naming file and line: a header without directions or channels, names given twice, wrong
    column counts, numbers that are none or negative, directions under the horizon or not of unit length, a cut
    end.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(numbered_lines(raw))
    facts, comments, index = _stated(path, lines)
    number, line = lines[index]
    names = [word.strip() for word in line.split(",")]
    form = _form(path, number, names)
    values = [name for name in names if name not in form and name != "weight"]
    if not values:
        raise BadInput(f"{path}: line {number}: no channel beside the directions, expected at least one")
    rows = lines[index + 1 :]
    if not rows:
        raise BadInput(f"{path}: no samples after the header, expected rows of {len(names)} numbers")
    numbers, places = number_table(path, rows, len(names), "as the header names", ",")
    check_last_line(path, raw, lines[-1][0])
    table = {name: torch.from_numpy(numbers[:, k].copy()) for k, name in enumerate(names)}
    for name in (*values, "weight"):
        if name in table and bool((table[name] < 0).any()):
            row = int((table[name] < 0).nonzero()[0])
            raise BadInput(f"{path}: line {places[row]}: {name} is {float(table[name][row]):g}, expected >= 0")
    wi, wo = (_directions(path, places, table, form, which) for which in "io")
    stacked = torch.stack([table[name] for name in values], 1)
    zeros = stacked == 0
    samples = Samples.make(
        wi,
        wo,
        stacked,
        channels=tuple(values),
        isotropic=facts["isotropic"],
        weights=table.get("weight"),
        provenance={
            "format": NAME,
            "comments": comments,
            "units": "1/sr, no cosine",
            "faults": {"exact_zeros": int(zeros.sum()), "samples_with_zeros": int(zeros.any(1).sum())},
        }
        | ({"noise_free": True} if facts["noise_free"] else {})
        | ({"wavelengths_nm": list(nm)} if (nm := wavelengths_of(values)) else {}),
    )
    try:
        return as_channels(samples, channels)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error


def _stated(path: object, lines: list[tuple[int, str]]) -> tuple[dict[str, bool], list[str], int]:
    """What the comments state, the other comments, and the index of the header."""
    facts = {"isotropic": False, "noise_free": False}
    comments: list[str] = []
    for index, (number, line) in enumerate(lines):
        if not line.startswith("#"):
            return facts, comments, index
        key, mark, value = line.lstrip("# ").partition(":")
        if mark and key.strip() in facts:
            if value.strip().lower() not in ("true", "false"):
                raise BadInput(
                    f"{path}: line {number}: {key.strip()} is {short(value.strip())}, expected true or false"
                )
            facts[key.strip()] = value.strip().lower() == "true"
        elif len(comments) < 64 and line.lstrip("# "):
            comments.append(line.lstrip("# ")[:200])
    raise BadInput(f"{path}: only comments, expected a header that names the columns")


def _form(path: object, number: int, names: list[str]) -> tuple[str, ...]:
    if len(names) > _MOST_COLUMNS or "" in names:
        raise BadInput(f"{path}: line {number}: {len(names)} columns, one without a name; expected a name each")
    twice = sorted({name for name in names if names.count(name) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise BadInput(f"{path}: line {number}: {short(twice[0])} names two columns, expected different names")
    given = [form for form in _FORMS if any(name in names for name in form)]
    if len(given) != 1 or not all(name in names for name in given[0]):
        found = ", ".join(name for form in given for name in form if name in names)
        raise BadInput(
            f"{path}: line {number}: directions by {found or 'nothing'};"
            f" expected all of {', '.join(ANGLES)}, the same with _deg, or all of {', '.join(VECTORS)}"
        )
    return given[0]


def _directions(path: object, places: list[int], table: dict[str, Tensor], form: tuple[str, ...], which: str) -> Tensor:
    if form == VECTORS:
        w = torch.stack([table[f"w{which}_{axis}"] for axis in "xyz"], 1)
        length = w.norm(dim=1)
        wrong = ((length - 1).abs() > _LENGTH_TOLERANCE) | (w[:, 2] < -_SLACK)
        said = [f"w{which} {[round(x, 6) for x in row]}" for row in w[wrong][:1].tolist()]
        # Vectors of length 1 to the last digits stay bit for bit what they were.
        w = torch.where(((length - 1).abs() <= 1e-15)[:, None], w, w / length.clamp_min(1e-300)[:, None])
        w = torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1)
    else:
        scale = math.pi / 180 if form == _DEGREES else 1.0
        suffix = "_deg" if form == _DEGREES else ""
        theta, phi = (table[f"{kind}_{which}{suffix}"] for kind in ("theta", "phi"))
        check_azimuths(path, places, f"phi_{which}{suffix}", phi, form == _DEGREES)
        wrong = (theta < 0) | (theta * scale > math.pi / 2 + _SLACK)
        said = [f"theta_{which}{suffix} {x:g}" for x in theta[wrong][:1].tolist()]
        w = from_spherical((theta * scale).clamp_max(math.pi / 2), phi * scale)
    if said:
        row = int(wrong.nonzero()[0])
        raise BadInput(
            f"{path}: line {places[row]}: {said[0]}, expected a unit vector on or above the horizon"
            + ("" if form == VECTORS else f" ({'0 to 90 degrees' if form == _DEGREES else '0 to pi/2 radians'})")
        )
    return w


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
    write_text(path, "\n".join([*lines, ",".join(header), *rows]) + "\n")
