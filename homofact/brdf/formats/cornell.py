"""The text format of the Cornell Program of Computer Graphics' reflectance measurements.

    # comments, the material's name among them
    31                                 number of wavelengths
    400 410 420 … 700                  the wavelengths in nm, over as many lines as it takes
    θi φi θs φs v1 … v31               a row a sample: radians, spectral BRDF in sr⁻¹ without the cosine

φ is absolute (the mirror direction of φi = 0 is φs = π). The file does not say how many rows it has: one
cut exactly between two rows cannot be told from a whole one, one cut anywhere else is refused.
"""

import math
import os
from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

from homofact.brdf.channels import as_channels, check_channels, spectral_names
from homofact.brdf.formats.reading import check_azimuths
from homofact.brdf.samples import Samples
from homofact.errors import BadInput
from homofact.files.atomic import write_text
from homofact.files.reading import read_bytes
from homofact.files.text import short, text_of
from homofact.geometry.directions import from_spherical

NAME = "cornell"
DESCRIPTION = "Cornell text (number of wavelengths, wavelengths, rows of four angles and a spectrum)"
# π/2 rounded to six digits may lie above it; more is under the horizon.
_ANGLE_SLACK = 1e-6


def sniff(head: bytes) -> bool:
    """Whether a file that begins with `head` is of this format: a count alone, then rising wavelengths."""
    lines = [line.split() for _, line in _content(head)]
    if b"# num wls" in head and (not lines or len(lines[0]) == 1):
        return True
    if len(lines) < 2 or len(lines[0]) != 1 or not _is_count(lines[0][0]):
        return False
    try:
        first = [float(word) for word in lines[1][: int(lines[0][0])]]
    except ValueError:
        return False
    return all(100 <= w <= 20_000 for w in first) and first == sorted(first)


def read(path: str | os.PathLike[str], channels: str = "rgb") -> Samples:
    """The samples of a file, isotropic, as "rgb" (linear sRGB under D65), "spectral" or "luminance".

    Exact zeros are kept: provenance["faults"] counts them. Raises BadInput naming file and line for numbers
    that are none, not finite or negative, wrong column counts, a cut end, directions under the horizon.
    """
    check_channels(channels)
    raw = read_bytes(path, DESCRIPTION)
    lines = list(_content(raw))
    wavelengths, start = _wavelengths(path, lines)
    rows = [_row(path, number, line, len(wavelengths)) for number, line in lines[start:]]
    if not rows:
        raise BadInput(
            "no samples after the wavelengths", where=path, expected=f"rows of {4 + len(wavelengths)} numbers"
        )
    if not raw.endswith((b"\n", b"\r")):
        raise BadInput(
            f"line {lines[-1][0]} has no line end, so its last number may be cut",
            where=path,
            expected="a whole file",
            hint="or add the line end",
        )
    table = torch.tensor(rows, dtype=torch.float64)
    theta_i, theta_s = (table[:, k].clamp_max(math.pi / 2) for k in (0, 2))
    for column, name in ((1, "phi_i"), (3, "phi_s")):
        check_azimuths(path, [number for number, _ in lines[start:]], name, table[:, column], False)
    values = table[:, 4:]
    zeros = values == 0
    comments = [line.lstrip("# ").rstrip() for line in text_of(raw).splitlines() if line.startswith("#")]
    samples = Samples(
        from_spherical(theta_i, table[:, 1]),
        from_spherical(theta_s, table[:, 3]),
        values,
        channels=spectral_names(wavelengths),
        isotropic=True,
        provenance={
            "format": NAME,
            "comments": [line for line in comments if line],
            "wavelengths_nm": wavelengths,
            "faults": {"exact_zeros": int(zeros.sum()), "samples_with_zeros": int(zeros.any(1).sum())},
        },
    )
    return as_channels(samples, channels)


def write(
    path: str | os.PathLike[str],
    angles: Tensor,
    spectra: Tensor,
    wavelengths: Sequence[float],
    comments: Sequence[str] = (),
) -> None:
    """Write angles (N, 4) in radians and spectra (N, W) in sr⁻¹, six digits after the point.

    Raises BadInput where the shapes disagree or the place cannot be written.
    """
    if angles.shape != (spectra.shape[0], 4) or spectra.shape[1] != len(wavelengths):
        raise BadInput(
            f"angles {tuple(angles.shape)}, spectra {tuple(spectra.shape)} and {len(wavelengths)} wavelengths disagree",
            where=path,
            expected="(N, 4), (N, W) and W",
        )
    text = [*(f"# {line}" for line in comments), "", "# num wls", str(len(wavelengths)), "", "# wls"]
    words = [f"{w:g}" for w in wavelengths]
    text += [" ".join(words[k : k + 19]) for k in range(0, len(words), 19)]
    text += ["", "# theta i, phi i, theta s, phi_s, spectral sample values", ""]
    text += [" ".join(f"{x:.6f}" for x in row) for row in torch.cat((angles, spectra), 1).tolist()]
    write_text(path, "\n".join(text) + "\n")


def _content(raw: bytes) -> Iterator[tuple[int, str]]:
    """(line number from 1, text) of every line that is neither blank nor a comment."""
    for number, line in enumerate(text_of(raw).split("\n"), 1):
        stripped = line.strip()
        if stripped and not stripped.startswith("#"):
            yield number, stripped


def _is_count(word: str) -> bool:
    """A positive whole number of at most six digits."""
    return word.isdecimal() and len(word) <= 6 and int(word) > 0


def _wavelengths(path: object, lines: list[tuple[int, str]]) -> tuple[list[float], int]:
    """The wavelengths in nm and the index of the first line after them."""
    if not lines:
        raise BadInput("only comments", where=path, expected="the number of wavelengths")
    number, line = lines[0]
    if not _is_count(line):
        raise BadInput(where=f"{path}: line {number}", found=short(line), expected="the number of wavelengths")
    count, wavelengths, index = int(line), [], 1
    while len(wavelengths) < count:
        if index == len(lines):
            raise BadInput(f"the file ends after {len(wavelengths)} wavelengths", where=path, expected=count)
        number, line = lines[index]
        for word in line.split():
            value = _number(path, number, word)
            if not value > (wavelengths[-1] if wavelengths else 0):
                raise BadInput(f"wavelength {word}", where=f"{path}: line {number}", expected="rising numbers above 0")
            wavelengths.append(value)
        if len(wavelengths) > count:
            raise BadInput(f"{len(wavelengths)} wavelengths", where=f"{path}: line {number}", expected=count)
        index += 1
    return wavelengths, index


def _row(path: object, number: int, line: str, wavelengths: int) -> list[float]:
    words = line.split()
    if len(words) != 4 + wavelengths:
        raise BadInput(
            f"{len(words)} columns",
            where=f"{path}: line {number}",
            expected=f"{4 + wavelengths} (4 angles and {wavelengths} values)",
        )
    row = [_number(path, number, word) for word in words]
    for name, theta in (("theta i", row[0]), ("theta s", row[2])):
        if not 0 <= theta <= math.pi / 2 + _ANGLE_SLACK:
            raise BadInput(
                f"{name} is {theta:g}, under the horizon", where=f"{path}: line {number}", expected="0 to pi/2 radians"
            )
    for k, value in enumerate(row[4:], 1):
        if value < 0:
            raise BadInput(f"value {k} is {value:g}", where=f"{path}: line {number}", expected="a BRDF >= 0")
    return row


def _number(path: object, number: int, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    # float() takes "1_0" too, which no measurement means.
    if not math.isfinite(value) or "_" in word:
        raise BadInput(where=f"{path}: line {number}", found=short(word), expected="a finite number")
    return value
