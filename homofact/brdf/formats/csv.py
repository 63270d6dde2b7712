"""Comma-separated text with a header of column names: homofact's own format for exchange with other programs.

    # isotropic: true
    theta_i,phi_i,theta_o,phi_o,R,G,B
    0.1,0,0.2,3.14,0.5,0.4,0.3

Lines with # come before the header: `isotropic` and `noise_free` take true or false, yes or no, others are comments. By
default `noise_free` is false, and samples lit from a single azimuth are isotropic, which the provenance notes. The
header names the columns, in any order: both directions as theta_i, phi_i, theta_o, phi_o in radians (or with _rad), the
same with _deg in degrees, or wi_x … wo_z; `weight` if there is one; every other column is a channel of f in sr⁻¹
without the cosine, "550nm" being a wavelength. Quotes and capitals in the names of directions do not matter. φ is
absolute: the mirror direction of φi = 0 is φo = π. If names have no unit and most θ are above π/2, all angles are taken
as degrees, which the provenance notes too. One column dphi, φo − φi, may replace both azimuths. Names of other
programs are read too: theta_in, thetaIn, phi_out, theta_r, delta_phi.

`write` writes all digits of each number and directions as vectors, so that samples are read back bit-identical. It adds
a column `weight` if any weight differs from 1.
"""

import math
import os
import re
from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import in_channels, line_fault, zeros_of
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.brdf.wavelengths import wavelengths_of
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.tables import FORMULAS
from homofact.files.text import check_last_line, number_table, numbered_lines, short
from homofact.geometry.directions import from_spherical

NAME = "csv"
DESCRIPTION = "CSV with a header (theta_i,phi_i,theta_o,phi_o or wi_x … wo_z; channels)"
ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o")
VECTORS = ("wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
_DEGREES = tuple(f"{name}_deg" for name in ANGLES)
_RADIANS = tuple(f"{name}_rad" for name in ANGLES)
# θi, θo and the difference of the azimuths φo − φi.
DIFFERENCE = ("theta_i", "theta_o", "dphi")
_OF_DIFFERENCE = tuple(tuple(f"{name}{unit}" for name in DIFFERENCE) for unit in ("", "_rad", "_deg"))
_FORMS = (ANGLES, _RADIANS, _DEGREES, *_OF_DIFFERENCE, VECTORS)
_IN_DEGREES = (_DEGREES, _OF_DIFFERENCE[2])
_OWN = {name for form in _FORMS for name in form} | {"weight"}
# What other programs call the directions' columns.
_ALIASES = {
    "theta_in": "theta_i", "phi_in": "phi_i", "theta_out": "theta_o", "phi_out": "phi_o", "theta_r": "theta_o",
    "phi_r": "phi_o", "delta_phi": "dphi",
}  # fmt: skip
_INNER_CAPITAL = re.compile("(?<=[a-z])(?=[A-Z])")
_WORDS = {"true": True, "yes": True, "false": False, "no": False}
_MOST_COLUMNS = 4096
_SLACK = 1e-6
_LENGTH_TOLERANCE = 1e-3
_ASSUMED = "taken as isotropic, because all light has one azimuth; to change this, write a line # isotropic: false"
_ASSUMED_DEGREES = (
    "angles taken as degrees, because most θ are above π/2; to state the unit, end the names of these columns in _deg"
)

# Which rows of a column are wrong (N,), and what is said of one.
_Fault = tuple[Tensor, Callable[[int], BadInput]]


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format: a header with one of the directions' names."""
    for _, line in numbered_lines(head):
        if not line.startswith("#"):
            words = set(_names(line))
            return len(words) > 1 and any(name in words for form in _FORMS for name in form)
    return False


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file. Exact zeros are kept and counted.

    Raises BadInput naming file and line: a header without directions or channels, names given twice, wrong
    column counts, numbers that are none or negative, directions under the horizon or not of unit length, a cut
    end.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(numbered_lines(raw))
    facts, comments, index = _stated(path, lines)
    number, line = lines[index]
    names = _names(line)
    form = _form(path, number, names)
    values = [name for name in names if name not in form and name != "weight"]
    if not values:
        raise line_fault(path, number, "no channel beside the directions", "at least one")
    rows = lines[index + 1 :]
    if not rows:
        raise BadInput("no samples after the header", where=path, expected=f"rows of {len(names)} numbers")
    numbers, places = number_table(path, rows, len(names), "as the header names", ",", names)
    check_last_line(path, raw, lines[-1][0])
    table = {name: torch.from_numpy(numbers[:, k].copy()) for k, name in enumerate(names)}
    if form in (ANGLES, DIFFERENCE) and float(torch.cat((table["theta_i"], table["theta_o"])).median()) > math.pi / 2:
        comments.append(_ASSUMED_DEGREES)
        table = {f"{name}_deg" if name in form else name: column for name, column in table.items()}
        form = tuple(f"{name}_deg" for name in form)
    _check(path, places, table, form)
    wi, wo = (_directions(table, form, which) for which in "io")
    isotropic = facts["isotropic"]
    if isotropic is None and (isotropic := lit_from_one_azimuth(wi)):
        comments.append(_ASSUMED)
    stacked = torch.stack([table[name] for name in values], 1)
    samples = Samples(
        wi,
        wo,
        stacked,
        channels=_colours(tuple(values)),
        isotropic=bool(isotropic),
        weights=table.get("weight"),
        provenance={
            "format": NAME,
            "comments": comments,
            "units": "1/sr, no cosine",
            "faults": zeros_of(stacked),
        }
        | ({"noise_free": True} if facts["noise_free"] else {})
        | ({"wavelengths_nm": list(nm)} if (nm := wavelengths_of(values)) else {}),
    )
    return in_channels(path, samples, channels)


def _stated(path: object, lines: list[tuple[int, str]]) -> tuple[dict[str, bool | None], list[str], int]:
    """What the comments state (None: nothing), the other comments, and the index of the header."""
    facts: dict[str, bool | None] = {"isotropic": None, "noise_free": None}
    comments: list[str] = []
    for index, (number, line) in enumerate(lines):
        if not line.startswith("#"):
            return facts, comments, index
        key, mark, value = line.lstrip("# ").partition(":")
        key = key.strip().lower()
        if mark and key in facts:
            # A table saved by a spreadsheet has a comma for each of its columns.
            value = value.strip().rstrip(",").strip()
            if value.lower() not in _WORDS:
                raise line_fault(path, number, f"{key} is {short(value)}", "true or false (or yes or no)")
            facts[key] = _WORDS[value.lower()]
        elif len(comments) < 64 and line.lstrip("# "):
            comments.append(line.lstrip("# ")[:200])
    raise BadInput("only comments", where=path, expected="a header that names the columns")


def _names(line: str) -> list[str]:
    """The columns' names in a header, the directions' as this format has them."""
    found = []
    for word in (each.strip().strip('"') for each in line.split(",")):
        # thetaIn is theta_in.
        named = (_own(small) for small in (word.lower(), _INNER_CAPITAL.sub("_", word).lower()))
        found.append(next((name for name in named if name in _OWN), word))
    return found


def _own(small: str) -> str:
    """A column's name in small letters as this format has it."""
    name, unit = (small[:-4], small[-4:]) if small.endswith(("_deg", "_rad")) else (small, "")
    return _ALIASES.get(name, name) + unit


def _form(path: object, number: int, names: list[str]) -> tuple[str, ...]:
    if len(names) > _MOST_COLUMNS or "" in names:
        raise line_fault(path, number, f"{len(names)} columns, one without a name", "a name each")
    twice = sorted({name for name in names if names.count(name) > 1}) if len(set(names)) < len(names) else []
    if twice:
        raise line_fault(path, number, f"{short(twice[0])} names two columns", "different names")
    given = list(dict.fromkeys(name for form in _FORMS for name in form if name in names))
    whole = [form for form in _FORMS if set(form) == set(given)]
    if not whole:
        expected = (
            f"all of {', '.join(ANGLES)}, or {', '.join(DIFFERENCE)} (φo − φi), the same with _deg in degrees,"
            f" or all of {', '.join(VECTORS)}"
        )
        other = next((name for name in names if name.startswith("phi") and name not in given), None)
        hint = "" if other is None else f"if {short(other)} is φo − φi, call it dphi"
        problem = f"directions by {', '.join(given) or 'nothing'}"
        raise BadInput(problem, where=f"{path}: line {number}", expected=expected, hint=hint)
    return whole[0]


def _check(path: object, places: list[int], table: dict[str, Tensor], form: tuple[str, ...]) -> None:
    """Raise BadInput for the first line with a value, a weight or a direction that cannot be; places are the lines."""
    faults = [(int(wrong.nonzero()[0]), said) for wrong, said in _faults(table, form) if bool(wrong.any())]
    if faults:
        row, said = min(faults, key=lambda fault: fault[0])
        raise said(row).at(f"{path}: line {places[row]}")


def _faults(table: dict[str, Tensor], form: tuple[str, ...]) -> Iterator[_Fault]:
    """Yield the wrong rows of each column, beginning with the columns of directions."""
    if form == VECTORS:
        for which in "io":
            yield _vector_fault(f"w{which}", torch.stack([table[f"w{which}_{axis}"] for axis in "xyz"], 1))
    else:
        for name in form:
            yield _angle_fault(name, table[name], form)
    for name, column in table.items():
        if name not in form:
            yield (
                column < 0,
                lambda row, name=name, column=column: BadInput(f"{name} is {float(column[row]):g}", expected=">= 0"),
            )


def _colours(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names of channels; r, g, b and red, green, blue in any letters are R, G, B, as other formats have them."""
    small = tuple(name.lower() for name in names)
    return ("R", "G", "B") if small in (("r", "g", "b"), ("red", "green", "blue")) else names


def _vector_fault(name: str, w: Tensor) -> _Fault:
    def said(row: int) -> BadInput:
        vector = [round(x, 6) for x in w[row].tolist()]
        return BadInput(f"{name} {vector}", expected="a unit vector on or above the horizon")

    return ((w.norm(dim=1) - 1).abs() > _LENGTH_TOLERANCE) | (w[:, 2] < -_SLACK), said


def _angle_fault(name: str, angle: Tensor, form: tuple[str, ...]) -> _Fault:
    unit, turn = ("degrees", 360.0) if form in _IN_DEGREES else ("radians", 2 * math.pi)
    polar = name.startswith("theta")
    if polar:
        wrong = (angle < 0) | (angle > turn / 4 + _SLACK * turn / (2 * math.pi))
        expected = f"{unit} from 0 to {'90' if form in _IN_DEGREES else 'pi/2'}"
    else:
        wrong = angle.abs() > turn * (1 + 1e-3)
        expected = f"at most a turn, {'360' if form in _IN_DEGREES else '2 pi'} {unit}"

    def said(row: int) -> BadInput:
        # A negative angle is no less wrong in degrees.
        degrees = form not in _IN_DEGREES and (float(angle[row]) > 0 or not polar)
        example = f"{form[0].removesuffix('_rad')}_deg"
        hint = f"for degrees end the names of all columns of angles in _deg, such as {example}" if degrees else ""
        return BadInput(f"{name} is {float(angle[row]):g}", expected=expected, hint=hint)

    return wrong, said


def _directions(table: dict[str, Tensor], form: tuple[str, ...], which: str) -> Tensor:
    """The directions (N, 3) towards the light ("i") or the viewer ("o")."""
    if form == VECTORS:
        w = torch.stack([table[f"w{which}_{axis}"] for axis in "xyz"], 1)
        length = w.norm(dim=1)
        # Vectors of length 1 to the last digits stay bit for bit what they were.
        w = torch.where(((length - 1).abs() <= 1e-15)[:, None], w, w / length.clamp_min(1e-300)[:, None])
        return torch.cat((w[:, :2], w[:, 2:].clamp_min(0)), 1)
    scale = math.pi / 180 if form in _IN_DEGREES else 1.0
    theta = next(table[name] for name in form if name.startswith(f"theta_{which}"))
    azimuths = [table[name] for name in form if name.startswith((f"phi_{which}", "dphi"))]
    # A difference of azimuths is the viewer's where the light's is 0.
    phi = torch.zeros_like(theta) if form in _OF_DIFFERENCE and which == "i" else azimuths[0]
    return from_spherical((theta * scale).clamp_max(math.pi / 2), phi * scale)


def write(path: str | os.PathLike[str], samples: Samples, comments: tuple[str, ...] = ()) -> None:
    """Write samples. Raises BadInput for channel names that the format cannot hold, and an unwritable place."""
    reserved = {"weight", *(name for form in _FORMS for name in form)}
    for name in samples.channels:
        if name in reserved or name != name.strip() or name[:1] in {"", *FORMULAS} or set(name) & set(",\n\r#"):
            raise BadInput(
                f"channel {name!r}",
                where="CSV file",
                expected="a name without commas, no column of directions and no formula",
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
