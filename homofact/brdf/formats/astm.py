"""ASTM E1392 text (standard practice for angle-resolved scatter), as the Cornell laboratory and others write it.

    LAB_NAME …                                     keys in capitals and their text, one a line
    NUM_POINTS 1439                                how many rows there are
    VARS theta_i,phi_i,theta_s,phi_s,R,G,B         the columns; the last line of the header
    0.17,0,0.35,3.14,0.1,0.2,0.3                   rows, comma-separated

A missing phi_i or phi_s is 0. A negative theta_s means the angle |theta_s| at the azimuth phi_s + π. Values are f in
sr⁻¹ without the cosine: R, G, B linear; X, Y, Z of CIE, turned into linear sRGB; "465nm" spectral; anything else a
channel of that name. The standard gives angles in degrees, the laboratory's files in radians. The reader assumes
degrees if, of the rows with an angle above 0, more than a quarter have one above π/2. It records the unit in the
provenance. If all light comes from one azimuth, the material is read as isotropic. Negative values (colours out of
gamut, noise) are set to 0 and counted.

`write` writes angles in radians and all digits of each number: values are read back bit-identical, directions up to
rounding. Isotropic samples are rotated so that the light is at φi = 0, which tells a reader that they are isotropic.
Weights are not written.
"""

import math
import os

import torch

from homofact.brdf.channels import check_channels
from homofact.brdf.formats.reading import check_azimuths, in_channels, line_fault
from homofact.brdf.samples import Samples, lit_from_one_azimuth
from homofact.brdf.spectral import FROM_XYZ
from homofact.brdf.wavelengths import wavelengths_of
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.text import check_last_line, number_table, numbered_lines, short
from homofact.geometry.directions import from_spherical, to_spherical

NAME = "astm"
DESCRIPTION = "ASTM E1392 text (NUM_POINTS, VARS theta_i,…)"
ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")
_MOST_COLUMNS = 4096
_SLACK = 1e-6


def sniff(head: bytes) -> bool:
    """Return whether a file that begins with `head` is of this format: a line VARS that names theta_i."""
    lines = (line.split(None, 1) for _, line in numbered_lines(head))
    return any(len(words) == 2 and words[0] == "VARS" and "theta_i" in words[1] for words in lines)


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """Return the samples of a file.

    Raises BadInput naming file and line: no VARS or NUM_POINTS, columns missing or given twice, another number
    of rows, wrong column counts, numbers that are none, directions under the horizon, a cut end.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(numbered_lines(raw))
    names, count, comments, start = _header(path, lines)
    numbers, places = number_table(path, lines[start:], len(names), "as VARS names", ",")
    if len(numbers) != count:
        raise BadInput(f"{len(numbers)} rows", where=path, expected=f"{count} (NUM_POINTS)")
    check_last_line(path, raw, lines[-1][0])
    table = {name: torch.from_numpy(numbers[:, k].copy()) for k, name in enumerate(names)}
    zero = torch.zeros(count, dtype=torch.float64)
    theta_i, phi_i, theta_s, phi_s = (table.get(name, zero) for name in ANGLES)
    steep = torch.maximum(theta_i.abs(), theta_s.abs())
    # A few angles beyond the horizon are no degrees, they are wrong.
    degrees = 4 * int((steep > math.pi / 2 + _SLACK).sum()) > int((steep > 0).sum())
    scale, unit = (math.pi / 180, "degrees") if degrees else (1.0, "radians")
    wrong = (theta_i < 0) | (steep * scale > math.pi / 2 + _SLACK)
    if bool(wrong.any()):
        row = int(wrong.nonzero()[0])
        what = f"theta_i {float(theta_i[row]):g}, theta_s {float(theta_s[row]):g}"
        raise line_fault(path, places[row], what, "angles up to the horizon, pi/2 radians or 90 degrees")
    for name, phi in (("phi_i", phi_i), ("phi_s", phi_s)):
        check_azimuths(path, places, name, phi, degrees)
    listed = [name for name in names if name not in ANGLES]
    values = torch.from_numpy(numbers[:, [names.index(name) for name in listed]])
    colours = tuple(listed)
    if colours == ("X", "Y", "Z"):
        values, colours = values @ torch.tensor(FROM_XYZ, dtype=torch.float64).T, ("R", "G", "B")
    negative = values < 0
    across = torch.where(theta_s < 0, math.pi, 0.0)
    wi = from_spherical((theta_i * scale).clamp_max(math.pi / 2), phi_i * scale)
    samples = Samples(
        wi,
        from_spherical((theta_s.abs() * scale).clamp_max(math.pi / 2), phi_s * scale + across),
        values.clamp_min(0),
        channels=colours,
        isotropic=lit_from_one_azimuth(wi),
        provenance={
            "format": NAME,
            "comments": comments,
            "units": f"1/sr, no cosine; angles in {unit}",
            "faults": {"negative": int(negative.sum()), "exact_zeros": int((values == 0).sum())},
        }
        | ({"wavelengths_nm": list(nm)} if (nm := wavelengths_of(colours)) else {}),
    )
    return in_channels(path, samples, channels)


def _header(path: object, lines: list[tuple[int, str]]) -> tuple[list[str], int, list[str], int]:
    """Columns, number of rows, other header lines, and the index of the first row."""
    count, comments = None, []
    for index, (number, line) in enumerate(lines):
        key, _, text = line.partition(" ")
        text = text.strip()
        if key == "NUM_POINTS":
            if not (text.isascii() and text.isdecimal() and len(text) < 10 and int(text) > 0):
                raise line_fault(path, number, f"NUM_POINTS is {short(text)}", "how many rows there are")
            count = int(text)
        elif key == "VARS":
            if count is None:
                raise line_fault(path, number, "VARS before NUM_POINTS", "how many rows there are")
            # The length in lines is known, so a count that the file cannot hold is refused here.
            if count > len(lines) - index - 1:
                raise BadInput(f"{len(lines) - index - 1} rows", where=path, expected=f"{count} (NUM_POINTS)")
            return _columns(path, number, text), count, comments, index + 1
        elif len(comments) < 64:
            comments.append(line[:200])
    raise BadInput("no VARS", where=path, expected="a line that names the columns")


def _columns(path: object, number: int, text: str) -> list[str]:
    names = [" ".join(word.split()) for word in text.split(",")]
    if len(names) > _MOST_COLUMNS or "" in names or len(set(names)) < len(names):
        raise line_fault(path, number, f"VARS has {len(names)} columns", "different names")
    if "theta_i" not in names or "theta_s" not in names or all(name in ANGLES for name in names):
        raise line_fault(path, number, f"VARS is {short(text)}", "theta_i, theta_s and values")
    return names


def write(path: str | os.PathLike[str], samples: Samples, name: str = "sample") -> None:
    """Write samples under the SAMPLE_NAME `name`. Raises BadInput for channel names that the format cannot hold."""
    for channel in samples.channels:
        if channel in ANGLES or " ".join(channel.split()) != channel or not channel or "," in channel:
            raise BadInput(f"channel {channel!r}", where="ASTM file", expected="a name without commas that is no angle")
    theta_i, phi_i = to_spherical(samples.wi)
    theta_s, phi_s = to_spherical(samples.wo)
    if samples.isotropic:
        phi_i, phi_s = torch.zeros_like(phi_i), torch.remainder(phi_s - phi_i, 2 * torch.pi)
    columns = torch.cat((torch.stack((theta_i, phi_i, theta_s, phi_s), 1), samples.values), 1)
    head = [
        f'SAMPLE_NAME "{" ".join(name.split())}"',
        "MEAS_NAME BRDF",
        f"NUM_POINTS {len(samples)}",
        f"VARS {','.join((*ANGLES, *samples.channels))}",
    ]
    rows = [",".join(map(repr, row)) for row in columns.tolist()]
    write_text(path, "\n".join([*head, "", *rows]) + "\n")
